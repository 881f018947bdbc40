//! How far two pictures are apart: greatest difference, RMSE, PSNR, mean FLIP.

use super::color::linear_from_srgb16;
use super::flip::mean_flip;
use rayon::prelude::*;
use std::borrow::Cow;

/// A picture to compare: named channels, each one value a pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The channels in the file's order, named as in EXR: `R`, `depth.Z`.
    pub channels: Vec<Channel>,
}

/// One channel of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name.
    pub name: String,
    /// Its values, one a pixel.
    pub samples: Samples,
}

/// The values of a channel.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Shares of 1 in 65535ths (8 bits: v as 257 v, the same share); colour stands on the sRGB curve.
    Share(Vec<u16>),
    /// Floats; colour is linear light.
    Float(Vec<f32>),
    /// Numbers that name something, such as `id.part`.
    Id(Vec<u32>),
}

/// How far two pictures are apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Greatest difference of any value of any channel, 0 to 1.
    pub max: f64,
    /// Root of the mean square of all differences, 0 to 1.
    pub rmse: f64,
    /// −20 · log10(rmse) in dB, 0 or more; None where the pictures are equal.
    pub psnr: Option<f64>,
    /// Mean LDR-FLIP of the colour, 0 to 1, seen from 0.7 m on a screen 0.7 m wide with 3840 columns; 0 where the
    /// pictures have no colour.
    pub flip: f64,
}

impl Comparison {
    /// That of equal pictures.
    pub const EQUAL: Self = Self { max: 0.0, rmse: 0.0, psnr: None, flip: 0.0 };
}

/// Why two pictures cannot be compared value by value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Mismatch {
    /// They have different sizes.
    #[error("the sizes differ: {}x{} and {}x{}", .0[0], .0[1], .1[0], .1[1])]
    Size([u32; 2], [u32; 2]),
    /// They have different channels.
    #[error("the channels differ: {} and {}", .0.join(" "), .1.join(" "))]
    Channels(Vec<String>, Vec<String>),
    /// A channel holds other kinds of values.
    #[error("channel {0} holds {1} and {2}")]
    Samples(String, &'static str, &'static str),
}

/// Compares two pictures of equal size and channels.
///
/// max and rmse go over every value as it stands in the files, those of auxiliary channels too; a difference above 1
/// (of floats without bounds, of not-a-numbers, of ids) counts as 1. FLIP goes over R, G and B, clamped to [0, 1].
pub fn compare(a: &Picture, b: &Picture) -> Result<Comparison, Mismatch> {
    if a.size != b.size {
        return Err(Mismatch::Size(a.size, b.size));
    }
    let paired: Option<Vec<_>> = a.channels.iter().map(|c| Some((c, b.channel(&c.name)?))).collect();
    let Some(paired) = paired.filter(|p| p.len() == b.channels.len()) else {
        return Err(Mismatch::Channels(a.channel_names(), b.channel_names()));
    };
    let mut sums = Sums::default();
    for (a, b) in paired {
        match (&a.samples, &b.samples) {
            (Samples::Share(a), Samples::Share(b)) => {
                sums.add(a, b, |a, b| f64::from(a.abs_diff(b)) / 65535.0);
            }
            (Samples::Float(a), Samples::Float(b)) => sums.add(a, b, float_difference),
            (Samples::Id(a), Samples::Id(b)) => sums.add(a, b, |a, b| f64::from(u8::from(a != b))),
            (x, y) => return Err(Mismatch::Samples(a.name.clone(), x.kind(), y.kind())),
        }
    }
    let rmse = if sums.count == 0 { 0.0 } else { (sums.squares / sums.count as f64).sqrt() };
    let flip = if sums.max == 0.0 { 0.0 } else { color_flip(a, b) };
    // of black against white 0, not −0
    let psnr = (rmse > 0.0).then(|| 0.0 - 20.0 * rmse.log10());
    Ok(Comparison { max: sums.max, rmse, psnr, flip })
}

fn color_flip(a: &Picture, b: &Picture) -> f64 {
    match (a.linear_rgb(), b.linear_rgb()) {
        (Some(x), Some(y)) => mean_flip(a.size.map(|n| n as usize), &x, &y),
        _ => 0.0,
    }
}

#[derive(Default)]
struct Sums {
    max: f64,
    squares: f64,
    count: usize,
}

impl Sums {
    fn add<T: Copy + Sync>(&mut self, a: &[T], b: &[T], difference: impl Fn(T, T) -> f64 + Sync) {
        const CHUNK: usize = 1 << 16;
        let chunks: Vec<(f64, f64)> = a
            .par_chunks(CHUNK)
            .zip(b.par_chunks(CHUNK))
            .map(|(a, b)| {
                a.iter().zip(b).fold((0.0, 0.0), |(max, squares): (f64, f64), (&a, &b)| {
                    let d = difference(a, b);
                    (max.max(d), squares + d * d)
                })
            })
            .collect();
        for (max, squares) in chunks {
            self.max = self.max.max(max);
            self.squares += squares;
        }
        self.count += a.len();
    }
}

