//! How two devices' films agree that need not be the same byte for byte: hits but for silhouettes, and what is seen.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its own share")]

use rentix::film::Film;
use rentix::film::compare::{Channel, Picture, Samples, compare};
use rentix::scene::{Aov, AovSet};

/// Of so many pixels one may have another hit.
const PIXELS_FOR_ANOTHER_HIT: usize = 2000;
/// Two hits are one where their distances differ by this part at most.
const SAME_DISTANCE: f32 = 1e-5;
/// Where the distance jumps by more than this part there is a silhouette.
const JUMP: f32 = 0.01;
/// In a small picture it jumps by more than that along a floor; by this it does not.
const LARGE_JUMP: f32 = 0.1;
/// Mean FLIP must be less.
const FLIP: f64 = 0.005;
/// Side of the blocks whose means are compared, pixels.
const BLOCK: usize = 8;
/// A block's mean may be off by this, of what is shown.
const BLOCK_OFF: f32 = 4.0 / 255.0;
/// Where neighbours differ by more than this in what is shown, there is the edge of a shadow or of a texel.
const EDGE: f32 = 16.0 / 255.0;

/// What two films differ in.
#[derive(Clone, Debug)]
pub struct Agreement {
    /// Pixels.
    pub pixels: usize,
    /// Those whose hit is another.
    pub other_hits: usize,
    /// Those of them that are not within a pixel of a silhouette.
    pub without_silhouette: Vec<[usize; 2]>,
    /// Mean FLIP.
    pub flip: f64,
    /// Blocks with a surface, those of them without silhouette or edge, and those of these whose mean is off.
    pub covered_blocks: usize,
    /// See `covered_blocks`.
    pub judged_blocks: usize,
    /// See `covered_blocks`: their upper left pixels.
    pub blocks_off: Vec<[usize; 2]>,
}

impl Agreement {
    /// Of two films with ids and depths; silhouettes are those of the first.
    pub fn new(a: &Film, b: &Film) -> Self {
        assert_eq!(a.size, b.size);
        let [width, height] = a.size.map(|n| n as usize);
        let (ids, other_ids) = (a.aovs.id.as_ref().unwrap(), b.aovs.id.as_ref().unwrap());
        let (depths, other_depths) = (a.aovs.depth.as_ref().unwrap(), b.aovs.depth.as_ref().unwrap());
        // also where both are infinite; not where one is not a number
        let is_same = |p: usize| {
            let (s, t) = (depths[p], other_depths[p]);
            ids[p] == other_ids[p] || (s - t).abs() <= SAME_DISTANCE * s.abs().max(t.abs())
        };
        let around = |[x, y]: [usize; 2]| {
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            rows.flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| [x, y]))
        };
        let jumps = |at: [usize; 2], jump: f32| {
            let p = at[1] * width + at[0];
            around(at).any(|[x, y]| {
                let q = y * width + x;
                let (s, t) = (depths[p], depths[q]);
                ids[p][0] != ids[q][0] || (s != t && (s - t).abs() > jump * s.min(t))
            })
        };
        let is_silhouette = |at| jumps(at, JUMP);
        let others: Vec<[usize; 2]> =
            (0..width * height).filter(|p| !is_same(*p)).map(|p| [p % width, p / width]).collect();
        let comparison = compare(&picture(a), &picture(b)).unwrap();
        let (shown, other_shown) = (shown(a), shown(b));
        let is_edge = |at: [usize; 2]| {
            let p = shown[at[1] * width + at[0]];
            around(at).any(|[x, y]| (0..3).any(|k| (p[k] - shown[y * width + x][k]).abs() > EDGE))
        };
        let (mut covered_blocks, mut judged_blocks, mut blocks_off) = (0, 0, Vec::new());
        for corner in (0..height).step_by(BLOCK).flat_map(|y| (0..width).step_by(BLOCK).map(move |x| [x, y]))
        {
            let [xs, ys] = [(corner[0], width), (corner[1], height)].map(|(c, end)| c..(c + BLOCK).min(end));
            let block: Vec<[usize; 2]> = ys.flat_map(|y| xs.clone().map(move |x| [x, y])).collect();
            let place = |&[x, y]: &[usize; 2]| y * width + x;
            if !block.iter().any(|at| depths[place(at)].is_finite()) {
                continue;
            }
            covered_blocks += 1;
            if block.iter().any(|&at| jumps(at, LARGE_JUMP) || is_edge(at)) {
                continue;
            }
            judged_blocks += 1;
            let mean = |shown: &[[f32; 3]], k: usize| {
                block.iter().map(|at| shown[place(at)][k]).sum::<f32>() / block.len() as f32
            };
            // also where one is not a number
            let is_off = |k: usize| {
                let off = (mean(&shown, k) - mean(&other_shown, k)).abs();
                off.is_nan() || off > BLOCK_OFF
            };
            if (0..3).any(is_off) {
                blocks_off.push(corner);
            }
        }
        Self {
            pixels: width * height,
            other_hits: others.len(),
            without_silhouette: others.into_iter().filter(|&at| !around(at).any(is_silhouette)).collect(),
            flip: comparison.flip,
            covered_blocks,
            judged_blocks,
            blocks_off,
        }
    }

    /// Where they differ by more than they may.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let Self { pixels, other_hits, without_silhouette, flip, blocks_off, .. } = self;
        if other_hits * PIXELS_FOR_ANOTHER_HIT > *pixels {
            faults.push(format!("{other_hits} of {pixels} pixels have another hit"));
        }
        if !without_silhouette.is_empty() {
            faults.push(format!("another hit away from silhouettes at {without_silhouette:?}"));
        }
        // also where it is not a number
        if flip.is_nan() || *flip >= FLIP {
            faults.push(format!("FLIP is {flip}"));
        }
        if !blocks_off.is_empty() {
            faults.push(format!("blocks of 8x8 pixels are off at {blocks_off:?}"));
        }
        faults
    }

    /// As [`Self::check`]; and there are blocks with a surface, of which at least half could be judged, which takes a picture of
    /// some size.
    #[track_caller]
    pub fn check_blocks(&self, what: &str) {
        self.check(what);
        let Self { covered_blocks, judged_blocks, .. } = self;
        assert!(
            *judged_blocks > 0 && 2 * judged_blocks >= *covered_blocks,
            "{what}: {judged_blocks} of {covered_blocks} have no edge"
        );
    }

    /// Fails, naming what, where there is a fault.
    #[track_caller]
    pub fn check(&self, what: &str) {
        let faults = self.faults();
        assert!(faults.is_empty(), "{what}: {}", faults.join("; "));
    }
}

