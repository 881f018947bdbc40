//! PPM (P6), PGM (P5) and PBM (P4), binary; 16 bits with the high byte first. They have no alpha: what covers a pixel
//! in part stands on black.

use super::encoding::{Bits, Encoding};
use super::png::big_endian;
use crate::film::Film;
use crate::film::quantize::{luma8, luma16, quantize16};

/// Colour.
pub(super) fn encode_ppm(film: &Film, encoding: Encoding) -> Vec<u8> {
    let stops = encoding.exposure_stops;
    let (max, rows) = match encoding.bits {
        Bits::Eight => (255, film.codes(false, stops).into_owned()),
        Bits::Sixteen => (65535, big_endian(&quantize16(&film.rgb, None, stops))),
    };
    with_header(&format!("P6\n{} {}\n{max}\n", film.size[0], film.size[1]), rows)
}

/// Rec. 709 luma of linear light, then the curve.
pub(super) fn encode_pgm(film: &Film, encoding: Encoding) -> Vec<u8> {
    let stops = encoding.exposure_stops;
    let (max, rows) = match encoding.bits {
        Bits::Eight => (255, luma8(&film.rgb, stops)),
        Bits::Sixteen => (65535, big_endian(&luma16(&film.rgb, stops))),
    };
    with_header(&format!("P5\n{} {}\n{max}\n", film.size[0], film.size[1]), rows)
}

/// The luma on the curve, cut at one half; 1 is black, rows begin at a byte, the leftmost pixel is the highest bit.
pub(super) fn encode_pbm(film: &Film, encoding: Encoding) -> Vec<u8> {
    let codes = luma8(&film.rgb, encoding.exposure_stops);
    let [width, height] = film.size;
    let rows = codes.chunks(width as usize).flat_map(|row| {
        row.chunks(8).map(|eight| {
            let bit = |(i, code): (usize, &u8)| u8::from(*code < 128) << (7 - i);
            eight.iter().enumerate().map(bit).sum::<u8>()
        })
    });
    with_header(&format!("P4\n{width} {height}\n"), rows.collect())
}

fn with_header(header: &str, rows: Vec<u8>) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(rows);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Format;
    use crate::scene::AovSet;

    #[test]
    fn luma_and_its_half() {
        let mut film = Film::new([9, 1], false, AovSet::default());
        // green alone: luma 0.7152 → 0.8637 on the curve → 220; blue: 0.0722 → 0.2979 → 76
        film.rgb[0] = [0.0, 1.0, 0.0];
        film.rgb[1] = [0.0, 0.0, 1.0];
        film.rgb[8] = [1.0; 3];
        let encoding = |format| Encoding { format, bits: Bits::Eight, exposure_stops: 0.0, quality: 92 };
        let pgm = encode_pgm(&film, encoding(Format::Pgm));
        assert_eq!(pgm, b"P5\n9 1\n255\n\xdc\x4c\0\0\0\0\0\0\xff");
        let pbm = encode_pbm(&film, encoding(Format::Pbm));
        assert_eq!(pbm, b"P4\n9 1\n\x7f\x00");
    }
}
