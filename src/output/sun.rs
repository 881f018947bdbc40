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
}
