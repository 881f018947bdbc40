//! Formats of 8 bits that the image crate encodes as they are promised. Those without alpha have what covers a pixel in
//! part on black.

use super::encoding::Encoding;
use crate::film::Film;
use image::codecs::{bmp, jpeg, qoi, tga, webp};
use image::{ExtendedColorType, ImageEncoder, ImageResult};
use std::borrow::Cow;
use std::io::Cursor;

/// JPEG without alpha; colour as fine as brightness (4:4:4).
pub(super) fn encode_jpeg(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let rows = film.codes(false, encoding.exposure_stops);
    written(|out| {
        let encoder = jpeg::JpegEncoder::new_with_quality(out, encoding.quality);
        encoder.write_image(&rows, film.size[0], film.size[1], ExtendedColorType::Rgb8)
    })
}

/// BMP without alpha, which few readers of it expect.
pub(super) fn encode_bmp(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let rows = film.codes(false, encoding.exposure_stops);
    written(|out| {
        let encoder = bmp::BmpEncoder::new(out);
        encoder.write_image(&rows, film.size[0], film.size[1], ExtendedColorType::Rgb8)
    })
}

/// TGA, straight alpha. Not run-length coded: the encoder lets runs go on into the next row, which TGA 2.0 forbids and
/// readers take badly.
pub(super) fn encode_tga(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let (rows, color) = eight_bits(film, encoding);
    written(|out| {
        tga::TgaEncoder::new(out).disable_rle().write_image(&rows, film.size[0], film.size[1], color)
    })
}

/// WebP, lossless, straight alpha.
pub(super) fn encode_webp(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let (rows, color) = eight_bits(film, encoding);
    written(|out| webp::WebPEncoder::new_lossless(out).write_image(&rows, film.size[0], film.size[1], color))
}

/// QOI, straight alpha.
pub(super) fn encode_qoi(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let (rows, color) = eight_bits(film, encoding);
    written(|out| qoi::QoiEncoder::new(out).write_image(&rows, film.size[0], film.size[1], color))
}

/// RGB or, where the film has alpha, RGBA with straight colour.
fn eight_bits(film: &Film, encoding: Encoding) -> (Cow<'_, [u8]>, ExtendedColorType) {
    let color = if film.alpha.is_some() { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
    (film.codes(true, encoding.exposure_stops), color)
}

fn written(write: impl FnOnce(&mut Cursor<Vec<u8>>) -> ImageResult<()>) -> Result<Vec<u8>, String> {
    let mut out = Cursor::new(Vec::new());
    write(&mut out).map_err(|e| e.to_string())?;
    Ok(out.into_inner())
}
