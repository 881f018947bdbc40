//! Whole pixels against values worked out on paper. The eye is at (0, 0, 4) and looks along −z; the pixel in the middle
//! sees the origin, where a wall that faces +z stands, so N = Ng = V = (0, 0, 1).

mod area;
mod mirrors;
mod panes;
mod textures;

use super::{Scene, TileBuffers, bands, trace_tile};
use crate::accel::{Quality, TracedObject, TracedScene, Tree};
use crate::film::Film;
use crate::kernel::RayCounts;
use crate::math::{DAffine3, DVec3, Vec3};
use crate::scene::{
    ABSENT, Aov, AovSet, Attribute, Background, Camera, Colors, Corners, Faces, Falloff, Filter, Frame,
    Geometry, Light, Material, MaterialRuns, Mesh, Normals, Object, Part, Positions, Shot, Triangles,
};
use std::sync::Arc;

/// The light is at (3, 0, 4): L = (0.6, 0, 0.8), N·L = 0.8, its distance 5; H = (0.6, 0, 1.8) / √3.6, (N·H)² = 0.9.
fn light(falloff: Falloff) -> Light {
    Light::Point {
        position: Vec3::new(3.0, 0.0, 4.0),
        color: Vec3::new(1.0, 0.5, 0.25),
        intensity: 2.0,
        falloff,
    }
}

fn shot(lights: Vec<Light>) -> Shot {
    let mut aovs = AovSet::default();
    for aov in Aov::ALL {
        aovs.insert(aov);
    }
    Shot {
        camera: Camera { eye: DVec3::new(0.0, 0.0, 4.0), look_at: DVec3::ZERO, up: DVec3::Y, fov_deg: 40.0 },
        lights,
        ambient: Vec3::new(0.3, 0.2, 0.1),
        background: Background::Color(Vec3::new(0.1, 0.2, 0.4)),
        size: [5, 3],
        samples: 1,
        filter: Filter::Box,
        depth: 10,
        seed: 0,
        prune: 1.0 / 4096.0,
        alpha: false,
        aovs,
    }
}

/// A rectangle around (x, 0, z) that faces +z, of one mesh with one material: `half` to the left, right and down, 1.2
/// `half` up, so that (x, 0, z) is within the first triangle, its weights there 1/2, 1/22 and 10/22.
fn rectangle(x: f32, half: f32, z: f32, material: Option<&Material>) -> Geometry {
    let positions =
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.2], [-1.0, 1.2]].map(|[i, j]| [x + half * i, half * j, z]);
    Geometry {
        positions: Part::new(Positions(positions.to_vec())),
        faces: Part::new(Faces { counts: vec![4], corners: vec![0, 1, 2, 3] }),
        triangles: Part::new(Triangles(vec![[0, 1, 2], [0, 2, 3]])),
        texcoords: None,
        normals: None,
        colors: None,
        material_runs: Part::new(MaterialRuns(vec![[0, if material.is_some() { 0 } else { ABSENT }]])),
        materials: material.map(|m| Part::new(m.clone())).into_iter().collect(),
        meshes: vec![Mesh { first_face: 0, face_count: 1, first_triangle: 0, triangle_count: 2 }],
    }
}

/// The same with one shading normal all over.
fn tilted(mut g: Geometry, normal: [f32; 3]) -> Geometry {
    g.normals = Some(Attribute {
        values: Part::new(Normals(vec![normal])),
        corners: Part::new(Corners(vec![[0; 3]; 2])),
    });
    g
}

/// The same seen from behind.
fn reversed(mut g: Geometry) -> Geometry {
    g.triangles = Part::new(Triangles(vec![[2, 1, 0], [3, 2, 0]]));
    g
}

/// A rectangle that shows one colour, whatever shines on it.
fn shows(x: f32, half: f32, z: f32, color: [f32; 3]) -> Geometry {
    rectangle(x, half, z, Some(&Material { kd: color, illum: 0, ..Material::default() }))
}

fn frame(geometries: Vec<Geometry>) -> Frame {
    let object = |g| Object { geometry: Arc::new(g), transform: None };
    Frame { objects: geometries.into_iter().map(object).collect() }
}

fn traced_scene(frame: &Frame) -> TracedScene {
    let object = |o: &Object| {
        let tree = Tree::build(&o.geometry.positions.0, &o.geometry.triangles.0, Quality::default());
        TracedObject::new(Arc::new(tree), o.transform.as_ref())
    };
    TracedScene::new(frame.objects.iter().map(object).collect())
}

