//! Trees: how long building, refitting and tracing takes, beside Embree.

use super::table::{Cell, Table};
use super::times::in_turn;
use super::view::{Rays, View};
use super::{Bench, embree::Embree};
use crate::accel::{Quality, TracedObject, TracedScene, Tree};
use crate::scene::Geometry;
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
    /// The peer's figures.
    pub(super) embree: Option<Embree>,
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

/// Builds, refits and traces each, with all threads of the current pool.
pub(super) fn trees(bench: &Bench, meshes: &[Mesh]) -> Table {
    let version = meshes.iter().find_map(|m| m.embree.as_ref()).map_or("not installed", |e| &e.version);
    let about = format!(
        "Trees, {} threads, all vertices moved; camera rays and a shadow ray for each hit, 1280x720, in batches, no shading. Embree: {version}.",
        rayon::current_num_threads()
    );
    let columns = [
        "triangles",
        "build, ms",
        "refit, ms",
        "Embree refit, ms",
        "Embree/refit",
        "rays, ms",
        "Embree rays 1, ms",
        "Embree rays 16, ms",
        "Embree 1/rays",
        "hits",
        "Embree hits",
    ];
    let mut table = Table::new("trees", about, &columns);
    for Mesh { name, geometry, view, embree } in meshes {
        let (positions, triangles) = (&geometry.positions.0, &geometry.triangles.0);
        let poses = [positions.clone(), moved(positions)];
        let mut tree = Tree::build(positions, triangles, Quality::default());
        let mut turn = 0;
        let [build] =
            in_turn(bench.rounds(9), [&mut || drop(Tree::build(positions, triangles, Quality::default()))]);
        // over and over, as the peer does
        let [refit] = in_turn(
            bench.rounds(100),
            [&mut || {
                turn ^= 1;
                tree.refit(&poses[turn]);
            }],
        );
        let scene = TracedScene::new(vec![TracedObject::new(
            Arc::new(Tree::build(positions, triangles, Quality::default())),
            None,
        )]);
        let mut rays = Rays::new(view.as_ref(), positions);
        let [traced] = in_turn(bench.rounds(9), [&mut || rays.trace(&scene)]);
        let of = |figure: fn(&Embree) -> Option<f64>| Cell::from(embree.as_ref().and_then(figure));
        let [refit, traced] = [refit, traced].map(Cell::from);
        let (their_refit, single) = (of(|e| e.refit_ms), of(|e| e.single_ms));
        table.row(
            name.clone(),
            [
                (triangles.len() as f64).into(),
                build.into(),
                refit,
                their_refit,
                refit.times_in(their_refit),
                traced,
                single,
                of(|e| e.packet_ms),
                traced.times_in(single),
                (rays.hits() as f64).into(),
                of(|e| e.hits),
            ],
        );
    }
    table
}