/// What is shown of a film: values on the sRGB curve.
fn shown(film: &Film) -> Vec<[f32; 3]> {
    let curve = |x: f32| {
        let x = x.clamp(0.0, 1.0);
        if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
    };
    film.rgb.iter().map(|p| p.map(curve)).collect()
}

/// The colour of a film.
fn picture(film: &Film) -> Picture {
    let channel = |k: usize, name: &str| Channel {
        name: name.to_string(),
        samples: Samples::Float(film.rgb.iter().map(|p| p[k]).collect()),
    };
    Picture { size: film.size, channels: vec![channel(0, "R"), channel(1, "G"), channel(2, "B")] }
}

/// It bites, and lets be what it should.
#[test]
fn agreement_on_paper() {
    // two walls, at distances 1 and 2, side by side
    let film = |change: &dyn Fn(&mut Film)| {
        let mut aovs = AovSet::default();
        for aov in [Aov::Depth, Aov::Id] {
            aovs.insert(aov);
        }
        let mut film = Film::new([80, 50], false, aovs);
        for p in 0..80 * 50 {
            let is_left = p % 80 < 40;
            film.rgb[p] = [if is_left { 0.5 } else { 0.2 }; 3];
            film.aovs.depth.as_mut().unwrap()[p] = if is_left { 1.0 } else { 2.0 };
            film.aovs.id.as_mut().unwrap()[p] = if is_left { [0, 0] } else { [1, 0] };
        }
        change(&mut film);
        film
    };
    let hit = |film: &mut Film, [x, y]: [usize; 2], id: [u32; 2], depth: f32| {
        film.aovs.id.as_mut().unwrap()[80 * y + x] = id;
        film.aovs.depth.as_mut().unwrap()[80 * y + x] = depth;
    };
    let of = |change: &dyn Fn(&mut Film)| Agreement::new(&film(&|_| ()), &film(change));
    let fails = |a: &Agreement| !a.faults().is_empty();
    let same = of(&|_| ());
    assert!((same.other_hits, same.flip) == (0, 0.0) && !fails(&same));
    // another triangle at the same distance, and a little off
    assert_eq!(of(&|f| hit(f, [9, 9], [0, 1], 1.000_009)).other_hits, 0);
    assert_eq!(of(&|f| hit(f, [9, 9], [0, 1], 1.000_02)).other_hits, 1);
    // 4000 pixels: two may be other ones, three may not; the silhouette is between columns 39 and 40
    let at_silhouette = |f: &mut Film, rows: usize| (0..rows).for_each(|y| hit(f, [41, y], [0, 0], 1.0));
    assert!(!fails(&of(&|f| at_silhouette(f, 2))));
    assert!(fails(&of(&|f| at_silhouette(f, 3))));
    let away = of(&|f| hit(f, [42, 7], [0, 0], 1.0));
    assert!(away.without_silhouette == [[42, 7]] && fails(&away));
    assert!(fails(&of(&|f| hit(f, [9, 9], [0, 1], f32::NAN))), "what is not a number is no distance");
    assert!(fails(&of(&|f| f.rgb.iter_mut().for_each(|p| p[0] += 0.1))));
    // 10 x 7 blocks; those of the walls' border, columns 32 to 47, have an edge
    assert_eq!((same.covered_blocks, same.judged_blocks), (70, 56));
    // one block off by 5/255 in its mean
    let off = |by: f32| {
        of(&move |f| (8..16).for_each(|y| (64..72).for_each(|x| f.rgb[80 * y + x] = [0.2 + by; 3])))
    };
    let code = 1.0 / 255.0 / 1.055 * 2.4 * 0.2_f32.powf(1.4 / 2.4);
    assert!(off(3.5 * code).blocks_off.is_empty());
    assert!(off(4.7 * code).blocks_off == [[64, 8]] && fails(&off(4.7 * code)));
}
