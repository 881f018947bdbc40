//! What was typed becomes what is asked of the job.

use super::render_args::RenderArgs;
use crate::format::ClipChoice;
use crate::job::options::limits::{self, within};
use crate::job::words::one_of;
use crate::job::{CameraChoice, LightChoice, Options, Request, settings};
use anyhow::{Result, anyhow};
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Checks the options and gathers them.
pub(super) fn request(args: &RenderArgs) -> Result<Request> {
    Ok(Request {
        inputs: args.inputs.clone(),
        job_file: args.job.clone(),
        options: options(args)?,
        frames: parsed("--frames", args.frames.as_deref())?,
        chunk: parsed("--chunk", args.chunk.as_deref())?,
        order: parsed("--order", args.order.as_deref())?.unwrap_or_default(),
        one_sequence: args.one_sequence,
        strict: args.strict,
        fps: ranged("--fps", args.fps, &limits::FPS)?,
        clip: args.clip.as_deref().map(ClipChoice::from_word),
        folder: args.output.clone(),
        ..Request::default()
    })
}

fn options(args: &RenderArgs) -> Result<Options> {
    let lights = args.light.iter().map(|l| settings::light(l)).collect::<Result<Vec<_>, _>>();
    let lights = lights.map_err(|e| anyhow!("--light: {e}"))?;
    let aov = args.aov.as_ref().map(|list| settings::aovs(list.iter().map(String::as_str)));
    Ok(Options {
        size: args.size,
        format: read("--format", args.format.as_deref(), settings::format_word)?,
        name: args.name.clone(),
        alpha: args.alpha.then_some(true),
        bits: args
            .bits
            .map(|b| settings::bits(f64::from(b)))
            .transpose()
            .map_err(|e| anyhow!("--bits: {e}"))?,
        quality: args.quality,
        camera: None::<CameraChoice>,
        eye: read("--eye", args.eye.as_deref(), settings::vector)?,
        look_at: read("--look-at", args.look_at.as_deref(), settings::vector)?,
        up: read("--up", args.up.as_deref(), settings::up)?,
        fov: ranged("--fov", args.fov, &limits::FOV)?,
        lights: (!lights.is_empty()).then_some(LightChoice::Given(lights)),
        ambient: read("--ambient", args.ambient.as_deref(), settings::color)?,
        background: read("--background", args.background.as_deref(), settings::background)?,
        samples: args.samples,
        filter: read("--filter", args.filter.as_deref(), |w| one_of(&settings::FILTERS, w))?,
        depth: args.depth,
        seed: args.seed,
        exposure: ranged("--exposure", args.exposure, &limits::EXPOSURE)?,
        smooth_angle: ranged("--smooth-angle", args.smooth_angle, &limits::ANGLE)?,
        aov: aov.transpose().map_err(|e| anyhow!("--aov: {e}"))?,
        mtl_srgb: read("--mtl-color", args.mtl_color.as_deref(), |w| one_of(&settings::MTL_COLORS, w))?,
        prune: ranged("--prune", args.prune, &limits::PRUNE)?,
        materials: Vec::new(),
    })
}

fn read<T>(option: &str, text: Option<&str>, from: impl Fn(&str) -> Result<T, String>) -> Result<Option<T>> {
    text.map(|t| from(t).map_err(|e| anyhow!("{option}: {e}"))).transpose()
}

fn parsed<T: FromStr<Err = String>>(option: &str, text: Option<&str>) -> Result<Option<T>> {
    read(option, text, str::parse)
}

fn ranged<T: Copy + Into<f64>>(option: &str, x: Option<T>, range: &RangeInclusive<f64>) -> Result<Option<T>> {
    if let Some(x) = x {
        within(x.into(), range).map_err(|e| anyhow!("{option}: {e}"))?;
    }
    Ok(x)
}