fn render_in_tiles(frame: &Frame, shot: &Shot, rows: u32, columns: u32) -> (Film, RayCounts) {
    let aggregate = traced_scene(frame);
    let scene = Scene::new(&aggregate, frame, shot);
    let mut film = Film::new(shot.size, shot.alpha, shot.aovs);
    let mut counts = RayCounts::default();
    let mut buffers = TileBuffers::default();
    for mut band in bands(&mut film, rows, 1.0) {
        for left in (0..shot.size[0]).step_by(columns as usize) {
            let columns = left..shot.size[0].min(left + columns);
            counts += trace_tile(&scene, &mut band, columns, &mut buffers, &|| false).unwrap();
        }
    }
    (film, counts)
}

/// The place of the pixel in the middle.
const MIDDLE: usize = 7;

fn render(geometries: Vec<Geometry>, shot: &Shot) -> Film {
    render_in_tiles(&frame(geometries), shot, 3, 5).0
}

/// The pixel in the middle.
fn middle(geometries: Vec<Geometry>, shot: &Shot) -> [f32; 3] {
    render(geometries, shot).rgb[MIDDLE]
}

#[track_caller]
fn assert_near(got: [f32; 3], expected: [f32; 3]) {
    let off = got.iter().zip(expected).map(|(g, e)| (g - e).abs()).fold(0.0, f32::max);
    assert!(off < 1e-6, "{got:?}, not {expected:?}");
}

fn material(illum: u8) -> Material {
    Material {
        ka: [0.5, 0.1, 0.9],
        kd: [0.8, 0.5, 0.2],
        ks: [0.5, 0.6, 0.1],
        ke: [0.01, 0.02, 0.03],
        ns: 20.0,
        illum,
        ..Material::default()
    }
}

/// A = Ka·Ia + Ke = (0.16, 0.04, 0.12).
const A: [f32; 3] = [0.16, 0.04, 0.12];
/// D = Kd · 2·(1, 0.5, 0.25) · 0.8 = (1.28, 0.4, 0.08).
const D: [f32; 3] = [1.28, 0.4, 0.08];
/// S = Ks · 2·(1, 0.5, 0.25) · 0.9^10, 0.9^10 = 0.3486784401.
const S: [f32; 3] = [0.34867844, 0.20920706, 0.017433922];

fn sum(terms: &[[f32; 3]]) -> [f32; 3] {
    std::array::from_fn(|k| terms.iter().map(|t| t[k]).sum())
}

fn times(a: [f32; 3], factor: f32) -> [f32; 3] {
    a.map(|x| factor * x)
}

#[test]
fn models_0_to_2() {
    let of = |illum| {
        render(vec![rectangle(0.0, 1.0, 0.0, Some(&material(illum)))], &shot(vec![light(Falloff::None)]))
    };
    assert_near(of(0).rgb[MIDDLE], [0.8, 0.5, 0.2]);
    assert_near(of(1).rgb[MIDDLE], sum(&[A, D]));
    assert_near(of(2).rgb[MIDDLE], sum(&[A, D, S]));
    // beside the wall is background: the picture is 2.91 high and 4.85 wide at z = 0, its last column 0.97
    assert_eq!(of(1).rgb[5], [0.1, 0.2, 0.4]);
}

#[test]
fn lights_add_up_and_weaken() {
    let wall = || vec![rectangle(0.0, 1.0, 0.0, Some(&material(1)))];
    let film = render(wall(), &shot(vec![light(Falloff::InverseSquare)]));
    assert_near(film.rgb[MIDDLE], sum(&[A, times(D, 1.0 / 25.0)]));
    let film = render(wall(), &shot(vec![light(Falloff::None), light(Falloff::InverseSquare)]));
    assert_near(film.rgb[MIDDLE], sum(&[A, D, times(D, 1.0 / 25.0)]));
    // from behind: no light
    let behind = Light::Point {
        position: Vec3::new(0.0, 0.0, -1.0),
        color: Vec3::ONE,
        intensity: 1.0,
        falloff: Falloff::None,
    };
    assert_near(render(wall(), &shot(vec![behind])).rgb[MIDDLE], A);
}

