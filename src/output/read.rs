//! Pictures read back from files, to be compared: all formats that are written but JPEG 2000, known by their first bytes.

use super::encoding::Format;
use super::error::OutputError;
use super::sun;
use crate::film::compare::{Channel, Picture, Samples};
use crate::format::open_plain;
use exr::meta::header::Header;
use exr::prelude::{FlatSamples, MetaData, ReadChannels, ReadLayers, read};
use image::{DynamicImage, ImageFormat, ImageReader, Limits};
use std::io::{Cursor, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Greatest width and height of a picture that is read.
const SIDE_MAX: u32 = 1 << 16;
/// Most bytes of a picture's file, and of its decoded samples.
const PICTURE_BYTES_MAX: u64 = 4 << 30;

const RGBA: [&str; 4] = ["R", "G", "B", "A"];
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Reads a picture. A broken file is an error, also where a decoder panics on it.
pub fn read_picture(path: &Path) -> Result<Picture, OutputError> {
    decode(&read_bytes(path)?, path)
}

/// The picture that a file's bytes are.
pub(super) fn decode(bytes: &[u8], path: &Path) -> Result<Picture, OutputError> {
    let decode = || {
        if bytes.starts_with(&EXR_MAGIC) {
            decode_exr(bytes)
        } else if sun::is_sun(bytes) {
            decode_sun(bytes)
        } else {
            decode_image(bytes, path)
        }
    };
    catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err("the decoder failed on it".into()))
        .map_err(|why| OutputError::Decode { path: path.to_path_buf(), why })
}

pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, OutputError> {
    let Some((file, _)) = open_plain(path).map_err(OutputError::read(path))? else {
        return Err(OutputError::Decode { path: path.to_path_buf(), why: "it is no plain file".into() });
    };
    let mut bytes = Vec::new();
    file.take(PICTURE_BYTES_MAX + 1).read_to_end(&mut bytes).map_err(OutputError::read(path))?;
    if bytes.len() as u64 > PICTURE_BYTES_MAX {
        let why = format!("it holds more than {PICTURE_BYTES_MAX} bytes");
        return Err(OutputError::Decode { path: path.to_path_buf(), why });
    }
    Ok(bytes)
}

fn decode_sun(bytes: &[u8]) -> Result<Picture, String> {
    let (size, codes) = sun::decode(bytes, SIDE_MAX)?;
    let shares: Vec<u16> = codes.iter().map(|&code| 257 * u16::from(code)).collect();
    Ok(Picture { size, channels: channels(&RGBA[..3], &shares, Samples::Share) })
}

fn decode_image(bytes: &[u8], path: &Path) -> Result<Picture, String> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_MAX);
    limits.max_image_height = Some(SIDE_MAX);
    limits.max_alloc = Some(PICTURE_BYTES_MAX);
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    // a TGA has no first bytes of its own
    if reader.format().is_none() && Format::of_file(path) == Some(Format::Tga) {
        reader.set_format(ImageFormat::Tga);
    }
    reader.limits(limits);
    let decoded = reader.decode().map_err(|e| e.to_string())?;
    let size = [decoded.width(), decoded.height()];
    // of 8 bits, v becomes 257 v: the same share of the greatest value
    let channels = match decoded {
        DynamicImage::ImageRgb32F(pixels) => channels(&RGBA[..3], pixels.as_raw(), Samples::Float),
        DynamicImage::ImageRgba32F(pixels) => channels(&RGBA, pixels.as_raw(), Samples::Float),
        _ if decoded.color().has_alpha() => channels(&RGBA, decoded.into_rgba16().as_raw(), Samples::Share),
        _ => channels(&RGBA[..3], decoded.into_rgb16().as_raw(), Samples::Share),
    };
    Ok(Picture { size, channels })
}

fn channels<T: Copy>(names: &[&str], interleaved: &[T], samples: fn(Vec<T>) -> Samples) -> Vec<Channel> {
    let channel = |(i, name): (usize, &&str)| {
        let values = interleaved.iter().skip(i).step_by(names.len()).copied();
        Channel { name: (*name).to_string(), samples: samples(values.collect()) }
    };
    names.iter().enumerate().map(channel).collect()
}

fn decode_exr(bytes: &[u8]) -> Result<Picture, String> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| e.to_string())?;
    let samples = |h: &Header| {
        (h.layer_size.0 as u64)
            .saturating_mul(h.layer_size.1 as u64)
            .saturating_mul(h.channels.list.len() as u64)
    };
    let decoded_bytes = meta.headers.iter().map(samples).fold(0, u64::saturating_add).saturating_mul(4);
    if decoded_bytes > PICTURE_BYTES_MAX {
        return Err(format!("its samples would take {decoded_bytes} bytes, {PICTURE_BYTES_MAX} are allowed"));
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    let size = image.layer_data.size;
    let channels: Vec<Channel> = image
        .layer_data
        .channel_data
        .list
        .into_iter()
        .map(|c| Channel {
            name: c.name.to_string(),
            samples: match c.sample_data {
                FlatSamples::F16(values) => Samples::Float(values.iter().map(|v| v.to_f32()).collect()),
                FlatSamples::F32(values) => Samples::Float(values),
                FlatSamples::U32(values) => Samples::Id(values),
            },
        })
        .collect();
    if let Some(coarse) = channels.iter().find(|c| c.samples.len() != size.area()) {
        return Err(format!("its channel {} has not one value a pixel", coarse.name));
    }
    Ok(Picture { size: [size.0 as u32, size.1 as u32], channels })
}