/// The difference of two floats, at most 1; the same infinity or not-a-number on both sides is no difference.
fn float_difference(a: f32, b: f32) -> f64 {
    if a == b || a.to_bits() == b.to_bits() {
        return 0.0;
    }
    // `min` returns 1 where the difference is not a number
    (f64::from(a) - f64::from(b)).abs().min(1.0)
}

impl Samples {
    /// How many they are.
    pub fn len(&self) -> usize {
        match self {
            Self::Share(values) => values.len(),
            Self::Float(values) => values.len(),
            Self::Id(values) => values.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Linear light; None where it is no light.
    fn linear(&self) -> Option<Cow<'_, [f32]>> {
        match self {
            Self::Share(values) => {
                let table = linear_from_srgb16();
                Some(values.par_iter().map(|&v| table[usize::from(v)]).collect::<Vec<_>>().into())
            }
            Self::Float(values) => Some(values.into()),
            Self::Id(_) => None,
        }
    }

    fn kind(&self) -> &'static str {
        match self {
            Self::Share(_) => "values on the sRGB curve",
            Self::Float(_) => "floats",
            Self::Id(_) => "ids",
        }
    }
}

impl Picture {
    fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|c| c.name == name)
    }

    fn channel_names(&self) -> Vec<String> {
        self.channels.iter().map(|c| c.name.clone()).collect()
    }

    fn linear_rgb(&self) -> Option<[Cow<'_, [f32]>; 3]> {
        let [r, g, b] = ["R", "G", "B"].map(|name| self.channel(name)?.samples.linear());
        Some([r?, g?, b?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(channels: &[(&str, &[f32])]) -> Picture {
        Picture {
            size: [2, 1],
            channels: channels
                .iter()
                .map(|(name, values)| Channel {
                    name: (*name).into(),
                    samples: Samples::Float(values.to_vec()),
                })
                .collect(),
        }
    }

    #[test]
    fn on_paper() {
        let a = picture(&[("R", &[0.0, 0.5]), ("G", &[0.0, 0.5]), ("B", &[0.0, 0.5])]);
        let mut b = a.clone();
        assert_eq!(compare(&a, &b), Ok(Comparison { max: 0.0, rmse: 0.0, psnr: None, flip: 0.0 }));
        b.channels[1].samples = Samples::Float(vec![0.0, 0.75]);
        let c = compare(&a, &b).unwrap();
        // one of six values differs by 0.25: √(0.0625 / 6) = 0.102062; −20 · log10 of that = 19.823
        assert_eq!(c.max, 0.25);
        assert!((c.rmse - 0.102_062).abs() < 1e-6 && (c.psnr.unwrap() - 19.823).abs() < 1e-3, "{c:?}");
        assert!(c.flip > 0.0 && c.flip < 1.0);
        let [black, white] =
            [0.0, 1.0].map(|v: f32| picture(&[("R", &[v; 2]), ("G", &[v; 2]), ("B", &[v; 2])]));
        let psnr = compare(&black, &white).unwrap().psnr.unwrap();
        assert!(psnr == 0.0 && psnr.is_sign_positive());
    }

    #[test]
    fn what_has_no_bounds_differs_by_1_at_most() {
        let a = picture(&[("depth.Z", &[f32::INFINITY, f32::NAN])]);
        assert_eq!(compare(&a, &a).unwrap().max, 0.0);
        let b = picture(&[("depth.Z", &[7.0, f32::NAN])]);
        // one of two values differs by 1: √(1/2)
        let c = compare(&a, &b).unwrap();
        assert!(c.max == 1.0 && (c.rmse - 0.5f64.sqrt()).abs() < 1e-12 && c.flip == 0.0, "{c:?}");
        let ids = |second| Picture {
            channels: vec![Channel { name: "id.part".into(), samples: Samples::Id(vec![5, second]) }],
            ..a.clone()
        };
        // as floats these two would be the same
        assert_eq!(compare(&ids(u32::MAX), &ids(u32::MAX - 1)).unwrap().max, 1.0);
    }

    #[test]
    fn mismatches_are_named() {
        let a = picture(&[("R", &[0.0, 0.5])]);
        let b = picture(&[("R", &[0.0, 0.5]), ("A", &[1.0, 1.0])]);
        assert_eq!(compare(&a, &b).unwrap_err().to_string(), "the channels differ: R and R A");
        assert_eq!(compare(&b, &a).unwrap_err().to_string(), "the channels differ: R A and R");
        let c = Picture { size: [1, 2], ..a.clone() };
        assert_eq!(compare(&a, &c).unwrap_err().to_string(), "the sizes differ: 2x1 and 1x2");
        let coded = Channel { name: "R".into(), samples: Samples::Share(vec![0, 9]) };
        assert_eq!(
            compare(&a, &Picture { channels: vec![coded], ..a.clone() }).unwrap_err().to_string(),
            "channel R holds floats and values on the sRGB curve"
        );
    }
}
