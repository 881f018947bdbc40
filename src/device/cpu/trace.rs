//! Tiles over the threads of the pool.

use crate::accel::TracedScene;
use crate::clock::Stopwatch;
use crate::device::{DeviceError, Output, RayCounts, Spans, Stop, Traced};
use crate::film::{Film, gain_from_stops};
use crate::kernel::{FilmBand, Scene, TileBuffers, bands, trace_tile};
use crate::scene::{Frame, Shot};
use rayon::prelude::*;

/// Rows that a thread fills at a time.
const BAND_ROWS: u32 = 8;
/// Columns of a tile.
const TILE_COLUMNS: u32 = 32;

/// Traces a frame in the current pool.
pub(super) fn trace(
    scene: &TracedScene,
    frame: &Frame,
    shot: &Shot,
    output: Output,
    stop: &Stop,
) -> Result<Traced, DeviceError> {
    let start = Stopwatch::start();
    let scene = Scene::new(scene, frame, shot);
    let (mut film, gain) = match output {
        // colour is to be straight where there is alpha
        Output::Codes { exposure_stops } if !shot.alpha => {
            (Film::new_codes(shot.size, shot.aovs), gain_from_stops(exposure_stops))
        }
        _ => (Film::new(shot.size, shot.alpha, shot.aovs), 1.0),
    };
    let rays = bands(&mut film, BAND_ROWS, gain)
        .into_par_iter()
        .map_init(TileBuffers::default, |buffers, band| trace_band(&scene, band, buffers, stop))
        .try_reduce(RayCounts::default, |mut sum, counts| {
            sum += counts;
            Some(sum)
        })
        .ok_or(DeviceError::Stopped)?;
    let (film, trace_ms) = (film.into(), start.ms());
    Ok(Traced { film, rays, trace_ms, update_ms: None, cost_ratio: None, spans: Spans::default() })
}

/// Tile after tile; None where it was stopped.
fn trace_band(
    scene: &Scene<TracedScene>,
    mut band: FilmBand,
    buffers: &mut TileBuffers,
    stop: &Stop,
) -> Option<RayCounts> {
    let mut sum = RayCounts::default();
    for left in (0..band.width).step_by(TILE_COLUMNS as usize) {
        let columns = left..band.width.min(left + TILE_COLUMNS);
        sum += trace_tile(scene, &mut band, columns, buffers, &|| stop.asked())?;
    }
    Some(sum)
}