#[test]
fn without_a_material_a_face_is_grey_or_has_its_vertices_colour() {
    let shot = shot(vec![light(Falloff::None)]);
    // Kd 0.8: D = 0.8 · 2·(1, 0.5, 0.25) · 0.8
    let mut wall = rectangle(0.0, 1.0, 0.0, None);
    assert_near(render(vec![wall.clone()], &shot).rgb[MIDDLE], [1.28, 0.64, 0.32]);
    // half of white, 1/22 of a corner without a colour (Kd 0.8), 10/22 of sRGB 0.5 = 0.21404114
    let absent = [f32::NAN; 3];
    wall.colors = Some(Part::new(Colors(vec![[1.0; 3], absent, [0.5; 3], absent])));
    let kd = 0.5 + (0.8 + 10.0 * 0.21404114) / 22.0;
    assert_near(render(vec![wall], &shot).rgb[MIDDLE], [1.6 * kd, 0.8 * kd, 0.4 * kd]);
}

#[test]
fn shadows_take_what_the_blockers_hold_back() {
    // the shadow ray passes (1.5, 0, 2) and (0.75, 0, 1)
    let shot = shot(vec![light(Falloff::None)]);
    let wall = || rectangle(0.0, 1.0, 0.0, Some(&material(1)));
    let blocker = |x, z, d| rectangle(x, 0.2, z, Some(&Material { d, ..material(1) }));
    assert_near(render(vec![wall(), blocker(1.5, 2.0, 1.0)], &shot).rgb[MIDDLE], A);
    assert_near(render(vec![wall(), blocker(1.5, 2.0, 0.6)], &shot).rgb[MIDDLE], sum(&[A, times(D, 0.4)]));
    let both = vec![wall(), blocker(1.5, 2.0, 0.6), blocker(0.75, 1.0, 0.5)];
    assert_near(render(both, &shot).rgb[MIDDLE], sum(&[A, times(D, 0.2)]));
    let opaque_behind = vec![wall(), blocker(1.5, 2.0, 1.0), blocker(0.75, 1.0, 0.5)];
    assert_near(render(opaque_behind, &shot).rgb[MIDDLE], A);
    // beyond the light nothing counts
    assert_near(render(vec![wall(), blocker(3.3, 4.4, 1.0)], &shot).rgb[MIDDLE], sum(&[A, D]));
}

#[test]
fn what_is_transparent_lets_the_background_through() {
    let mut shot = shot(vec![light(Falloff::None)]);
    let pane = |z, d| rectangle(0.0, 1.0, z, Some(&Material { d, ..material(1) }));
    let c = sum(&[A, D]);
    let film = render(vec![pane(0.0, 0.6)], &shot);
    assert_near(film.rgb[MIDDLE], sum(&[times(c, 0.6), times([0.1, 0.2, 0.4], 0.4)]));
    // wholly transparent in front: as if it were not there, for shadow rays too
    let film = render(vec![pane(0.0, 0.6), pane(0.5, 0.0)], &shot);
    assert_near(film.rgb[MIDDLE], sum(&[times(c, 0.6), times([0.1, 0.2, 0.4], 0.4)]));
    assert_eq!(film.aovs.depth.unwrap()[MIDDLE], 4.0);
    shot.alpha = true;
    let film = render(vec![pane(0.0, 0.6)], &shot);
    assert_near(film.rgb[MIDDLE], times(c, 0.6));
    assert_eq!(film.alpha.as_ref().unwrap()[MIDDLE], 1.0 - 0.4);
    assert_eq!((film.alpha.as_ref().unwrap()[5], film.rgb[5]), (0.0, [0.0; 3]));
}

#[test]
fn a_ray_crosses_256_surfaces_at_most() {
    // Kd 0 and Ke 1: each pane of d = 0.005 adds 0.005 · 0.995^k; the sum over 256 is 1 − 0.995^256 = 0.722847
    let glow = Material { kd: [0.0; 3], ke: [1.0; 3], d: 0.005, illum: 1, ..Material::default() };
    let panes =
        |n: u32| (0..n).map(|i| rectangle(0.0, 1.0, -0.01 * i as f32, Some(&glow))).collect::<Vec<_>>();
    let shot = Shot { alpha: true, ..shot(vec![]) };
    let through = 0.995_f64.powi(256);
    let film = render(panes(300), &shot);
    assert!((f64::from(film.rgb[MIDDLE][0]) - (1.0 - through)).abs() < 1e-5, "{:?}", film.rgb[MIDDLE]);
    assert_eq!(film.alpha.unwrap()[MIDDLE], 1.0, "what lies behind is not the background");
    // after fewer the background comes
    let film = render(panes(255), &shot);
    assert!((f64::from(film.alpha.unwrap()[MIDDLE]) - (1.0 - through / 0.995)).abs() < 1e-5);
}

