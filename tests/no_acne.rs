//! A surface does not shadow itself, at any scale and anywhere: with the light in the eye everything that is seen is
//! lit.

use rentix::device::cpu::CpuDevice;
use rentix::device::{Device, Stop};
use rentix::math::{DVec3, Vec3};
use rentix::plan::{Wishes, plan_frame};
use rentix::scene::{
    Aov, AovSet, Background, Camera, Faces, Falloff, Filter, Frame, Geometry, Light, Material, MaterialRuns,
    Mesh, Object, Part, Positions, Shot, Triangles,
};
use std::sync::Arc;

fn frame(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Frame {
    let count = triangles.len() as u32;
    let geometry = Geometry {
        positions: Part::new(Positions(positions)),
        faces: Part::new(Faces {
            counts: vec![3; triangles.len()],
            corners: triangles.as_flattened().to_vec(),
        }),
        triangles: Part::new(Triangles(triangles)),
        texcoords: None,
        normals: None,
        colors: None,
        material_runs: Part::new(MaterialRuns(vec![[0, 0]])),
        materials: vec![Part::new(Material::default())],
        meshes: vec![Mesh { first_face: 0, face_count: count, first_triangle: 0, triangle_count: count }],
    };
    Frame { objects: vec![Object { geometry: Arc::new(geometry), transform: None }] }
}

/// How many of the pixels that show something are dark, and how many show something.
fn dark_pixels(frame: &Frame, eye: DVec3, look_at: DVec3) -> (usize, usize) {
    let mut aovs = AovSet::default();
    aovs.insert(Aov::Depth);
    let light =
        Light::Point { position: eye.as_vec3(), color: Vec3::ONE, intensity: 1.0, falloff: Falloff::None };
    let shot = Shot {
        camera: Camera {
            eye: eye.as_vec3().as_dvec3(),
            look_at,
            up: DVec3::new(0.1, 1.0, 0.2),
            fov_deg: 40.0,
        },
        lights: vec![light],
        ambient: Vec3::ZERO,
        background: Background::Color(Vec3::ZERO),
        size: [320, 240],
        samples: 1,
        filter: Filter::Box,
        depth: 0,
        seed: 0,
        prune: 0.0,
        alpha: false,
        aovs,
    };
    let mut device = CpuDevice::new(1, 1 << 30).unwrap();
    let plan = plan_frame(frame, device.residency(), &Wishes::default());
    device.apply(&plan, frame).unwrap();
    let film = device.trace(frame, &shot, &Stop::default()).unwrap().film.into_film();
    let depth = film.aovs.depth.unwrap();
    let seen = depth.iter().filter(|d| d.is_finite()).count();
    let dark = depth.iter().zip(&*film.rgb).filter(|(d, rgb)| d.is_finite() && rgb[0] == 0.0).count();
    (dark, seen)
}

fn sphere(scale: f64, moved: DVec3) -> Frame {
    let (rings, sectors) = (64_u32, 96_u32);
    let mut positions = Vec::new();
    for i in 0..=rings {
        let theta = std::f64::consts::PI * f64::from(i) / f64::from(rings);
        for j in 0..sectors {
            let phi = std::f64::consts::TAU * f64::from(j) / f64::from(sectors);
            let p = DVec3::new(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin());
            positions.push((p * scale + moved).as_vec3().to_array());
        }
    }
    let quads = (0..rings)
        .flat_map(|i| (0..sectors).map(move |j| (i * sectors + j, i * sectors + (j + 1) % sectors)));
    let triangles = quads.flat_map(|(a, b)| [[a, a + sectors, b + sectors], [a, b + sectors, b]]).collect();
    frame(positions, triangles)
}

#[test]
fn a_sphere_at_any_scale_and_anywhere() {
    for (scale, moved) in [
        (1.0, DVec3::ZERO),
        (1e-4, DVec3::ZERO),
        (1e4, DVec3::ZERO),
        (1e-6, DVec3::new(0.0, 1e-6, 0.0)),
        (3000.0, DVec3::new(148_376.0, 1_234.0, -223_423.0)),
        (10.0, DVec3::new(1_000.0, -2_000.0, 500.0)),
    ] {
        let eye = moved + DVec3::new(0.6, 1.1, 2.6) * scale;
        let (dark, seen) = dark_pixels(&sphere(scale, moved), eye, moved);
        assert!(seen > 20_000, "{seen} pixels show it");
        assert_eq!(dark, 0, "of {seen} pixels at scale {scale} moved by {moved}");
    }
}

#[test]
fn a_floor_whose_height_is_known_better_than_its_extent() {
    // the corners say that y is known to 1e-16; what a ray on it can tell is 1e-7 of the extent
    for y in [0.0, 1e-8, -3e-9, 1e-16, 1e-30] {
        for extent in [0.01_f32, 2.0, 5000.0] {
            let corner = |x: f32, z: f32, y: f32| [x * extent, y, z * extent];
            let positions = vec![
                corner(-1.0, -1.0, y),
                corner(1.0, -1.0, -y),
                corner(1.0, 1.0, 0.5 * y),
                corner(-1.0, 1.0, y),
            ];
            let floor = frame(positions, vec![[0, 2, 1], [0, 3, 2]]);
            for direction in
                [DVec3::new(0.3, 0.9, 1.4), DVec3::new(-1.7, 0.2, 0.4), DVec3::new(0.01, 2.5, 0.02)]
            {
                let (dark, seen) = dark_pixels(&floor, direction * f64::from(extent), DVec3::ZERO);
                assert!(seen > 1_000, "{seen} pixels show it");
                assert_eq!(dark, 0, "of {seen} pixels: y {y}, extent {extent}, from {direction}");
            }
        }
    }
}

#[test]
fn sheets_that_lie_on_each_other() {
    // ten layers 1e-16 apart, as paper that is folded
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for layer in 0..10 {
        let z = layer as f32 * 3e-17 - 1e-16;
        let first = positions.len() as u32;
        positions.extend([[-0.8, -0.7, z], [0.9, -0.6, -z], [0.1, 0.9 - 0.01 * layer as f32, z]]);
        triangles.push([first, first + 1, first + 2]);
    }
    let (dark, seen) = dark_pixels(&frame(positions, triangles), DVec3::new(0.5, 0.7, 3.0), DVec3::ZERO);
    assert!(seen > 10_000);
    assert_eq!(dark, 0, "of {seen} pixels");
}
