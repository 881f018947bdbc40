//! What a frame's kernels wrote, as a film.

use super::exposed::Exposed;
use super::records::{CENTER_WORDS, COUNTER_ROWS};
use super::scene::film_words;
use crate::device::{Output, RayCounts};
use crate::film::{Film, Pixels};
use crate::scene::{AovSet, Shot};
use rayon::ThreadPool;
use rayon::prelude::*;
use std::ops::Range;

/// Words of a row of counts of rays.
const COUNTER_ROW: u64 = 8;
pub(super) const COUNTERS: u64 = COUNTER_ROWS * COUNTER_ROW;
/// Instants: when fits begin and end, and tracing.
pub(super) const INSTANTS: u64 = 4;
/// Storage bindings begin at multiples of this on every adapter.
const ALIGNMENT: u64 = 256;
/// Pixels that one thread takes out together.
const GRAIN: usize = 1 << 15;

/// Where the parts of a frame's output lie, in bytes.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) film: Range<u64>,
    /// Empty where nothing of the centres is wanted.
    pub(super) center: Range<u64>,
    pub(super) counters: Range<u64>,
    pub(super) instants: Range<u64>,
    /// A float for each tree that was fitted.
    pub(super) costs: Range<u64>,
}

impl Layout {
    pub(super) fn new(shot: &Shot, output: Output, has_albedo: bool, fits: u64) -> Self {
        let pixels = u64::from(shot.size[0]) * u64::from(shot.size[1]);
        let film_bytes = match output {
            Output::Codes { .. } => code_row_bytes(shot.size[0]) * u64::from(shot.size[1]),
            Output::Linear => {
                4 * pixels * (u64::from(film_words(shot, output)) + if has_albedo { 3 } else { 0 })
            }
        };
        let mut end = 0_u64;
        let mut section = |bytes: u64| {
            let start = end.next_multiple_of(ALIGNMENT);
            end = start + bytes;
            start..end
        };
        Self {
            film: section(film_bytes),
            center: section(if wants_center(shot) { 4 * CENTER_WORDS * pixels } else { 0 }),
            counters: section(4 * COUNTERS),
            instants: section(8 * INSTANTS),
            costs: section(4 * fits),
        }
    }

    pub(super) fn bytes(&self) -> u64 {
        self.costs.end.next_multiple_of(16)
    }
}

/// Whether auxiliary pictures of the rays through the pixels' centres are wanted.
fn wants_center(shot: &Shot) -> bool {
    use crate::scene::Aov::{Depth, Id, Material, Normal, Position, Uv};
    [Depth, Normal, Position, Id, Material, Uv].into_iter().any(|aov| shot.aovs.contains(aov))
}

/// What else a frame brought back.
#[derive(Clone, Debug)]
pub(super) struct Facts {
    pub(super) rays: RayCounts,
    /// Ticks.
    pub(super) instants: [u64; INSTANTS as usize],
    /// For each tree that was fitted its surface-area cost.
    pub(super) costs: Vec<f32>,
}

/// The bytes of a part.
fn part<'a>(bytes: &'a [u8], range: &Range<u64>) -> &'a [u8] {
    &bytes[range.start as usize..range.end as usize]
}

/// What else than the film a frame's bytes say.
pub(super) fn facts(bytes: &[u8], layout: &Layout) -> Facts {
    let mut instants = [0; INSTANTS as usize];
    instants.copy_from_slice(bytemuck::cast_slice(part(bytes, &layout.instants)));
    let costs = bytemuck::cast_slice(part(bytes, &layout.costs)).to_vec();
    Facts { rays: ray_counts(bytemuck::cast_slice(part(bytes, &layout.counters))), instants, costs }
}

/// Part of a frame's bytes that are as a film has them.
struct PartOf {
    exposed: Exposed,
    range: Range<u64>,
}

impl AsRef<[u8]> for PartOf {
    fn as_ref(&self) -> &[u8] {
        part(self.exposed.as_ref(), &self.range)
    }
}

