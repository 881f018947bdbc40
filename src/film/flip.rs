//! LDR-FLIP: how different two pictures look to someone who flips between them (Andersson, Nilsson, Akenine-Möller,
//! Oskarsson, Åström, Fairchild: FLIP: A Difference Evaluator for Alternating Images, HPG 2020).
//!
//! The filters are separable as in NVIDIA's own evaluator since its version 1.3; a sum of two Gaussians is the sum of
//! two separable filters.

use super::color::unit;
use rayon::prelude::*;
use std::borrow::Cow;
use std::f32::consts::PI;

/// Pixels per degree of someone 0.7 m in front of a screen 0.7 m wide with 3840 columns: FLIP's default.
const PIXELS_PER_DEGREE: f32 = 3840.0 * PI / 180.0;

/// Exponent and remapping of the colour difference: what is below `PC` of the greatest one takes [0, `PT`].
const QC: f32 = 0.7;
const PC: f32 = 0.4;
const PT: f32 = 0.95;
/// Width of the feature detectors in degrees; the exponent of the feature difference is ½.
const W: f32 = 0.082;

/// Contrast sensitivity as Gaussians (a, b) of achromatic, red-green and blue-yellow (two of them).
const CSF_Y: (f32, f32) = (1.0, 0.0047);
const CSF_CX: (f32, f32) = (1.0, 0.0053);
const CSF_CZ: [(f32, f32); 2] = [(34.1, 0.04), (13.5, 0.025)];

/// The mean FLIP error of two pictures in linear RGB, clamped to [0, 1] first; 0 for two pictures without pixels.
///
/// `size` is width and height; red, green and blue hold as many values each, rows from the top.
pub(super) fn mean_flip(size: [usize; 2], a: &[Cow<'_, [f32]>; 3], b: &[Cow<'_, [f32]>; 3]) -> f64 {
    let [width, height] = size;
    if width == 0 || height == 0 {
        return 0.0;
    }
    let (a, b) = (opponent_planes(a), opponent_planes(b));
    let color = color_difference(width, &a, &b);
    let feature = feature_difference(width, &a[0], &b[0]);
    // row by row and then in order, so that threads do not change the sum
    let rows: Vec<f64> = color
        .par_chunks(width)
        .zip(feature.par_chunks(width))
        .map(|(color, feature)| {
            color
                .iter()
                .zip(feature)
                .map(|(&c, &f)| if c == 0.0 { 0.0 } else { f64::from(libm::powf(c, 1.0 - f)) })
                .sum::<f64>()
        })
        .collect();
    rows.iter().sum::<f64>() / (width * height) as f64
}

// Colour spaces (section 4.1 of the paper; D65).

const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];

fn xyz_from_linear([r, g, b]: [f32; 3]) -> [f32; 3] {
    [
        0.412_386_56 * r + 0.357_591_5 * g + 0.180_450_48 * b,
        0.212_636_8 * r + 0.715_183 * g + 0.072_180_2 * b,
        0.019_330_62 * r + 0.119_197_17 * g + 0.950_372_6 * b,
    ]
}

fn linear_from_xyz([x, y, z]: [f32; 3]) -> [f32; 3] {
    [
        3.241_003_3 * x - 1.537_399 * y - 0.498_615_86 * z,
        -0.969_224_33 * x + 1.875_93 * y + 0.041_554_224 * z,
        0.055_639_423 * x - 0.204_011_2 * y + 1.057_149 * z,
    ]
}

