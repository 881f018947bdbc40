//! TIFF: uncompressed, in one image, straight alpha said to be so.

use super::encoding::{Bits, Encoding};
use crate::film::Film;
use crate::film::quantize::quantize16;
use std::io::Cursor;
use tiff::TiffResult;
use tiff::encoder::colortype::{ColorType, RGB8, RGB16};
use tiff::encoder::{TiffEncoder, TiffValue};
use tiff::tags::ExtraSamples;

/// RGB, with straight alpha where the film has it, 8 or 16 bits a channel.
pub(super) fn encode(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let (alpha, stops) = (film.alpha.as_deref(), encoding.exposure_stops);
    match encoding.bits {
        Bits::Eight => write::<RGB8>(film, &film.codes(true, stops)),
        Bits::Sixteen => write::<RGB16>(film, &quantize16(&film.rgb, alpha, stops)),
    }
    .map_err(|e| e.to_string())
}

fn write<C: ColorType>(film: &Film, samples: &[C::Inner]) -> TiffResult<Vec<u8>>
where
    [C::Inner]: TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes)?;
    let mut image = encoder.new_image::<C>(film.size[0], film.size[1])?;
    if film.alpha.is_some() {
        // without this tag readers are free to take the fourth channel for anything
        image.extra_samples(&[ExtraSamples::UnassociatedAlpha])?;
    }
    image.write_data(samples)?;
    Ok(bytes.into_inner())
}
