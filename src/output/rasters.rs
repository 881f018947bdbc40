//! Formats that the image crate encodes.

use super::encoding::{Bits, Encoding};
use crate::film::Film;
use crate::film::quantize::{quantize8, quantize16};
use image::codecs::{bmp, hdr, jpeg, qoi, tga, tiff, webp};
use image::{ExtendedColorType, ImageEncoder, ImageResult};
use std::io::Cursor;

/// JPEG without alpha: what covers a pixel in part stands on black.
pub(super) fn encode_jpeg(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let rows = quantize8(&film.rgb, None, encoding.exposure_stops);
    written(|out| {
        let encoder = jpeg::JpegEncoder::new_with_quality(out, encoding.quality);
        encoder.write_image(&rows, film.size[0], film.size[1], ExtendedColorType::Rgb8)
    })
}

/// BMP without alpha.
pub(super) fn encode_bmp(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let rows = quantize8(&film.rgb, None, encoding.exposure_stops);
    written(|out| {
        let encoder = bmp::BmpEncoder::new(out);
        encoder.write_image(&rows, film.size[0], film.size[1], ExtendedColorType::Rgb8)
    })
}

/// TGA.
pub(super) fn encode_tga(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let (rows, color) = eight_bits(film, encoding);
    written(|out| {
        tga::TgaEncoder::new(out).disable_rle().write_image(&rows, film.size[0], film.size[1], color)
    })
}

/// WebP, lossless.
pub(super) fn encode_webp(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let (rows, color) = eight_bits(film, encoding);
    written(|out| webp::WebPEncoder::new_lossless(out).write_image(&rows, film.size[0], film.size[1], color))
}

/// QOI.
pub(super) fn encode_qoi(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let (rows, color) = eight_bits(film, encoding);
    written(|out| qoi::QoiEncoder::new(out).write_image(&rows, film.size[0], film.size[1], color))
}

/// TIFF, uncompressed.
pub(super) fn encode_tiff(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let (rows, color) = match encoding.bits {
        Bits::Eight => eight_bits(film, encoding),
        Bits::Sixteen => {
            let samples = quantize16(&film.rgb, film.alpha.as_deref(), encoding.exposure_stops);
            let color =
                if film.alpha.is_some() { ExtendedColorType::Rgba16 } else { ExtendedColorType::Rgb16 };
            (samples.iter().flat_map(|s| s.to_ne_bytes()).collect(), color)
        }
    };
    written(|out| tiff::TiffEncoder::new(out).write_image(&rows, film.size[0], film.size[1], color))
}

/// Radiance HDR: linear light as it is, without alpha.
pub(super) fn encode_hdr(film: &Film) -> Result<Vec<u8>, String> {
    let pixels: Vec<image::Rgb<f32>> = film.rgb.iter().map(|&c| image::Rgb(c)).collect();
    written(|out| hdr::HdrEncoder::new(out).encode(&pixels, film.size[0] as usize, film.size[1] as usize))
}

/// RGB or, where the film has alpha, RGBA with straight colour.
fn eight_bits(film: &Film, encoding: Encoding) -> (Vec<u8>, ExtendedColorType) {
    let color = if film.alpha.is_some() { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
    (quantize8(&film.rgb, film.alpha.as_deref(), encoding.exposure_stops), color)
}

fn written(write: impl FnOnce(&mut Cursor<Vec<u8>>) -> ImageResult<()>) -> Result<Vec<u8>, String> {
    let mut out = Cursor::new(Vec::new());
    write(&mut out).map_err(|e| e.to_string())?;
    Ok(out.into_inner())
}
