//! PPM, binary (P6), 8 or 16 bits a channel, the latter with the high byte first. It has no alpha: what
//! covers a pixel in part stands on black.

use super::encoding::{Bits, Encoding};
use super::png::big_endian;
use crate::film::Film;
use crate::film::quantize::{quantize8, quantize16};

/// The header and the rows from the top.
pub(super) fn encode(film: &Film, encoding: Encoding) -> Vec<u8> {
    let [width, height] = film.size;
    let stops = encoding.exposure_stops;
    let (max, rows) = match encoding.bits {
        Bits::Eight => (255, quantize8(&film.rgb, None, stops)),
        Bits::Sixteen => (65535, big_endian(&quantize16(&film.rgb, None, stops))),
    };
    let mut bytes = format!("P6\n{width} {height}\n{max}\n").into_bytes();
    bytes.extend(rows);
    bytes
}
