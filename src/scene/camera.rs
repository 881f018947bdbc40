//! The pinhole camera of CONTRACT 5.

use super::part::PartHasher;
use crate::math::DVec3;

/// A pinhole camera; right-handed, looking from `eye` to `look_at`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub eye: DVec3,
    /// What it looks at.
    pub look_at: DVec3,
    /// What is up; need be neither unit nor perpendicular.
    pub up: DVec3,
    /// Vertical field of view, degrees, in (0, 180).
    pub fov_deg: f64,
}

impl Camera {
    /// Unit vectors to the right, up and backwards (towards the viewer).
    pub fn axes(&self) -> (DVec3, DVec3, DVec3) {
        let back = (self.eye - self.look_at).normalize_or(DVec3::Z);
        let mut right = self.up.cross(back);
        if right.length_squared() < 1e-20 * self.up.length_squared() {
            // up is along the line of sight: any perpendicular serves
            right = back.any_orthogonal_vector();
        }
        let right = right.normalize_or(DVec3::X);
        (right, back.cross(right), back)
    }

    /// Adds it to a fingerprint.
    pub fn hash_into(&self, h: &mut PartHasher) {
        for v in [self.eye, self.look_at, self.up] {
            for x in v.to_array() {
                h.f64(x);
            }
        }
        h.f64(self.fov_deg);
    }
}