#[test]
fn rays_of_little_weight_are_not_traced() {
    // 1 − d = 0.01: below the weight of 0.02 the background is not looked for
    let pane = vec![rectangle(0.0, 1.0, 0.0, Some(&Material { d: 0.99, illum: 0, ..material(0) }))];
    let with = |prune| render(pane.clone(), &Shot { prune, ..shot(vec![]) }).rgb[MIDDLE];
    assert_near(with(0.02), [0.792, 0.495, 0.198]);
    assert_near(with(0.0), [0.793, 0.497, 0.202]);
}

#[test]
fn shading_normals_are_interpolated_and_turned_to_the_viewers_side() {
    let shot = shot(vec![light(Falloff::None)]);
    let with_normals = |normals: Vec<[f32; 3]>, corners: [u32; 4]| {
        let mut wall = rectangle(0.0, 1.0, 0.0, Some(&material(1)));
        let [a, b, c, d] = corners;
        wall.normals = Some(Attribute {
            values: Part::new(Normals(normals)),
            corners: Part::new(Corners(vec![[a, b, c], [a, c, d]])),
        });
        render(vec![wall], &shot)
    };
    // 12/22 of (0, 0, 2) and 10/22 of (1.2, 0, 0) is along (1, 0, 2), N·L = (0.6 + 1.6) / √5 = 0.983870
    let film = with_normals(vec![[0.0, 0.0, 2.0], [1.2, 0.0, 0.0]], [0, 0, 1, 1]);
    assert_near(film.rgb[MIDDLE], sum(&[A, times(D, 0.983_870 / 0.8)]));
    // the other way round: turned back
    let film = with_normals(vec![[0.0, 0.0, -2.0], [-1.2, 0.0, 0.0]], [0, 0, 1, 1]);
    assert_near(film.rgb[MIDDLE], sum(&[A, times(D, 0.983_870 / 0.8)]));
    // absent at one corner: the triangle's own
    let film = with_normals(vec![[1.0, 0.0, 1.0]], [0, 0, ABSENT, 0]);
    assert_near(film.rgb[MIDDLE], sum(&[A, D]));
    // N turned away from the light: nothing, though Ng faces it
    let film = with_normals(vec![[-1.0, 0.0, 0.1]], [0; 4]);
    assert_near(film.rgb[MIDDLE], A);
}

#[test]
fn a_face_seen_from_behind_is_lit_from_the_viewers_side() {
    let mut wall = rectangle(0.0, 1.0, 0.0, Some(&material(2)));
    wall.triangles = Part::new(Triangles(vec![[2, 1, 0], [3, 2, 0]]));
    let film = render(vec![wall], &shot(vec![light(Falloff::None)]));
    assert_near(film.rgb[MIDDLE], sum(&[A, D, S]));
    assert_eq!(film.aovs.normal.unwrap()[MIDDLE], [0.0, 0.0, 1.0]);
}

#[test]
fn auxiliary_pictures() {
    let objects = vec![
        rectangle(0.0, 0.1, 1.0, Some(&Material { d: 0.0, ..material(1) })),
        rectangle(0.0, 1.0, 0.0, None),
    ];
    let film = render(objects, &shot(vec![]));
    let aovs = film.aovs;
    // the first surface is not there (d 0)
    assert_eq!(aovs.id.as_ref().unwrap()[MIDDLE], [1, 0]);
    assert_eq!(aovs.depth.as_ref().unwrap()[MIDDLE], 4.0);
    assert_eq!(aovs.position.as_ref().unwrap()[MIDDLE], [0.0; 3]);
    assert_eq!(aovs.normal.as_ref().unwrap()[MIDDLE], [0.0, 0.0, 1.0]);
    assert_eq!(aovs.albedo.as_ref().unwrap()[MIDDLE], [0.8; 3]);
    // nothing
    assert_eq!(aovs.id.unwrap()[5], [u32::MAX; 2]);
    assert_eq!(aovs.depth.unwrap()[5], f32::INFINITY);
    assert_eq!(aovs.position.unwrap()[5], [0.0; 3]);
    assert_eq!(aovs.normal.unwrap()[5], [0.0; 3]);
    assert_eq!(aovs.albedo.unwrap()[5], [0.0; 3]);
}