/// Linear, opponent: achromatic Y, red-green Cx, blue-yellow Cz.
fn ycxcz_from_linear(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = xyz_from_linear(rgb);
    let (x, y, z) = (x / WHITE[0], y / WHITE[1], z / WHITE[2]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn linear_from_ycxcz([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (y + 16.0) / 116.0;
    linear_from_xyz([(y + cx / 500.0) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]])
}

/// CIELAB with Hunt's effect: chroma counts in proportion to lightness.
fn hunt_lab_from_linear(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let root = |t: f32| {
        if t > DELTA * DELTA * DELTA { libm::cbrtf(t) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = xyz_from_linear(rgb);
    let (x, y, z) = (root(x / WHITE[0]), root(y / WHITE[1]), root(z / WHITE[2]));
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

/// City blocks in lightness, Euclid in chroma.
fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (da, db) = (a[1] - b[1], a[2] - b[2]);
    (a[0] - b[0]).abs() + (da * da + db * db).sqrt()
}

fn opponent_planes([r, g, b]: &[Cow<'_, [f32]>; 3]) -> [Vec<f32>; 3] {
    let mut planes = [vec![0.0; r.len()], vec![0.0; r.len()], vec![0.0; r.len()]];
    let [y, cx, cz] = &mut planes;
    (y, cx, cz, &r[..], &g[..], &b[..]).into_par_iter().for_each(|(y, cx, cz, &r, &g, &b)| {
        [*y, *cx, *cz] = ycxcz_from_linear([r, g, b].map(unit));
    });
    planes
}

// Colour (sections 4.1.2 and 4.1.3): what the eye still tells apart at this distance.

fn color_difference(width: usize, a: &[Vec<f32>; 3], b: &[Vec<f32>; 3]) -> Vec<f32> {
    let kernels = CsfKernels::new();
    let ([ay, ax, az], [by, bx, bz]) = (kernels.filter(width, a), kernels.filter(width, b));
    let most =
        libm::powf(hyab(hunt_lab_from_linear([0.0, 1.0, 0.0]), hunt_lab_from_linear([0.0, 0.0, 1.0])), QC);
    (ay, ax, az, by, bx, bz)
        .into_par_iter()
        .map(|(ay, ax, az, by, bx, bz)| {
            let (a, b) = ([ay, ax, az], [by, bx, bz]);
            if a == b {
                return 0.0;
            }
            let lab = |p| hunt_lab_from_linear(linear_from_ycxcz(p).map(|x| x.clamp(0.0, 1.0)));
            remapped(libm::powf(hyab(lab(a), lab(b)), QC) / most)
        })
        .collect()
}

/// A share of the greatest colour difference, its small ones spread over most of [0, 1].
fn remapped(share: f32) -> f32 {
    if share < PC { PT / PC * share } else { PT + (share - PC) / (1.0 - PC) * (1.0 - PT) }
}

struct CsfKernels {
    y: Vec<f32>,
    cx: Vec<f32>,
    cz: [Vec<f32>; 2],
}

impl CsfKernels {
    fn new() -> Self {
        let normalized = |csf| {
            let kernel = csf_kernel(csf);
            let sum: f32 = kernel.iter().sum();
            kernel.iter().map(|k| k / sum).collect()
        };
        // the weights of both in the plane sum to s₀² + s₁²
        let cz = CSF_CZ.map(csf_kernel);
        let norm = cz.iter().map(|k| k.iter().sum::<f32>().powi(2)).sum::<f32>().sqrt();
        Self {
            y: normalized(CSF_Y),
            cx: normalized(CSF_CX),
            cz: cz.map(|kernel| kernel.iter().map(|k| k / norm).collect()),
        }
    }

    fn filter(&self, width: usize, [y, cx, cz]: &[Vec<f32>; 3]) -> [Vec<f32>; 3] {
        let [k0, k1] = &self.cz;
        let mut z = convolve(width, cz, k0, k0);
        let z1 = convolve(width, cz, k1, k1);
        z.par_iter_mut().zip(z1).for_each(|(z, z1)| *z += z1);
        [convolve(width, y, &self.y, &self.y), convolve(width, cx, &self.cx, &self.cx), z]
    }
}

/// One direction of the Gaussian a·√(π/b)·exp(−π²r²/b), r in degrees, out to three deviations of the widest of all.
fn csf_kernel((a, b): (f32, f32)) -> Vec<f32> {
    let widest = CSF_CZ[0].1;
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let amplitude = (a * (PI / b).sqrt()).sqrt();
    (-radius..=radius)
        .map(|i| {
            let r = i as f32 / PIXELS_PER_DEGREE;
            amplitude * libm::expf(-PI * PI * r * r / b)
        })
        .collect()
}

// Features (section 4.2): edges and points that one picture has and the other lacks.

fn feature_difference(width: usize, a: &[f32], b: &[f32]) -> Vec<f32> {
    let kernels = FeatureKernels::new();
    let (mut edge, point) = (kernels.edges(width, a), kernels.points(width, a));
    let (b_edge, b_point) = (kernels.edges(width, b), kernels.points(width, b));
    (&mut edge, point, b_edge, b_point).into_par_iter().for_each(|(e, p, be, bp)| {
        let most = (*e - be).abs().max((p - bp).abs());
        *e = (most * std::f32::consts::FRAC_1_SQRT_2).sqrt();
    });
    edge
}

/// A Gaussian and its first two derivatives, for Y as it stands: the detectors' answer to a constant is 0, and the
/// factor 1/116 takes Y to [0, 1].
struct FeatureKernels {
    gauss: Vec<f32>,
    edge: Vec<f32>,
    point: Vec<f32>,
}

impl FeatureKernels {
    fn new() -> Self {
        let deviation = 0.5 * W * PIXELS_PER_DEGREE;
        let radius = (3.0 * deviation).ceil() as i32;
        let taps = || (-radius..=radius).map(|i| i as f32 / deviation);
        let gauss = |x: f32| libm::expf(-0.5 * x * x);
        let sum: f32 = taps().map(gauss).sum();
        Self {
            gauss: taps().map(|x| gauss(x) / sum).collect(),
            edge: balanced(taps().map(|x| -x * gauss(x))),
            point: balanced(taps().map(|x| (x * x - 1.0) * gauss(x))),
        }
    }

    fn edges(&self, width: usize, y: &[f32]) -> Vec<f32> {
        self.length(width, y, &self.edge)
    }

    fn points(&self, width: usize, y: &[f32]) -> Vec<f32> {
        self.length(width, y, &self.point)
    }

    /// Length of the vector that a derivative along x and along y gives.
    fn length(&self, width: usize, y: &[f32], derivative: &[f32]) -> Vec<f32> {
        let mut along_x = convolve(width, y, derivative, &self.gauss);
        let along_y = convolve(width, y, &self.gauss, derivative);
        along_x.par_iter_mut().zip(along_y).for_each(|(x, y)| *x = (*x * *x + y * y).sqrt() / 116.0);
        along_x
    }
}

/// Scales the positive weights to sum to 1 and the negative ones to −1.
fn balanced(weights: impl Iterator<Item = f32>) -> Vec<f32> {
    let weights: Vec<f32> = weights.collect();
    let positive: f32 = weights.iter().filter(|w| **w > 0.0).sum();
    let negative: f32 = -weights.iter().filter(|w| **w < 0.0).sum::<f32>();
    weights.iter().map(|w| w / if *w > 0.0 { positive } else { negative }).collect()
}

/// Convolves a plane with a separable kernel; beyond the border its last pixel goes on.
fn convolve(width: usize, plane: &[f32], along_x: &[f32], along_y: &[f32]) -> Vec<f32> {
    let mut rows = vec![0.0; plane.len()];
    let radius = along_x.len() / 2;
    rows.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each_init(Vec::new, |padded, (out, row)| {
        padded.clear();
        padded.resize(radius, row[0]);
        padded.extend_from_slice(row);
        padded.resize(width + 2 * radius, row[width - 1]);
        for (weight, shifted) in along_x.iter().zip(padded.windows(width)) {
            accumulate(out, *weight, shifted);
        }
    });
    let height = plane.len() / width;
    let radius = along_y.len() / 2;
    let mut both = vec![0.0; plane.len()];
    both.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (tap, weight) in along_y.iter().enumerate() {
            let row = (y + tap).saturating_sub(radius).min(height - 1);
            accumulate(out, *weight, &rows[row * width..][..width]);
        }
    });
    both
}

fn accumulate(sums: &mut [f32], weight: f32, row: &[f32]) {
    for (sum, x) in sums.iter_mut().zip(row) {
        *sum += weight * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_keep_what_is_even() {
        let csf = CsfKernels::new();
        // radius: ⌈3 · √(0.04 / 2π²) · 67.02⌉ = ⌈9.05⌉
        assert_eq!(csf.y.len(), 21);
        let flat = csf.filter(5, &[vec![3.0; 20], vec![-2.0; 20], vec![1.0; 20]]);
        for (plane, value) in flat.iter().zip([3.0, -2.0, 1.0]) {
            assert!(plane.iter().all(|x| (x - value).abs() < 1e-5), "{plane:?}");
        }
        let features = FeatureKernels::new();
        // radius: ⌈3 · 0.5 · 0.082 · 67.02⌉ = ⌈8.24⌉
        assert_eq!(features.edge.len(), 19);
        assert!(
            features.edges(5, &[50.0; 20]).iter().chain(&features.points(5, &[50.0; 20])).all(|x| *x < 1e-5)
        );
    }

    #[test]
    fn a_step_is_an_edge_of_length_1() {
        // half of the first derivative's weights sum to 1, so a step from 0 to 116 answers 1 beside it
        let y: Vec<f32> = (0..40 * 40).map(|i| if i % 40 < 20 { 0.0 } else { 116.0 }).collect();
        let edges = FeatureKernels::new().edges(40, &y);
        assert!((edges[20 * 40 + 19] - 1.0).abs() < 1e-4 && (edges[20 * 40 + 20] - 1.0).abs() < 1e-4);
        assert!(edges[20 * 40 + 2] < 1e-5);
    }

    #[test]
    fn the_greatest_difference_is_1() {
        let flat = |rgb: [f32; 3]| rgb.map(|value| Cow::from(vec![value; 900]));
        let (green, blue) = (flat([0.0, 1.0, 0.0]), flat([0.0, 0.0, 1.0]));
        // flat pictures: no features, and green against blue is what the scale is made of
        assert!((mean_flip([30, 30], &green, &blue) - 1.0).abs() < 1e-3);
        assert_eq!(mean_flip([30, 30], &green, &green), 0.0);
        let none = [0; 3].map(|_| Cow::from(Vec::new()));
        assert_eq!(mean_flip([0, 0], &none, &none), 0.0);
    }

    #[test]
    fn opponent_colours_come_back() {
        for rgb in [[0.1, 0.5, 0.9], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0]] {
            let back = linear_from_ycxcz(ycxcz_from_linear(rgb));
            assert!(rgb.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-5), "{rgb:?} {back:?}");
        }
        // white: L* = 100, no chroma
        let [l, a, b] = hunt_lab_from_linear([1.0; 3]);
        assert!((l - 100.0).abs() < 1e-2 && a.abs() < 1e-2 && b.abs() < 1e-2, "{l} {a} {b}");
    }
}
