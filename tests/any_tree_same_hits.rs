//! A ray's hit is a function of the ray and the triangles alone, never of the tree.

mod rays;

use glam::Vec3;
use rays::{Mesh, all_hits, random_rays, soup, sphere};
use rentix::accel::{Aggregate, BruteForce, Quality, Ray, TracedObject, TracedScene, Tree, Width, validate};
use std::sync::Arc;

/// Batches, coherent or not, give the answers of single rays.
fn assert_batches_are_single_rays(scene: &TracedScene, rays: &[Ray], name: &str) {
    let singles: Vec<_> = rays.iter().map(|r| scene.closest(r, None)).collect();
    let mut hits = vec![None; rays.len()];
    scene.closest_batch(rays, &mut hits);
    assert_eq!(hits, singles, "{name}");
    let mut ends: Vec<f32> = singles
        .iter()
        .zip(0..)
        .map(|(h, i)| h.map_or(1.0, |h| if i % 2 == 0 { h.distance } else { h.distance.next_up() }))
        .collect();
    for end in ends.iter_mut().skip(3).step_by(11) {
        *end = f32::NAN;
    }
    let mut occluded = vec![false; rays.len()];
    scene.occluded_batch(rays, &ends, &mut occluded);
    let expected: Vec<bool> = rays.iter().zip(&ends).map(|(r, e)| scene.occluded(r, *e)).collect();
    assert_eq!(occluded, expected, "{name}");
}

#[test]
fn batches_give_the_answers_of_single_rays() {
    let mesh = soup(3000, 20);
    let one = mesh.scene(Quality::Fastest);
    let turned = glam::DAffine3::from_rotation_y(0.7);
    let three = TracedScene::new(
        [None, Some(turned), None]
            .iter()
            .zip(0..)
            .map(|(t, seed)| TracedObject::new(soup(500, seed).tree(Quality::Fastest), t.as_ref()))
            .collect(),
    );
    // from the front, and from where the largest component of directions is now one, now another
    let eyes = [Vec3::new(0.3, 0.2, 3.0), Vec3::splat(1.7)];
    for (scene, &width) in [one, three].iter().flat_map(|s| Width::available().iter().map(move |w| (s, w))) {
        let scene = scene.clone().with_width(width);
        for size in [[160, 90], [5, 3], [1, 1]] {
            for eye in eyes {
                let rays = rays::camera_rays(eye, Vec3::ZERO, 60.0, size);
                assert_batches_are_single_rays(&scene, &rays, "camera");
            }
        }
        assert_batches_are_single_rays(&scene, &random_rays(3000, 21), "random");
        let light = Vec3::new(0.5, 4.0, 1.0);
        let shadow: Vec<Ray> = random_rays(3000, 22)
            .into_iter()
            .map(|r| Ray { origin: r.origin * 0.2, direction: light - r.origin * 0.2 })
            .collect();
        assert_batches_are_single_rays(&scene, &shadow, "shadow");
    }
}

fn assert_same(mesh: &Mesh, rays: &[Ray], scene: &TracedScene, name: &str) {
    let brute = BruteForce::new(&mesh.positions, &mesh.triangles);
    for ray in rays {
        let hits = all_hits(&brute, ray);
        assert_eq!(all_hits(scene, ray), hits, "{name}: {ray:?}");
        for end in [0.0, f32::NAN, f32::INFINITY]
            .into_iter()
            .chain(hits.iter().flat_map(|h| [h.distance, h.distance.next_up()]))
        {
            assert_eq!(scene.occluded(ray, end), brute.occluded(ray, end), "{name}: {ray:?} up to {end}");
        }
    }
}

#[test]
fn every_quality_and_width_gives_the_hits_of_brute_force_in_their_order() {
    let mesh = soup(2000, 1);
    let rays = random_rays(400, 2);
    for quality in Quality::ALL {
        let scene = mesh.scene(quality);
        for &width in Width::available() {
            assert_same(&mesh, &rays, &scene.clone().with_width(width), &format!("{quality:?} {width:?}"));
        }
    }
}

#[test]
fn coincident_and_coplanar_triangles_come_in_the_order_of_their_numbers() {
    let mut mesh = Mesh::default();
    let (a, b, c, d) = (Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0));
    for _ in 0..50 {
        mesh.push([a, b, c]);
        mesh.push([c, b, d]);
        mesh.push([b, a, c]);
    }
    let down = Ray { origin: Vec3::new(0.25, 0.25, 1.0), direction: Vec3::NEG_Z };
    let expected: Vec<u32> = (0..150).filter(|i| i % 3 != 1).collect();
    for quality in Quality::ALL {
        let hits = all_hits(&mesh.scene(quality), &down);
        assert_eq!(hits.iter().map(|h| h.triangle).collect::<Vec<_>>(), expected, "{quality:?}");
        assert!(hits.iter().all(|h| h.distance == hits[0].distance));
        let rays = rays::camera_rays(Vec3::new(0.4, 0.3, 1.0), Vec3::new(0.4, 0.3, 0.0), 60.0, [40, 40]);
        assert_batches_are_single_rays(&mesh.scene(quality), &rays, &format!("{quality:?}"));
    }
    // on the diagonal, which all of them share, every one is hit
    let diagonal = Ray { origin: Vec3::new(0.5, 0.5, 1.0), direction: Vec3::NEG_Z };
    assert_eq!(all_hits(&mesh.scene(Quality::Fastest), &diagonal).len(), 150);
}

