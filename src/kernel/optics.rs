//! Mirrors and glass: directions, and how much is mirrored.

use crate::math::Vec3;

/// The mirrored direction of the unit vector towards the viewer; unit.
pub fn mirrored(view: Vec3, n: Vec3) -> Vec3 {
    (n * (2.0 * n.dot(view)) - view).normalize_or(n)
}

/// A ray behind the surface that bends it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refracted {
    /// Where it goes; unit.
    pub direction: Vec3,
    /// Cosine of its angle to the normal.
    pub cosine: f32,
}

/// Snell's law from a medium of density n1 into one of n2; None where the reflection is total.
pub fn refracted(view: Vec3, n: Vec3, n1: f32, n2: f32) -> Option<Refracted> {
    let eta = n1 / n2;
    let c = n.dot(view);
    let cosine_squared = 1.0 - eta * eta * (1.0 - c * c);
    if cosine_squared < 0.0 {
        return None;
    }
    let cosine = cosine_squared.sqrt();
    let direction = (n * (eta * c - cosine) - view * eta).normalize_or(-view);
    Some(Refracted { direction, cosine })
}

/// Schlick's approximation of the Fresnel equations: F0 + (1 − F0)(1 − c)^5, c clamped to [0, 1] (Christophe Schlick,
/// "An Inexpensive BRDF Model for Physically-based Rendering", 1994).
pub fn schlick(f0: Vec3, c: f32) -> Vec3 {
    let x = 1.0 - c.clamp(0.0, 1.0);
    let x2 = x * x;
    f0 + (1.0 - f0) * (x2 * x2 * x)
}

/// What a border between two densities mirrors of light that meets it upright.
pub fn reflectance_upright(n1: f32, n2: f32) -> f32 {
    let r = (n1 - n2) / (n1 + n2);
    r * r
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 30° off the normal +z, towards +x.
    const VIEW: Vec3 = Vec3::new(0.5, 0.0, 0.866_025_4);

    #[test]
    fn mirrors_turn_the_viewer_around_the_normal() {
        assert!((mirrored(VIEW, Vec3::Z) - Vec3::new(-0.5, 0.0, 0.866_025_4)).length() < 1e-6);
        assert_eq!(mirrored(Vec3::Z, Vec3::Z), Vec3::Z);
    }

    #[test]
    fn glass_bends_by_snells_law() {
        // sin 30° / 1.5 = 1/3, its cosine √8/3
        let into = refracted(VIEW, Vec3::Z, 1.0, 1.5).unwrap();
        assert!((into.direction - Vec3::new(-1.0 / 3.0, 0.0, -0.942_809)).length() < 1e-6);
        assert!((into.cosine - 0.942_809).abs() < 1e-6);
        // out of it: sin 30° · 1.5 = 3/4, its cosine √7/4
        let out = refracted(VIEW, Vec3::Z, 1.5, 1.0).unwrap();
        assert!((out.direction - Vec3::new(-0.75, 0.0, -0.661_437_8)).length() < 1e-6);
        // out of a density of 2.1 nothing comes: 1.05 > 1
        assert_eq!(refracted(VIEW, Vec3::Z, 2.1, 1.0), None);
        // equal densities do not bend
        assert!((refracted(VIEW, Vec3::Z, 1.3, 1.3).unwrap().direction + VIEW).length() < 1e-6);
    }

    #[test]
    fn what_is_mirrored_grows_towards_the_horizon() {
        // 0.04 + 0.96 · (1/2)^5
        assert!((schlick(Vec3::splat(0.04), 0.5) - Vec3::splat(0.07)).length() < 1e-7);
        assert_eq!(schlick(Vec3::splat(0.04), 1.5), Vec3::splat(0.04));
        assert_eq!(schlick(Vec3::splat(0.04), -1.0), Vec3::ONE);
        assert!((reflectance_upright(1.0, 1.5) - 0.04).abs() < 1e-7);
    }
}
