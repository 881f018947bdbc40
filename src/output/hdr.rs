//! Radiance HDR: linear light with one exponent a pixel (Ward, "Real Pixels", Graphics Gems II), run-length coded, no
//! alpha: what covers a pixel in part stands on black. Ours, because the image crate writes its name into the file and
//! turns what is too small for the exponent into what is very bright.

use super::encoding::Encoding;
use crate::film::Film;

/// Widths whose rows are run-length coded; others stand pixel by pixel.
const CODED_WIDTHS: std::ops::Range<u32> = 8..32768;
/// Shorter runs are not worth their two bytes.
const RUN_MIN: usize = 4;
const RUN_MAX: usize = 127;
const LITERALS_MAX: usize = 128;

/// The header and the rows from the top; exposure is left to who shows it.
#[expect(clippy::unnecessary_wraps, reason = "the signature of every encoder")]
pub(super) fn encode(film: &Film, _: Encoding) -> Result<Vec<u8>, String> {
    let [width, height] = film.size;
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for row in film.rgb.chunks(width as usize) {
        let pixels: Vec<[u8; 4]> = row.iter().map(|&rgb| rgbe(rgb)).collect();
        if CODED_WIDTHS.contains(&width) {
            let [high, low] = (width as u16).to_be_bytes();
            bytes.extend([2, 2, high, low]);
            for k in 0..4 {
                let plane: Vec<u8> = pixels.iter().map(|pixel| pixel[k]).collect();
                code_runs(&plane, &mut bytes);
            }
        } else {
            bytes.extend(pixels.as_flattened());
        }
    }
    Ok(bytes)
}

/// Mantissas m and exponent e, so that a channel is m / 256 · 2^(e − 128), rounded down. What is negative or not a
/// number is 0, what is too large the greatest there is.
#[expect(clippy::manual_clamp, reason = "`clamp` keeps what is not a number")]
fn rgbe(rgb: [f32; 3]) -> [u8; 4] {
    /// 255 / 256 · 2^127
    const GREATEST: f32 = 1.694_817_3e38;
    let [r, g, b] = rgb.map(|x| x.max(0.0).min(GREATEST));
    let (_, exponent) = libm::frexpf(r.max(g).max(b));
    let biased = exponent + 128;
    if r.max(g).max(b) == 0.0 || biased < 1 {
        return [0; 4];
    }
    let mantissa = |x: f32| libm::ldexp(f64::from(x), 8 - exponent) as u8;
    [mantissa(r), mantissa(g), mantissa(b), biased as u8]
}

/// One channel of a row: 128 + n and a value for n equal ones, n and n values for others.
fn code_runs(values: &[u8], out: &mut Vec<u8>) {
    let mut literals = 0..0;
    for run in values.chunk_by(|a, b| a == b) {
        if run.len() < RUN_MIN {
            literals.end += run.len();
            continue;
        }
        code_literals(&values[literals.clone()], out);
        for part in run.chunks(RUN_MAX) {
            out.extend([128 + part.len() as u8, run[0]]);
        }
        let end = literals.end + run.len();
        literals = end..end;
    }
    code_literals(&values[literals], out);
}

fn code_literals(values: &[u8], out: &mut Vec<u8>) {
    for part in values.chunks(LITERALS_MAX) {
        out.push(part.len() as u8);
        out.extend(part);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_on_paper() {
        // 1 = 128/256 · 2^1; 0.5 = 64/256 · 2^1; 0.003 · 128 = 0.384 → 0
        assert_eq!(rgbe([1.0, 0.5, 0.003]), [128, 64, 0, 129]);
        // 1000 = 0.9765625 · 2^10: 0.9765625 · 256 = 250
        assert_eq!(rgbe([1000.0, 0.0, 500.0]), [250, 0, 125, 138]);
        assert_eq!(rgbe([0.0; 3]), [0; 4]);
        assert_eq!(rgbe([-1.0, f32::NAN, 1.0]), [0, 0, 128, 129]);
        assert_eq!(rgbe([f32::INFINITY, f32::MAX, 0.0]), [255, 255, 0, 255]);
        // 2^-128 = 0.5 · 2^-127 has the least exponent, what is below none
        assert_eq!(rgbe([libm::exp2f(-128.0), 0.0, 0.0]), [128, 0, 0, 1]);
        assert_eq!(rgbe([libm::exp2f(-129.0), 0.0, 0.0]), [0; 4]);
        assert_eq!(rgbe([1e-40; 3]), [0; 4]);
    }

    #[test]
    fn runs_on_paper() {
        let coded = |values: &[u8]| {
            let mut out = Vec::new();
            code_runs(values, &mut out);
            out
        };
        assert_eq!(coded(&[7; 8]), [136, 7]);
        // three equal ones are literals like their neighbours
        assert_eq!(coded(&[1, 2, 2, 2, 3, 3, 3, 3, 4]), [4, 1, 2, 2, 2, 132, 3, 1, 4]);
        assert_eq!(coded(&[9; 130]), [255, 9, 131, 9]);
        let different: Vec<u8> = (0..=129).collect();
        let out = coded(&different);
        assert_eq!((out.len(), out[0], out[129], &out[130..]), (132, 128, 2, &[128, 129][..]));
    }
}