#[test]
fn triangles_without_area_are_never_hit_and_change_nothing() {
    let ball = sphere(3);
    let mut mesh = ball.clone();
    for i in 0..200 {
        let [a, b, _] = ball.corners(i);
        mesh.push([a, b, a]);
        mesh.push([a * 2.0, b * 2.0, a + b]);
        mesh.push([a, a, a]);
    }
    let rays = random_rays(2000, 3);
    let (with, without) = (mesh.scene(Quality::Fastest), ball.scene(Quality::Fastest));
    for ray in &rays {
        assert_eq!(all_hits(&with, ray), all_hits(&without, ray), "{ray:?}");
    }
}

#[test]
fn small_flat_huge_tiny_and_broken_meshes_are_traced() {
    let rays = random_rays(200, 4);
    let one = soup(1, 5);
    let mut flat = soup(500, 6);
    for p in &mut flat.positions {
        p[1] = 0.25;
    }
    let mut broken = soup(300, 7);
    for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
        broken.positions[17 + 40 * i][i] = bad;
    }
    let mut huge = soup(300, 8);
    let mut tiny = huge.clone();
    huge.positions.iter_mut().flatten().for_each(|x| *x *= 3e38);
    tiny.positions.iter_mut().flatten().for_each(|x| *x *= 1e-38);
    let mut degenerate = Mesh::default();
    for _ in 0..100 {
        degenerate.push([Vec3::ONE; 3]);
    }
    for (name, mesh) in [
        ("empty", Mesh::default()),
        ("one", one),
        ("flat", flat),
        ("broken", broken),
        ("huge", huge),
        ("tiny", tiny),
        ("degenerate", degenerate),
    ] {
        for quality in [Quality::Fastest, Quality::Medium, Quality::Slow] {
            assert_same(&mesh, &rays, &mesh.scene(quality), name);
        }
    }
}

#[test]
fn rays_that_are_not_finite_or_have_no_direction_hit_nothing() {
    let scene = sphere(2).scene(Quality::Fastest);
    let brute = BruteForce::new(&sphere(2).positions, &sphere(2).triangles);
    let odd = [0.0, -0.0, 1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE];
    let vectors = || (0..512).map(|i| Vec3::new(odd[i % 8], odd[i / 8 % 8], odd[i / 64]));
    for width in Width::available() {
        let scene = scene.clone().with_width(*width);
        assert_eq!(scene.closest(&Ray { origin: Vec3::ZERO, direction: Vec3::ZERO }, None), None);
        for direction in vectors() {
            for origin in vectors().step_by(7) {
                let ray = Ray { origin, direction };
                assert_eq!(scene.closest(&ray, None), brute.closest(&ray, None), "{ray:?}");
                if !direction.is_finite() {
                    assert_eq!(scene.closest(&ray, None), None, "{ray:?}");
                }
            }
        }
    }
}

#[test]
fn many_coincident_triangles_build_in_time_and_in_bounded_depth() {
    let mut mesh = Mesh::default();
    for _ in 0..200_000 {
        mesh.push([Vec3::ZERO, Vec3::X, Vec3::Y]);
    }
    let start = std::time::Instant::now();
    for quality in [Quality::Fastest, Quality::VeryFast] {
        let tree = Tree::build(&mesh.positions, &mesh.triangles, quality);
        assert_eq!(validate(&tree, &mesh.positions, &mesh.triangles), Ok(()));
    }
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn the_tree_is_the_same_for_any_number_of_threads() {
    let mesh = soup(10_000, 9);
    for quality in Quality::ALL {
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| format!("{:?}", Tree::build(&mesh.positions, &mesh.triangles, quality)))
        };
        assert!(build(1) == build(3), "{quality:?}");
    }
}

#[test]
fn objects_give_the_hits_of_one_mesh() {
    let whole = soup(900, 10);
    let objects = whole
        .triangles
        .chunks(30)
        .map(|t| TracedObject::new(Arc::new(Tree::build(&whole.positions, t, Quality::Fastest)), None))
        .collect();
    let (parts, one) = (TracedScene::new(objects), whole.scene(Quality::Fastest));
    for ray in random_rays(1000, 11) {
        let (mut hits, whole_hits) = (all_hits(&parts, &ray), all_hits(&one, &ray));
        for h in &mut hits {
            assert_eq!(parts.order(h).primitive, 30 * h.object + h.triangle);
            (h.triangle, h.object) = (30 * h.object + h.triangle, 0);
        }
        assert_eq!(hits, whole_hits, "{ray:?}");
        let end = whole_hits.first().map_or(1.0, |h| h.distance);
        assert_eq!(parts.occluded(&ray, end.next_up()), one.occluded(&ray, end.next_up()));
        assert_eq!(parts.occluded(&ray, end), one.occluded(&ray, end));
    }
}
