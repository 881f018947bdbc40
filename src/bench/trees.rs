//! Trees: how long building, refitting and tracing takes, beside Embree.

use super::embree::{Embree, Program};
use super::table::{Cell, Table};
use super::times::{Spread, in_turn, time};
use super::view::{Rays, View};
use super::{Bench, BenchError};
use crate::accel::{Quality, TracedObject, TracedScene, Tree};
use crate::scene::Geometry;
use rayon::ThreadPoolBuilder;
use std::f32::consts::TAU;
use std::sync::Arc;

/// A mesh, where it is looked at from, and what Embree needs for it.
pub(super) struct Mesh {
    /// Its name.
    pub(super) name: String,
    /// It.
    pub(super) geometry: Arc<Geometry>,
    /// From where.
    pub(super) view: Option<View>,
    /// The peer.
    pub(super) embree: Option<Program>,
}

/// A wave of 2 % of the largest extent along x, as in the Embree program.
fn moved(positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let extent = (0..3)
        .map(|k| {
            let values = positions.iter().map(|p| p[k]);
            values.clone().fold(f32::NEG_INFINITY, f32::max) - values.fold(f32::INFINITY, f32::min)
        })
        .fold(f32::MIN_POSITIVE, f32::max);
    let wave = |&[x, y, z]: &[f32; 3]| [x, y + 0.02 * extent * (TAU * 3.0 * x / extent).sin(), z];
    positions.iter().map(wave).collect()
}

/// The column of Embree's refit with one thread.
pub(super) const EMBREE_REFIT_1: &str = "Embree refit 1, ms";

/// Rounds in which we and the peer take turns, and what each does in one: as many refits and traces as the peer.
const ROUNDS: usize = 7;
const REFITS: usize = 15;
const TRACES: usize = 7;

/// Builds, refits and traces each.
pub(super) fn trees(bench: &Bench, meshes: &[Mesh]) -> Result<Table, BenchError> {
    let threads = bench.options.threads;
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().map_err(|_| BenchError::NoThreads)?;
    let mut version = "not installed".to_string();
    let columns = [
        "triangles",
        "build, ms",
        "refit, ms",
        "Embree refit, ms",
        "Embree/refit",
        EMBREE_REFIT_1,
        "rays, ms",
        "Embree rays 1, ms",
        "Embree rays 16, ms",
        "Embree 1/rays",
        "hits",
        "Embree hits",
    ];
    let mut table = Table::new("trees", String::new(), &columns);
    for mesh in meshes {
        // from inside the pool, as the peer's own thread is one of its workers
        let Measured { built, refits, traces, hits, peers } = pool.install(|| measure(bench, mesh));
        let peer = Embree::medians(&peers);
        let of = |figure: fn(&Embree) -> Option<f64>| Cell::from(peer.as_ref().and_then(figure));
        let [refit, traced] = [refits, traces].map(|ms| Cell::from(Spread::of(ms)));
        let (their_refit, single) = (of(|e| e.refit_ms), of(|e| e.single_ms));
        table.row(
            mesh.name.clone(),
            [
                (mesh.geometry.triangles.0.len() as f64).into(),
                built.into(),
                refit,
                their_refit,
                refit.times_in(their_refit),
                of(|e| e.refit_one_thread_ms),
                traced,
                single,
                of(|e| e.packet_ms),
                traced.times_in(single),
                (hits as f64).into(),
                of(|e| e.hits),
            ],
        );
        if let Some(peer) = peer {
            version = peer.version;
        }
    }
    table.about = format!(
        "Trees, {threads} threads, all vertices moved; camera rays and a shadow ray for each hit, 1280x720, in batches, no shading. Embree, in turn with us: {version}."
    );
    Ok(table)
}

/// Times in ms, of the peer too.
struct Measured {
    built: Spread,
    refits: Vec<f64>,
    traces: Vec<f64>,
    hits: usize,
    peers: Vec<Embree>,
}

/// Measures with the threads of the current pool.
fn measure(bench: &Bench, Mesh { geometry, view, embree, .. }: &Mesh) -> Measured {
    let (positions, triangles) = (&geometry.positions.0, &geometry.triangles.0);
    let build = || Tree::build(positions, triangles, Quality::default());
    let [built] = in_turn(bench.rounds(9), [&mut || drop(build())]);
    let poses = [positions.clone(), moved(positions)];
    let mut tree = build();
    let scene = TracedScene::new(vec![TracedObject::new(Arc::new(build()), None)]);
    let mut rays = Rays::new(view.as_ref(), positions);
    let (mut refits, mut traces, mut peers) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..bench.rounds(ROUNDS) {
        peers.extend(embree.as_ref().and_then(|program| program.run(rayon::current_num_threads())));
        // tracing wakes the threads, as the peer's build does
        traces.extend((0..TRACES).map(|_| time(|| rays.trace(&scene))));
        refits.extend((0..REFITS).map(|i| time(|| tree.refit(&poses[(i + 1) % 2]))));
    }
    Measured { built, refits, traces, hits: rays.hits(), peers }
}