#[test]
fn parts_are_meshes_counted_through_objects() {
    let mut pair = rectangle(0.0, 1.0, 0.0, None);
    let mesh = |first_triangle, triangle_count| Mesh {
        first_face: 0,
        face_count: 0,
        first_triangle,
        triangle_count,
    };
    // an empty mesh between the two triangles
    pair.meshes = vec![mesh(0, 1), mesh(1, 0), mesh(1, 1)];
    let frame = frame(vec![rectangle(0.0, 1.0, -9.0, None), pair]);
    let world = super::world::World::new(&frame);
    let hit =
        |object, triangle| crate::accel::Hit { distance: 1.0, object, triangle, barycentric: [0.2, 0.2] };
    assert_eq!(world.id(&hit(0, 1)), [0, 1]);
    assert_eq!(world.id(&hit(1, 0)), [1, 0]);
    assert_eq!(world.id(&hit(1, 1)), [3, 0]);
}

#[test]
fn transforms_move_points_and_normals_and_mirrors_turn_triangles_back() {
    // (x, y, 0) goes to (±x, y, −0.75·(±x)): the normal is (0.6, 0, 0.8) = L; the second mirrors in x
    let tilt = affine([1.0, 0.0, -0.75], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let mirror = affine([-1.0, 0.0, 0.75], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    for transform in [tilt, mirror] {
        let mut wall = rectangle(0.0, 1.0, 0.0, Some(&material(1)));
        // the normals are the triangle's own, so that both ways must agree
        for normals in [None, Some([0.0, 0.0, 1.0])] {
            wall.normals = normals.map(|n| Attribute {
                values: Part::new(Normals(vec![n])),
                corners: Part::new(Corners(vec![[0; 3]; 2])),
            });
            let object = Object { geometry: Arc::new(wall.clone()), transform: Some(transform) };
            let frame = Frame { objects: vec![object] };
            let film = render_in_tiles(&frame, &shot(vec![light(Falloff::None)]), 3, 5).0;
            // N·L = 1
            assert_near(film.rgb[MIDDLE], sum(&[A, times(D, 1.0 / 0.8)]));
            assert_near(film.aovs.normal.unwrap()[MIDDLE], [0.6, 0.0, 0.8]);
        }
    }
}

fn affine(x: [f64; 3], y: [f64; 3], z: [f64; 3]) -> DAffine3 {
    DAffine3::from_cols(x.into(), y.into(), z.into(), DVec3::ZERO)
}

#[test]
fn a_pixel_is_the_mean_of_its_samples_whatever_the_tile() {
    let geometry = || {
        vec![
            rectangle(0.3, 0.7, 0.0, Some(&material(2))),
            rectangle(0.0, 0.3, 0.5, Some(&Material { d: 0.5, ..material(1) })),
        ]
    };
    let shot =
        Shot { size: [37, 21], samples: 5, filter: Filter::Triangle, ..shot(vec![light(Falloff::None)]) };
    let frame = frame(geometry());
    let (film, counts) = render_in_tiles(&frame, &shot, 21, 37);
    for (rows, columns) in [(1, 1), (8, 32), (3, 7), (21, 5)] {
        let (other, other_counts) = render_in_tiles(&frame, &shot, rows, columns);
        assert!(film == other && counts == other_counts, "{rows} × {columns} tiles");
    }
    // five samples and the ray through the centre
    assert_eq!(counts.camera, 37 * 21 * 6);
    assert!(counts.shadow > 0 && counts.mirrored == 0 && counts.refracted == 0);
}

#[test]
fn a_stopped_tile_says_so() {
    let frame = frame(vec![]);
    let shot = shot(vec![]);
    let aggregate = traced_scene(&frame);
    let scene = Scene::new(&aggregate, &frame, &shot);
    let mut film = Film::new(shot.size, false, shot.aovs);
    let mut bands = bands(&mut film, 8, 1.0);
    assert_eq!(trace_tile(&scene, &mut bands[0], 0..5, &mut TileBuffers::default(), &|| true), None);
}
