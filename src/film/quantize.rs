//! Linear pixels as integers: exposure, clamp, sRGB curve, round to nearest; with alpha, colour is straight.

use super::color::{Srgb8, gain_from_stops, luma, srgb16, unit, unorm8, unorm16};

/// Interleaved RGB of 8 bits on the sRGB curve; RGBA with colour no longer premultiplied where alpha is given, one
/// value a pixel.
pub fn quantize8(rgb: &[[f32; 3]], alpha: Option<&[f32]>, exposure_stops: f32) -> Vec<u8> {
    let curve = Srgb8::table();
    interleave(rgb, alpha, exposure_stops, |x| curve.code(x), unorm8)
}

/// [`quantize8`] with 16 bits.
pub fn quantize16(rgb: &[[f32; 3]], alpha: Option<&[f32]>, exposure_stops: f32) -> Vec<u16> {
    interleave(rgb, alpha, exposure_stops, srgb16, unorm16)
}

/// Luma (Rec. 709) of what a colour picture shows, linear RGB after exposure and clamp, as 8 bits on the sRGB curve.
pub fn luma8(rgb: &[[f32; 3]], exposure_stops: f32) -> Vec<u8> {
    let curve = Srgb8::table();
    shown_luma(rgb, exposure_stops).map(|y| curve.code(y)).collect()
}

/// [`luma8`] with 16 bits.
pub fn luma16(rgb: &[[f32; 3]], exposure_stops: f32) -> Vec<u16> {
    shown_luma(rgb, exposure_stops).map(srgb16).collect()
}

fn shown_luma(rgb: &[[f32; 3]], exposure_stops: f32) -> impl Iterator<Item = f32> {
    let gain = gain_from_stops(exposure_stops);
    rgb.iter().map(move |rgb| luma(rgb.map(|x| unit(x * gain))))
}

fn interleave<T>(
    rgb: &[[f32; 3]],
    alpha: Option<&[f32]>,
    exposure_stops: f32,
    color: impl Fn(f32) -> T,
    share: impl Fn(f32) -> T,
) -> Vec<T> {
    let gain = gain_from_stops(exposure_stops);
    let Some(alpha) = alpha else {
        return rgb.as_flattened().iter().map(|&x| color(x * gain)).collect();
    };
    let pixel = |(&rgb, &a): (&[f32; 3], &f32)| {
        let [r, g, b] = straight(rgb, a).map(|x| color(x * gain));
        [r, g, b, share(a)]
    };
    rgb.iter().zip(alpha).map(pixel).collect::<Vec<[T; 4]>>().into_flattened()
}

/// Premultiplied colour without its alpha; black where there is none.
fn straight(rgb: [f32; 3], alpha: f32) -> [f32; 3] {
    if alpha > 0.0 { rgb.map(|x| x / alpha) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_comes_before_clamp_and_curve() {
        let rgb = [[0.25, 2.0, -1.0], [0.0, f32::NAN, 0.125]];
        // one stop: 0.5 → 188 and 0.25 → 1.055 · 0.25^(1/2.4) − 0.055 = 0.537099, · 255 = 136.96
        assert_eq!(quantize8(&rgb, None, 1.0), [188, 255, 0, 0, 0, 137]);
        assert_eq!(quantize8(&rgb, None, -1.0)[1], 255);
        assert_eq!(quantize16(&rgb, None, 1.0)[..3], [48192, 65535, 0]);
    }

    #[test]
    fn alpha_is_straight() {
        let (rgb, alpha) = ([[0.25, 0.125, 0.0], [0.5, 0.5, 0.5]], [0.5, 0.0]);
        // 0.25 / 0.5 = 0.5 → 188; 0.5 · 255 = 127.5 → 128; nothing is there where alpha is 0
        assert_eq!(quantize8(&rgb, Some(&alpha), 0.0), [188, 137, 0, 128, 0, 0, 0, 0]);
        assert_eq!(quantize16(&rgb, Some(&alpha), 0.0)[..4], [48192, 35199, 0, 32768]);
    }

    #[test]
    fn luma_is_that_of_what_is_shown() {
        // one stop: 0.7152 · 0.5 · 2 → 1.055 · 0.7152^(1/2.4) − 0.055 = 0.862481, · 255 = 219.93; green is clamped
        let rgb = [[0.0, 0.5, 0.0], [f32::NAN, 9.0, -1.0], [1.0; 3]];
        assert_eq!(luma8(&rgb, 1.0), [220, 220, 255]);
        // 1.055 · 0.0722^(1/2.4) − 0.055 = 0.297893, · 65535 = 19522.41
        assert_eq!(luma16(&[[0.0, 0.0, 1.0]], 0.0), [19522]);
    }
}
