//! Sun raster: a header of eight big-endian words, then rows of blue, green, red, each padded to 16 bits.

use super::encoding::Encoding;
use crate::film::Film;

const MAGIC: u32 = 0x59a6_6a95;
/// Uncompressed, blue first.
const STANDARD: u32 = 1;

/// 24 bits a pixel, no alpha, no colour map.
pub(super) fn encode(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let [width, height] = film.size;
    let row_bytes = (3 * u64::from(width)).next_multiple_of(2);
    let bytes = row_bytes * u64::from(height);
    let length = u32::try_from(bytes).map_err(|_| "the format holds 4 GiB at most".to_string())?;
    let mut out = Vec::with_capacity(32 + bytes as usize);
    for word in [MAGIC, width, height, 24, length, STANDARD, 0, 0] {
        out.extend(word.to_be_bytes());
    }
    for row in film.codes(false, encoding.exposure_stops).chunks(3 * width as usize) {
        for rgb in row.chunks(3) {
            out.extend(rgb.iter().rev());
        }
        out.resize(out.len() + row_bytes as usize - row.len(), 0);
    }
    Ok(out)
}

/// Whether bytes begin as a Sun raster does.
pub(super) fn is_sun(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC.to_be_bytes())
}

/// Width, height and codes (red, green, blue, rows from the top) of what is written above; others write more kinds.
pub(super) fn decode(bytes: &[u8], side_max: u32) -> Result<([u32; 2], Vec<u8>), String> {
    let cut = || "it is cut off".to_string();
    let (head, rest) = bytes.split_at_checked(32).ok_or_else(cut)?;
    let words: Vec<u32> = head.as_chunks().0.iter().map(|word| u32::from_be_bytes(*word)).collect();
    let [_, width, height, depth, _, kind, _, map_bytes] = words[..] else { return Err(cut()) };
    if !(1..=side_max).contains(&width) || !(1..=side_max).contains(&height) {
        return Err(format!("{width}x{height} pixels are none, or more than {side_max} a side"));
    }
    // of old, the same without a length
    if depth != 24 || kind > STANDARD {
        return Err(format!(
            "of Sun rasters those of 24 bits are read that are not compressed, not kind {kind} of {depth}"
        ));
    }
    let pixels = rest.get(map_bytes as usize..).ok_or_else(cut)?;
    let row_bytes = (3 * width as usize).next_multiple_of(2);
    let mut codes = Vec::new();
    for row in pixels.get(..row_bytes * height as usize).ok_or_else(cut)?.chunks(row_bytes) {
        codes.extend(row.chunks_exact(3).flat_map(|bgr| bgr.iter().rev()));
    }
    Ok(([width, height], codes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::{Bits, Format};
    use crate::scene::AovSet;

    #[test]
    fn rows_are_blue_first_and_even() {
        let mut film = Film::new([1, 2], false, AovSet::default());
        film.rgb = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].into();
        let encoding = Encoding { format: Format::Sun, bits: Bits::Eight, exposure_stops: 0.0, quality: 92 };
        let bytes = encode(&film, encoding).unwrap();
        assert_eq!(bytes[..8], [0x59, 0xa6, 0x6a, 0x95, 0, 0, 0, 1]);
        assert_eq!(bytes[12..24], [0, 0, 0, 24, 0, 0, 0, 8, 0, 0, 0, 1]);
        assert_eq!(bytes[32..], [0, 0, 255, 0, 0, 255, 0, 0]);
    }

    #[test]
    fn what_is_written_is_read() {
        let mut film = Film::new([3, 2], false, AovSet::default());
        film.rgb =
            (0..6).map(|i| [1.0, f32::from(i as u8 % 2), f32::from(i as u8 / 3)]).collect::<Vec<_>>().into();
        let encoding = Encoding { format: Format::Sun, bits: Bits::Eight, exposure_stops: 0.0, quality: 92 };
        let bytes = encode(&film, encoding).unwrap();
        assert!(is_sun(&bytes));
        assert_eq!(decode(&bytes, 3), Ok(([3, 2], film.codes(false, 0.0).to_vec())));
        for cut in 0..bytes.len() {
            assert!(decode(&bytes[..cut], 3).unwrap_err().contains("cut off"), "{cut}");
        }
        assert!(decode(&bytes, 2).unwrap_err().contains("more than 2 a side"));
        for (at, refused) in [(15, "of 8"), (23, "kind 8")] {
            let mut other = bytes.clone();
            other[at] = 8;
            assert!(decode(&other, 3).unwrap_err().contains(refused));
        }
        let mut none = bytes;
        none[4..8].fill(0);
        assert!(decode(&none, 3).unwrap_err().contains("0x2 pixels are none"));
    }
}
