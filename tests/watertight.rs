//! No ray leaks through a closed surface, and no ray that leaves a surface meets it again.

mod rays;

use glam::{DVec3, Vec3};
use rays::{Mesh, Random, place, sphere};
use rentix::accel::{Aggregate, Quality, Ray, hit_point, magnitude, offset_origin};

const PLACES: [(f64, DVec3); 5] = [
    (1.0, DVec3::ZERO),
    (100.0, DVec3::new(148376.0, 1234.0, -223423.0)),
    (1e-4, DVec3::ZERO),
    (1e4, DVec3::ZERO),
    (37.3, DVec3::new(-1000.0, 3.0, 0.1)),
];

/// A point on an edge of a random triangle, often a corner.
fn on_an_edge(mesh: &Mesh, random: &mut Random) -> (u32, Vec3) {
    let triangle = random.below(mesh.triangles.len()) as u32;
    let corners = mesh.corners(triangle);
    let k = random.below(3);
    let s = if random.below(2) == 0 { 0.0 } else { random.unit() };
    (triangle, corners[k].lerp(corners[(k + 1) % 3], s))
}

fn no_ray_leaks_out_of_a_sphere(rays: usize) {
    for (i, (scale, by)) in PLACES.into_iter().enumerate() {
        let mesh = sphere(5).placed(scale, by);
        let scene = mesh.scene(Quality::Fastest);
        let mut random = Random(i as u64);
        for k in 0..rays / PLACES.len() {
            let (_, target) = on_an_edge(&mesh, &mut random);
            // from anywhere inside, often very near to the surface or in the middle
            let inwards = place(Vec3::ZERO, scale, by) - target;
            let origin = match k % 3 {
                0 => place(random.direction() * (0.95 * random.unit()), scale, by),
                1 => target + inwards * (0.02 + random.unit() * 0.05),
                _ => place(Vec3::ZERO, scale, by),
            };
            let ray = Ray { origin, direction: target - origin };
            assert!(scene.closest(&ray, None).is_some(), "x {scale} + {by}: {ray:?} to {target}");
        }
    }
}

fn no_ray_leaks_through_a_floor(rays: usize) {
    for (i, by) in PLACES.map(|(_, by)| by).into_iter().enumerate() {
        // squares of 100 in the planes z = 0, y = 0, x = 0 in turn
        let axis = i % 3;
        let point = |x: i32, y: i32| {
            let p = [[0.0, x as f32, y as f32], [x as f32, 0.0, y as f32], [x as f32, y as f32, 0.0]][axis];
            place(Vec3::from(p), 100.0, by).to_array()
        };
        let mut mesh = Mesh::default();
        for y in -6..=6 {
            mesh.positions.extend((-6..=6).map(|x| point(x, y)));
        }
        for y in 0..12_u32 {
            for x in 0..12_u32 {
                let a = 13 * y + x;
                mesh.triangles.extend([[a, a + 1, a + 14], [a, a + 14, a + 13]]);
            }
        }
        let scene = mesh.scene(Quality::Fastest);
        let mut random = Random(100 + i as u64);
        let inside = |p: Vec3| (0..3).all(|k| k == axis || (f64::from(p[k]) - by[k]).abs() < 500.0);
        for k in 0..rays / PLACES.len() {
            let (_, target) = on_an_edge(&mesh, &mut random);
            let (_, near) = on_an_edge(&mesh, &mut random);
            let mut origin = near + random.cube() * [0.01, 1.0, 30.0][k % 3];
            origin[axis] =
                (by[axis] + f64::from([0.01, 0.3, 20.0, 300.0][k % 4] * (0.5 + random.unit()))) as f32;
            let ray = Ray { origin, direction: (target - origin) * random.unit().max(1e-3) };
            let at_plane = origin[axis] - by[axis] as f32;
            if inside(target) && at_plane != 0.0 {
                assert!(scene.closest(&ray, None).is_some(), "+ {by}: {ray:?} to {target}");
            }
        }
    }
}

#[test]
fn no_ray_leaks() {
    no_ray_leaks_out_of_a_sphere(200_000);
    no_ray_leaks_through_a_floor(200_000);
}

#[test]
#[ignore = "a million rays; cargo test --release --test watertight -- --ignored"]
fn no_ray_of_a_million_leaks() {
    no_ray_leaks_out_of_a_sphere(1_000_000);
    no_ray_leaks_through_a_floor(1_000_000);
}

#[test]
fn a_ray_that_leaves_a_convex_body_meets_nothing_and_one_that_enters_it_does() {
    for (i, (scale, by)) in PLACES.into_iter().enumerate() {
        // far from the origin a body must be large for its distance: f32 must not dent it, and rays start 4e-6 of the
        // distance off its surface
        let mesh = sphere(if by == DVec3::ZERO { 4 } else { 1 }).placed(scale, by);
        let scene = mesh.scene(Quality::Fastest);
        let mut random = Random(200 + i as u64);
        let mut hits = 0;
        for _ in 0..40_000 {
            let origin = place(random.direction() * (1.5 + 10.0 * random.unit()), scale, by);
            let target = place(random.direction() * 0.8, scale, by);
            let Some(hit) = scene.closest(&Ray { origin, direction: (target - origin).normalize() }, None)
            else {
                continue;
            };
            hits += 1;
            let corners = mesh.corners(hit.triangle);
            let [a, b, c] = corners.map(|c| c.as_dvec3());
            let normal = (b - a).cross(c - a).normalize().as_vec3();
            let point = hit_point(&corners, hit.barycentric);
            let out = random.direction();
            let out = if out.dot(normal) < 0.0 { -out } else { out };
            let outside = offset_origin(point, normal, magnitude(&corners));
            let inside = offset_origin(point, -normal, magnitude(&corners));
            let leaving = Ray { origin: outside, direction: out };
            assert_eq!(scene.closest(&leaving, None), None, "x {scale} + {by}: {leaving:?} off {corners:?}");
            let entering = Ray { origin: inside, direction: -out };
            assert!(
                scene.closest(&entering, None).is_some(),
                "x {scale} + {by}: {entering:?} into {corners:?}"
            );
        }
        assert!(hits > 20_000, "{hits}");
    }
}