/// The film of a frame's bytes. It keeps them where they are where it is nothing but pixels as it has them; else it is made of
/// them, on the threads of a pool, and their buffer, which may be much larger, is free again.
pub(super) fn take_out(
    exposed: Exposed,
    layout: &Layout,
    shot: &Shot,
    output: Output,
    pool: &ThreadPool,
) -> Film {
    let size = shot.size;
    let is_plain = match output {
        Output::Codes { .. } => 3 * u64::from(size[0]) == code_row_bytes(size[0]),
        Output::Linear => !shot.alpha && shot.aovs.is_empty(),
    };
    if is_plain {
        let pixels = PartOf { range: layout.film.clone(), exposed };
        return match output {
            Output::Codes { .. } => Film::of_codes(size, Pixels::lent(pixels)),
            Output::Linear => {
                Film { rgb: Pixels::lent(pixels), ..Film::without_rgb(size, false, AovSet::default()) }
            }
        };
    }
    let of = |range: &Range<u64>| part(exposed.as_ref(), range);
    pool.install(|| match output {
        Output::Codes { .. } => Film::of_codes(size, codes(of(&layout.film), size[0]).into()),
        Output::Linear => {
            let floats: &[f32] = bytemuck::cast_slice(of(&layout.film));
            let pixels = size[0] as usize * size[1] as usize;
            let words_each = film_words(shot, output) as usize;
            let (pixel_floats, albedo) = floats.split_at(words_each * pixels);
            let mut film = Film::without_rgb(size, shot.alpha, shot.aovs);
            if words_each == 3 {
                let rows = pixel_floats.as_chunks::<3>().0;
                film.rgb = rows.par_iter().with_min_len(GRAIN).copied().collect::<Vec<_>>().into();
            } else {
                fill_rgb_through(&mut film, pixel_floats);
            }
            if let Some(to) = &mut film.aovs.albedo {
                to.copy_from_slice(albedo.as_chunks::<3>().0);
            }
            fill_center(&mut film, bytemuck::cast_slice(of(&layout.center)));
            film
        }
    })
}

/// Bytes of a row of codes: three a pixel, and what fills its last word.
fn code_row_bytes(width: u32) -> u64 {
    4 * (3 * u64::from(width)).div_ceil(4)
}

/// Codes without what fills words.
fn codes(bytes: &[u8], width: u32) -> Vec<u8> {
    let mut codes = Vec::with_capacity(bytes.len());
    for bytes in bytes.chunks_exact(code_row_bytes(width) as usize) {
        codes.extend_from_slice(&bytes[..3 * width as usize]);
    }
    codes
}

/// Linear RGB and what the background counts for.
fn fill_rgb_through(film: &mut Film, floats: &[f32]) {
    let rows = floats.as_chunks::<4>().0;
    film.rgb =
        rows.par_iter().with_min_len(GRAIN).map(|[r, g, b, _]| [*r, *g, *b]).collect::<Vec<_>>().into();
    for share in [&mut film.alpha, &mut film.aovs.coverage].into_iter().flatten() {
        for (to, [.., through]) in share.iter_mut().zip(rows) {
            *to = 1.0 - through;
        }
    }
}

fn fill_center(film: &mut Film, words: &[u32]) {
    fn each<T>(to: &mut Option<Vec<T>>, pixels: &[[u32; 12]], of: impl Fn(&[u32; 12]) -> T) {
        for (to, pixel) in to.iter_mut().flatten().zip(pixels) {
            *to = of(pixel);
        }
    }
    let pixels = words.as_chunks::<{ CENTER_WORDS as usize }>().0;
    let aovs = &mut film.aovs;
    let f = f32::from_bits;
    each(&mut aovs.depth, pixels, |p| f(p[0]));
    each(&mut aovs.normal, pixels, |p| [f(p[1]), f(p[2]), f(p[3])]);
    each(&mut aovs.position, pixels, |p| [f(p[4]), f(p[5]), f(p[6])]);
    each(&mut aovs.id, pixels, |p| [p[7], p[8]]);
    each(&mut aovs.material, pixels, |p| p[9]);
    each(&mut aovs.uv, pixels, |p| [f(p[10]), f(p[11])]);
}

fn ray_counts(words: &[u32]) -> RayCounts {
    let rows = words.as_chunks::<{ COUNTER_ROW as usize }>().0;
    let count = |i: usize| rows.iter().map(|row| u64::from(row[i])).sum();
    RayCounts {
        camera: count(0),
        shadow: count(1),
        mirrored: count(2),
        refracted: count(3),
        media_ignored: count(4),
    }
}
