//! The auto camera and the auto light (CONTRACT 5): where they stand follows from what is in the sequence.

use super::{Layer, Settings};
use crate::math::{Bounds, DVec3, Vec3};
use crate::scene::{Camera, Falloff, Light, Object};
use glam::DQuat;

/// Most frames that are looked at.
const FRAMES_SCANNED: usize = 32;
/// How much wider than the geometry the box is on every side, of its diagonal.
const ENLARGED: f64 = 0.05;

/// The files of a layer that the auto camera looks at: spread evenly, first and last among them.
pub fn scanned(layer: &Layer) -> impl Iterator<Item = usize> {
    let n = layer.files.len();
    let count = n.min(FRAMES_SCANNED);
    (0..count).map(move |i| if count == 1 { 0 } else { i * (n - 1) / (count - 1) })
}

/// The box of a layer under each key of its transform.
pub fn placed(layer: &Layer, bounds: &Bounds) -> Bounds {
    let Some(track) = &layer.placed else { return *bounds };
    let mut all = Bounds::EMPTY;
    if !bounds.is_empty() {
        for matrix in track.matrices() {
            for corner in bounds.corners() {
                all.add(matrix.transform_point3(corner));
            }
        }
    }
    all
}

/// The camera that sees a box, enlarged by 5 % of its diagonal on every side, whole.
pub fn camera(bounds: &Bounds, settings: &Settings) -> Camera {
    camera_around(bounds, settings, ENLARGED)
}

/// The camera that sees a box, enlarged by a share of its diagonal on every side, whole.
pub fn camera_around(bounds: &Bounds, settings: &Settings, enlarged: f64) -> Camera {
    let bounds = if bounds.is_empty() { Bounds { min: DVec3::ZERO, max: DVec3::ZERO } } else { *bounds };
    let wider = DVec3::splat(enlarged * (bounds.max - bounds.min).length());
    let (min, max) = (bounds.min - wider, bounds.max + wider);
    let look_at = (min + max) * 0.5;
    let half_diagonal = 0.5 * (max - min).length();
    let r = if half_diagonal > 0.0 { half_diagonal } else { 1.0 };
    let half_vertical = 0.5 * settings.fov_deg.to_radians();
    let half_horizontal = (half_vertical.tan() * settings.aspect()).atan();
    let up = settings.up.normalize_or(DVec3::Y);
    // for z up this turns (x, y, z) to (x, −z, y)
    let turn = if up == DVec3::Y { DQuat::IDENTITY } else { DQuat::from_rotation_arc(DVec3::Y, up) };
    let direction = turn * DVec3::new(0.5, 0.35, 1.0).normalize();
    let distance = 1.05 * r / half_vertical.min(half_horizontal).sin();
    Camera { eye: look_at + distance * direction, look_at, up: settings.up, fov_deg: settings.fov_deg }
}

/// Where light leaves a frame of its own: the area-weighted centroid of its triangles with Ke > 0, and their mean Ke,
/// area-weighted too; sums in f64 in file order. None where nothing glows.
pub fn glow(objects: &[Object]) -> Option<(DVec3, DVec3)> {
    let (mut area_sum, mut centroid_sum, mut ke_sum) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for object in objects {
        let g = &object.geometry;
        let runs = &g.material_runs.0;
        for (i, run) in runs.iter().enumerate() {
            let Some(material) = g.materials.get(run[1] as usize) else { continue };
            let ke = Vec3::from_array(material.ke);
            if ke.max_element() <= 0.0 {
                continue;
            }
            let end = runs.get(i + 1).map_or(g.triangles.0.len(), |next| next[0] as usize);
            for triangle in &g.triangles.0[run[0] as usize..end] {
                let [a, b, c] = triangle.map(|v| {
                    let p = Vec3::from_array(g.positions.0[v as usize]).as_dvec3();
                    object.transform.map_or(p, |t| t.transform_point3(p))
                });
                let area = 0.5 * (b - a).cross(c - a).length();
                area_sum += area;
                centroid_sum += area * (a + b + c) / 3.0;
                ke_sum += area * ke.as_dvec3();
            }
        }
    }
    (area_sum > 0.0).then(|| (centroid_sum / area_sum, ke_sum / area_sum))
}

/// The light of a sequence whose first frame is seen by this camera, and glows as given.
pub fn light(first: &Camera, glow: Option<(DVec3, DVec3)>) -> Light {
    let rho = (first.look_at - first.eye).length() * (0.5 * first.fov_deg.to_radians()).sin();
    let (position, color) = if let Some((centroid, ke)) = glow {
        let towards = (first.look_at - centroid).normalize_or_zero();
        (centroid + 0.02 * rho * towards, ke / ke.max_element())
    } else {
        let (right, up, _) = first.axes();
        (first.eye + rho * (up - right), DVec3::ONE)
    };
    Light::Point {
        position: position.as_vec3(),
        color: color.as_vec3(),
        intensity: 1.0,
        falloff: Falloff::None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::options::Options;

    #[test]
    fn the_camera_by_hand() {
        // a cube from −1 to 1: diagonal 2√3, enlarged by 0.1·√3 a side: half diagonal √3·(1 + 0.1·√3)
        let settings = Settings::new(&Options { size: Some([100, 100]), ..Options::default() }).unwrap();
        let bounds = Bounds { min: DVec3::NEG_ONE, max: DVec3::ONE };
        let c = camera(&bounds, &settings);
        let r = 3f64.sqrt() * (1.0 + 0.1 * 3f64.sqrt());
        let distance = 1.05 * r / 20f64.to_radians().sin();
        assert!((c.eye.length() - distance).abs() < 1e-9 && c.look_at.length() < 1e-12);
        assert!((c.eye.normalize() - DVec3::new(0.5, 0.35, 1.0).normalize()).length() < 1e-12);
        let z = Settings { up: DVec3::Z, ..settings.clone() };
        let turned = DVec3::new(0.5, -1.0, 0.35).normalize();
        assert!((camera(&bounds, &z).eye.normalize() - turned).length() < 1e-12);
        // half as wide as high: the horizontal angle decides
        let narrow = Settings { size: [50, 100], ..settings };
        let half = (20f64.to_radians().tan() * 0.5).atan();
        assert!((camera(&bounds, &narrow).eye.length() - 1.05 * r / half.sin()).abs() < 1e-9);
    }

    #[test]
    fn the_light_by_hand() {
        let camera =
            Camera { eye: DVec3::new(0.0, 0.0, 4.0), look_at: DVec3::ZERO, up: DVec3::Y, fov_deg: 60.0 };
        // ρ = 4 · sin 30° = 2; right is x, up is y
        let Light::Point { position, color, .. } = light(&camera, None) else { panic!() };
        assert!((position - Vec3::new(-2.0, 2.0, 4.0)).length() < 1e-6 && color == Vec3::ONE);
        let glow = Some((DVec3::new(0.0, 2.0, 0.0), DVec3::new(17.0, 12.0, 4.0)));
        let Light::Point { position, color, .. } = light(&camera, glow) else { panic!() };
        assert!((position - Vec3::new(0.0, 1.96, 0.0)).length() < 1e-6);
        assert!((color - Vec3::new(1.0, 12.0 / 17.0, 4.0 / 17.0)).length() < 1e-6);
    }
}
