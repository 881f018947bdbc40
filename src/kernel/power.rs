//! Powers of floats, the same bits on every machine: the platform's `powf` is not.

use std::f64::consts::{LN_2, LOG2_E};

/// The bits of √½, the least significand that [`powf`] takes; the greatest is just below √2.
const SQRT_HALF_BITS: u64 = 0x3fe6_a09e_667f_3bcd;
/// Adding and subtracting 1.5·2⁵² rounds a float below 2⁵¹ to the nearest integer.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// x^y for x ≥ 0 and finite y ≥ 0; x^0 is 1, also for 0. Within 0.51 ULP: 2^(y·log2 x) by polynomials in f64.
pub fn powf(x: f32, y: f32) -> f32 {
    if y == 0.0 || x == 1.0 {
        return 1.0;
    }
    if x <= 0.0 {
        return 0.0;
    }
    let exponent = f64::from(y) * log2(f64::from(x));
    if exponent < -150.0 {
        // below half of the least f32
        0.0
    } else if exponent >= 128.0 {
        f32::INFINITY
    } else {
        exp2(exponent) as f32
    }
}

/// log2 of a positive normal float, by x = 2^e·m and the series of artanh((m − 1)/(m + 1)).
pub fn log2(x: f64) -> f64 {
    let e = x.to_bits().wrapping_sub(SQRT_HALF_BITS) as i64 >> 52;
    let m = f64::from_bits(x.to_bits().wrapping_sub((e as u64) << 52));
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let series = (1.0 + q * (1.0 / 3.0))
        + (q * q)
            * ((1.0 / 5.0 + q * (1.0 / 7.0)) + (q * q) * (1.0 / 9.0 + q * (1.0 / 11.0 + q * (1.0 / 13.0))));
    e as f64 + 2.0 * LOG2_E * s * series
}

/// 2^x for |x| < 1000, by the series of e^f with f in ±½·ln 2.
fn exp2(x: f64) -> f64 {
    let k = (x + ROUND) - ROUND;
    let f = (x - k) * LN_2;
    let q = f * f;
    let series = (1.0 + f)
        + q * ((1.0 / 2.0 + f * (1.0 / 6.0))
            + q * ((1.0 / 24.0 + f * (1.0 / 120.0))
                + q * (1.0 / 720.0 + f * (1.0 / 5040.0) + q * (1.0 / 40320.0))));
    series * f64::from_bits(((1023 + k as i64) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::powf;

    #[test]
    fn edges() {
        assert_eq!(powf(0.0, 0.0), 1.0);
        assert_eq!(powf(0.0, 20.0), 0.0);
        assert_eq!(powf(0.3, 0.0), 1.0);
        assert_eq!(powf(0.3, 1.0), 0.3);
        assert_eq!(powf(0.5, 149.0), f32::from_bits(1));
        assert_eq!(powf(0.5, 160.0), 0.0);
        assert_eq!(powf(2.0, 127.0), 2f32.powi(127));
        assert_eq!(powf(2.0, 128.0), f32::INFINITY);
        assert_eq!(powf(f32::from_bits(1), 0.5), 2f32.powf(-74.5));
    }

    #[test]
    fn within_a_little_more_than_half_an_ulp_of_f64() {
        for i in 1..2000 {
            for y in [0.4166, 1.0, 2.4, 10.0, 37.5, 250.0, 1000.0] {
                let x = i as f32 / 1000.0;
                let exact = f64::from(x).powf(f64::from(y));
                if !(1.2e-38..3e38).contains(&exact) {
                    continue;
                }
                let got = powf(x, y);
                let ulp = f64::from(f32::from_bits(got.to_bits() + 1)) - f64::from(got);
                assert!((f64::from(got) - exact).abs() <= 0.51 * ulp, "{x}^{y}: {got}, not {exact}");
            }
        }
    }
}
