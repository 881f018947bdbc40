//! Picture files to texels of one level. Sizes are looked at before anything is decoded.

use exr::meta::header::Header;
use exr::prelude::{AnyChannel, FlatSamples, MetaData, ReadChannels, ReadLayers, read};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// The greatest width and height of a texture.
pub(super) const MAX_SIDE: u32 = 16_384;
/// The most bytes that its first level may take: 16,384 x 16,384 texels of four bytes.
pub(super) const MAX_BYTES: u64 = 1 << 30;
/// So many bytes its first level may take whatever its file's size.
const FREE_BYTES: u64 = 64 << 20;
/// Beyond those, the most bytes a byte of the file may become. Deflate gives 1,032 at most, and four for three where
/// alpha is added.
const MAX_RATIO: u64 = 4096;

const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The largest number of a half, what an infinite texel becomes: sums and products of it stay finite.
const MAX_HALF: f32 = 65_504.0;

/// A picture as its file holds it.
#[derive(Debug, PartialEq)]
pub(super) struct Picture {
    /// Width and height, at least 1.
    pub size: [u32; 2],
    /// Its texels.
    pub texels: Level,
}

/// RGBA texels, row by row from the top.
#[derive(Debug, PartialEq)]
pub(super) enum Level {
    /// Shares of 255.
    U8(Vec<[u8; 4]>),
    /// Shares of 65535.
    U16(Vec<[u16; 4]>),
    /// Finite floats.
    F32(Vec<[f32; 4]>),
}

/// Decodes a picture, known by its first bytes, or by its name where those say nothing. An error is what is wrong, to
/// stand behind the file's name. The memory for its texels is taken from the room first.
pub(super) fn decode(bytes: &[u8], path: &Path, room: &Room) -> Result<Picture, String> {
    if bytes.starts_with(&EXR_MAGIC) { decode_exr(bytes, room) } else { decode_image(bytes, path, room) }
}

/// Memory that pictures decoded at the same time share.
#[derive(Debug)]
pub(in crate::format) struct Room {
    limit_bytes: u64,
    taken_bytes: AtomicU64,
}

impl Room {
    pub(in crate::format) fn new(limit_bytes: u64) -> Self {
        Self { limit_bytes, taken_bytes: AtomicU64::new(0) }
    }

    /// Takes so many bytes.
    pub(super) fn take(&self, bytes: u64) {
        self.taken_bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Bytes that were wanted, where they are more than there are.
    pub(in crate::format) fn exceeded(&self) -> Option<u64> {
        Some(self.taken_bytes.load(Ordering::Relaxed)).filter(|taken| *taken > self.limit_bytes)
    }

    fn take_levels(&self, texels: u64, texel_bytes: u64) -> Result<(), String> {
        // all levels together have a third more
        self.take(texels.saturating_mul(texel_bytes) / 3 * 4);
        self.exceeded().map_or(Ok(()), |_| Err("does not fit".to_owned()))
    }
}

/// Refuses pictures that are too large, or larger than so few bytes of file can mean, before they take memory.
fn check_size(
    width: u64,
    height: u64,
    texel_bytes: u64,
    file_bytes: usize,
    room: &Room,
) -> Result<(), String> {
    if width == 0 || height == 0 {
        return Err(format!("has {width} x {height} texels, none at all"));
    }
    let bytes = width.saturating_mul(height).saturating_mul(texel_bytes);
    if width > MAX_SIDE.into() || height > MAX_SIDE.into() || bytes > MAX_BYTES {
        return Err(format!(
            "has {width} x {height} texels, {bytes} bytes; at most {MAX_SIDE} a side and {MAX_BYTES} bytes are \
             taken, scale it down"
        ));
    }
    if bytes > FREE_BYTES + MAX_RATIO * file_bytes as u64 {
        return Err(format!(
            "is broken: it says {width} x {height} texels, more than its {file_bytes} bytes can hold"
        ));
    }
    room.take_levels(width * height, texel_bytes)
}

fn decode_image(bytes: &[u8], path: &Path, room: &Room) -> Result<Picture, String> {
    let broken = |error: ImageError| match error {
        ImageError::Limits(_) => {
            format!("is too large: at most {MAX_SIDE} texels a side are taken, scale it down")
        }
        error => format!("is broken: {error}"),
    };
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_BYTES);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format(bytes, path)?);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let color = decoder.color_type();
    let sample_bytes = u64::from(color.bytes_per_pixel() / color.channel_count());
    // finer integers are held as floats
    let held_bytes = if sample_bytes == 1 { 4 } else { 16 };
    check_size(width.into(), height.into(), held_bytes, bytes.len(), room)?;
    let image = DynamicImage::from_decoder(decoder).map_err(broken)?;
    let size = [image.width(), image.height()];
    let texels = match sample_bytes {
        1 => Level::U8(in_fours(image.into_rgba8().into_raw())),
        2 => Level::U16(in_fours(image.into_rgba16().into_raw())),
        _ => Level::F32(in_fours(image.into_rgba32f().into_raw().into_iter().map(finite).collect())),
    };
    Ok(Picture { size, texels })
}

