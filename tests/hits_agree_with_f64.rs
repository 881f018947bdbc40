//! Traced hits are those of brute force in f64, but for float ties: on soups and on scenes, moved and scaled.

mod rays;

use glam::{DAffine3, DQuat, DVec3, Vec3};
use rays::{Mesh, camera_rays, disagreement, load, place, random_rays, reference, soup};
use rentix::accel::{Aggregate, Quality, Ray, TracedObject, TracedScene};

/// Where a mesh may stand: scale, then translation.
const PLACES: [(f64, DVec3); 4] = [
    (1.0, DVec3::ZERO),
    (1.0, DVec3::new(148376.0, 1234.0, -223423.0)),
    (1e-4, DVec3::ZERO),
    (1e4, DVec3::ZERO),
];

fn assert_agrees(mesh: &Mesh, scene: &impl Aggregate, rays: &[Ray], name: &str) {
    let references = reference(mesh, rays);
    let wrong: Vec<String> = rays
        .iter()
        .zip(&references)
        .filter_map(|(ray, r)| disagreement(mesh, ray, scene.closest(ray, None).as_ref(), r.as_ref()))
        .collect();
    assert!(wrong.is_empty(), "{name}: {} of {} rays, as {}", wrong.len(), rays.len(), wrong[0]);
    assert!(references.iter().flatten().count() * 20 > rays.len(), "{name}: too few hits to tell");
}

fn pictures(path: &str, eye: Vec3, look_at: Vec3, size: [usize; 2]) {
    let Some(mesh) = load(path) else { return };
    for (scale, by) in PLACES {
        let placed = mesh.placed(scale, by);
        let rays = camera_rays(place(eye, scale, by), place(look_at, scale, by), 40.0, size);
        assert_agrees(&placed, &placed.scene(Quality::Fastest), &rays, &format!("{path} x {scale} + {by}"));
    }
}

const BUNNY: (&str, Vec3, Vec3) =
    ("bunny/stanford-bunny.obj", Vec3::new(-0.02, 0.12, 0.35), Vec3::new(-0.02, 0.11, 0.0));
const SIBENIK: (&str, Vec3, Vec3) =
    ("sibenik/sibenik.obj", Vec3::new(-15.0, -10.0, 0.0), Vec3::new(0.0, -8.0, 0.5));
const CONFERENCE: (&str, Vec3, Vec3) =
    ("conference/conference.obj", Vec3::new(1000.0, 400.0, 500.0), Vec3::new(0.0, 150.0, -200.0));

#[test]
fn small_pictures_of_scenes() {
    for (path, eye, look_at) in [BUNNY, SIBENIK, CONFERENCE] {
        pictures(path, eye, look_at, [18, 10]);
    }
}

#[test]
#[ignore = "one to three minutes; RENTIX_SCENES=… cargo test --release --test hits_agree_with_f64 -- --ignored"]
fn larger_pictures_of_scenes() {
    for (path, eye, look_at) in [BUNNY, SIBENIK, CONFERENCE] {
        pictures(path, eye, look_at, [96, 54]);
    }
}

#[test]
fn soups() {
    for seed in 0..4 {
        let mesh = soup(1500, seed);
        let rays = random_rays(1500, 100 + seed);
        for (scale, by) in PLACES {
            let placed = mesh.placed(scale, by);
            let rays: Vec<Ray> =
                rays.iter().map(|r| Ray { origin: place(r.origin, scale, by), ..*r }).collect();
            assert_agrees(
                &placed,
                &placed.scene(Quality::Fastest),
                &rays,
                &format!("soup {seed} x {scale} + {by}"),
            );
        }
    }
}

#[test]
fn placed_objects() {
    let mut random = rays::Random(7);
    let parts: Vec<Mesh> = (0..20).map(|seed| soup(80, 50 + seed)).collect();
    let mut world = Mesh::default();
    let mut objects = Vec::new();
    for (i, part) in parts.iter().enumerate() {
        let turn = DQuat::from_axis_angle(random.direction().as_dvec3(), 6.0 * f64::from(random.unit()));
        let scale = random.cube().as_dvec3() * [1.0, 0.5, 0.01][i % 3];
        let by = 2.0 * random.cube().as_dvec3();
        let transform = (i % 5 != 0).then(|| DAffine3::from_scale_rotation_translation(scale, turn, by));
        for t in 0..part.triangles.len() as u32 {
            let corners = part.corners(t);
            world.push(
                transform.map_or(corners, |m| corners.map(|c| m.transform_point3(c.as_dvec3()).as_vec3())),
            );
        }
        objects.push(TracedObject::new(part.tree(Quality::Fastest), transform.as_ref()));
    }
    let scene = Counted(TracedScene::new(objects));
    assert_agrees(&world, &scene, &random_rays(4000, 8), "objects");
}

/// Triangles by their number in the whole scene, as the mesh of all objects has them.
struct Counted(TracedScene);

impl Aggregate for Counted {
    fn closest(&self, ray: &Ray, after: Option<rentix::accel::HitOrder>) -> Option<rentix::accel::Hit> {
        let hit = self.0.closest(ray, after)?;
        Some(rentix::accel::Hit { triangle: self.0.order(&hit).primitive, ..hit })
    }
    fn occluded(&self, ray: &Ray, end: f32) -> bool {
        self.0.occluded(ray, end)
    }
    fn order(&self, hit: &rentix::accel::Hit) -> rentix::accel::HitOrder {
        rentix::accel::HitOrder { distance: hit.distance, primitive: hit.triangle }
    }
}
