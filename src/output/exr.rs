//! `OpenEXR`: linear 32-bit floats, unclamped, premultiplied; auxiliary pictures as layers by their channels' names.
//!
//! Nothing but pixels and colour space is written, and by one thread, so that the bytes are a function of the film.

use super::encoding::Encoding;
use crate::film::Film;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding as Blocks, FlatSamples, Image, Layer, LayerAttributes, WritableImage,
};
use std::io::Cursor;

/// Colour, alpha where the film has it, and all its auxiliary pictures.
pub(super) fn encode(film: &Film, _: Encoding) -> Result<Vec<u8>, String> {
    let mut channels = Vec::from(planes(["R", "G", "B"], &film.rgb));
    channels.extend(film.alpha.iter().map(|alpha| plane("A", alpha.clone())));
    channels.extend(aov_channels(film));
    write(film, channels)
}

/// The auxiliary pictures alone.
pub(super) fn encode_aovs(film: &Film) -> Result<Vec<u8>, String> {
    write(film, aov_channels(film))
}

type Channel = AnyChannel<FlatSamples>;

fn aov_channels(film: &Film) -> Vec<Channel> {
    let aovs = &film.aovs;
    let mut channels = Vec::new();
    channels.extend(aovs.depth.iter().map(|depth| plane("depth.Z", depth.clone())));
    let vectors = [
        (["normal.X", "normal.Y", "normal.Z"], &aovs.normal),
        (["position.X", "position.Y", "position.Z"], &aovs.position),
        (["albedo.R", "albedo.G", "albedo.B"], &aovs.albedo),
    ];
    for (names, values) in vectors {
        channels.extend(values.iter().flat_map(|values| planes(names, values)));
    }
    if let Some(id) = &aovs.id {
        for (i, name) in ["id.part", "id.triangle"].into_iter().enumerate() {
            channels.push(AnyChannel::new(name, FlatSamples::U32(id.iter().map(|id| id[i]).collect())));
        }
    }
    let material = aovs.material.iter();
    channels.extend(material.map(|m| AnyChannel::new("material.slot", FlatSamples::U32(m.clone()))));
    if let Some(uv) = &aovs.uv {
        for (i, name) in ["uv.U", "uv.V"].into_iter().enumerate() {
            channels.push(plane(name, uv.iter().map(|uv| uv[i]).collect()));
        }
    }
    channels.extend(aovs.coverage.iter().map(|coverage| plane("coverage.A", coverage.clone())));
    channels
}

fn planes(names: [&str; 3], values: &[[f32; 3]]) -> [Channel; 3] {
    [0, 1, 2].map(|i| plane(names[i], values.iter().map(|v| v[i]).collect()))
}

fn plane(name: &str, values: Vec<f32>) -> Channel {
    AnyChannel::new(name, FlatSamples::F32(values))
}

fn write(film: &Film, channels: Vec<Channel>) -> Result<Vec<u8>, String> {
    let size = film.size.map(|n| n as usize);
    let channels = AnyChannels::sort(channels.into());
    let layer = Layer::new((size[0], size[1]), LayerAttributes::default(), Blocks::SMALL_LOSSLESS, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}