/// What a file is. Names are asked only where the first bytes say nothing: TGA has no mark.
fn format(bytes: &[u8], path: &Path) -> Result<ImageFormat, String> {
    let by_name = || ImageFormat::from_path(path).ok().filter(|format| *format == ImageFormat::Tga);
    match image::guess_format(bytes).ok().or_else(by_name) {
        _ if bytes.is_empty() => Err("is empty".to_owned()),
        _ if bytes.starts_with(b"version https://git-lfs") => {
            Err("is a Git LFS pointer, not the picture; fetch it with `git lfs pull`".to_owned())
        }
        // of DDS the crate says that it is not read, but reads it
        Some(format) if format.reading_enabled() || format == ImageFormat::Dds => Ok(format),
        _ => Err(
            "is no picture of a known format (png, jpg, bmp, tga, pnm, tif, gif, webp, hdr, qoi, dds, exr)"
                .to_owned(),
        ),
    }
}

fn in_fours<T: bytemuck::Pod>(samples: Vec<T>) -> Vec<[T; 4]> {
    // the samples of whole texels are a whole number of fours, which makes the cast free; else they are copied
    bytemuck::allocation::try_cast_vec(samples)
        .unwrap_or_else(|(_, samples)| samples.as_chunks::<4>().0.to_vec())
}

/// A texel that is not a number is black, an infinite one as bright as a half can be: neither may make whole pictures
/// so.
fn finite(x: f32) -> f32 {
    if x.is_nan() {
        0.0
    } else if x.is_infinite() {
        MAX_HALF.copysign(x)
    } else {
        x
    }
}

/// The first layer: its R, G, B and A, or Y for all colours.
fn decode_exr(bytes: &[u8], room: &Room) -> Result<Picture, String> {
    let broken = |error: exr::error::Error| format!("is broken: {error}");
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for Header { layer_size, channels, .. } in &meta.headers {
        let channels = channels.list.len().max(4) as u64;
        check_size(layer_size.0 as u64, layer_size.1 as u64, 4 * channels, bytes.len(), room)?;
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let size = image.layer_data.size;
    let channels = image.layer_data.channel_data.list;
    let named = |name: &str| {
        let is_named = |c: &&AnyChannel<FlatSamples>| c.name.to_string().rsplit('.').next() == Some(name);
        let full = |c: &&AnyChannel<FlatSamples>| c.sample_data.len() == size.area();
        channels.iter().filter(full).find(is_named)
    };
    let gray = named("Y");
    let [Some(r), Some(g), Some(b)] = ["R", "G", "B"].map(|name| named(name).or(gray)) else {
        return Err("has no channels R, G and B, nor Y".to_owned());
    };
    let alpha = named("A");
    let texel = |i: usize| {
        let [r, g, b] = [r, g, b].map(|channel| finite(channel.sample_data.value_by_flat_index(i).to_f32()));
        [r, g, b, alpha.map_or(1.0, |a| finite(a.sample_data.value_by_flat_index(i).to_f32()))]
    };
    let texels = Level::F32((0..size.area()).map(texel).collect());
    Ok(Picture { size: [size.0 as u32, size.1 as u32], texels })
}
