//! A film as integers: exposure, clamp, sRGB curve, round to nearest; alpha straight.

use super::Film;
use super::color::{Srgb8, gain_from_stops, quantize8, quantize16, srgb16};

impl Film {
    /// Interleaved 8-bit rows from the top: RGB, or RGBA where the film has alpha; colour on the sRGB curve, not
    /// premultiplied.
    pub fn quantized8(&self, exposure_stops: f32) -> Vec<u8> {
        let curve = Srgb8::table();
        self.interleaved(exposure_stops, |x| curve.code(x), quantize8)
    }

    /// The same with 16 bits.
    pub fn quantized16(&self, exposure_stops: f32) -> Vec<u16> {
        self.interleaved(exposure_stops, srgb16, quantize16)
    }

    fn interleaved<T>(&self, stops: f32, color: impl Fn(f32) -> T, alpha: impl Fn(f32) -> T) -> Vec<T> {
        let gain = gain_from_stops(stops);
        match &self.alpha {
            None => self.rgb.as_flattened().iter().map(|&x| color(x * gain)).collect(),
            Some(coverage) => self
                .rgb
                .iter()
                .zip(coverage)
                .flat_map(|(&rgb, &a)| {
                    let [r, g, b] = straight(rgb, a).map(|x| color(x * gain));
                    [r, g, b, alpha(a)]
                })
                .collect(),
        }
    }
}

/// Premultiplied colour without its alpha; black where there is none.
fn straight(rgb: [f32; 3], alpha: f32) -> [f32; 3] {
    if alpha > 0.0 { rgb.map(|x| x / alpha) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::AovSet;

    #[test]
    fn exposure_comes_before_clamp_and_curve() {
        let mut film = Film::new([2, 1], false, AovSet::default());
        film.rgb = vec![[0.25, 2.0, -1.0], [0.0, f32::NAN, 0.125]];
        // one stop: 0.5 → 188 and 0.25 → 1.055 · 0.25^(1/2.4) − 0.055 = 0.537099, · 255 = 136.96
        assert_eq!(film.quantized8(1.0), [188, 255, 0, 0, 0, 137]);
        assert_eq!(film.quantized8(-1.0)[1], 255);
        assert_eq!(film.quantized16(1.0)[..3], [48192, 65535, 0]);
    }

    #[test]
    fn alpha_is_straight() {
        let mut film = Film::new([2, 1], true, AovSet::default());
        film.rgb = vec![[0.25, 0.125, 0.0], [0.5, 0.5, 0.5]];
        film.alpha = Some(vec![0.5, 0.0]);
        // 0.25 / 0.5 = 0.5 → 188; 0.5 · 255 = 127.5 → 128; nothing is there where alpha is 0
        assert_eq!(film.quantized8(0.0), [188, 137, 0, 128, 0, 0, 0, 0]);
        assert_eq!(film.quantized16(0.0)[..4], [48192, 35199, 0, 32768]);
    }
}
