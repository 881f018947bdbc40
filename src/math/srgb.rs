//! The sRGB curve (IEC 61966-2-1), the same bits on every machine.

use std::sync::LazyLock;

/// The sRGB curve: linear light in [0, 1] to a value in [0, 1].
pub fn srgb_from_linear(x: f64) -> f64 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 }
}

/// The inverse of the sRGB curve.
pub fn linear_from_srgb(s: f64) -> f64 {
    if s <= 0.040_45 { s / 12.92 } else { libm::pow((s + 0.055) / 1.055, 2.4) }
}

/// Linear light of each 8-bit code on the sRGB curve.
pub static LINEAR_FROM_SRGB8: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| linear_from_srgb(code as f64 / 255.0) as f32));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_on_paper() {
        // 12.92 · 0.003 = 0.03876; 1.055 · 0.5^(1/2.4) − 0.055 = 1.055 · 0.749154 − 0.055 = 0.735357
        assert!((srgb_from_linear(0.003) - 0.038_76).abs() < 1e-12);
        assert!((srgb_from_linear(0.5) - 0.735_357).abs() < 1e-6);
        assert_eq!(srgb_from_linear(0.0), 0.0);
        assert!((srgb_from_linear(1.0) - 1.0).abs() < 1e-15);
        // ((128/255 + 0.055)/1.055)^2.4
        assert!((LINEAR_FROM_SRGB8[128] - 0.215_860_5).abs() < 1e-6);
        for i in 0..=1000 {
            let x = f64::from(i) / 1000.0;
            assert!((linear_from_srgb(srgb_from_linear(x)) - x).abs() < 1e-7, "{x}");
        }
    }
}
