//! Camera rays.

use crate::accel::Ray;
use crate::math::Vec3;
use crate::scene::Camera;
use bytemuck::{Pod, Zeroable};

/// What a camera ray is made of; directions before normalisation.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct CameraConstants {
    /// Where all rays start.
    pub eye: Vec3,
    /// Half the width in pixels.
    pub center_x: f32,
    /// Through the middle of the picture; unit.
    pub forward: Vec3,
    /// Half the height in pixels.
    pub center_y: f32,
    /// One pixel to the right.
    pub right: Vec3,
    /// Fills the row of four.
    pub pad_right: f32,
    /// One pixel down.
    pub down: Vec3,
    /// Fills the row of four.
    pub pad_down: f32,
}

impl CameraConstants {
    /// For a picture of the given width and height; computed in f64, rounded once.
    pub fn new(camera: &Camera, size: [u32; 2]) -> Self {
        let (right, up, back) = camera.axes();
        let [width, height] = size.map(f64::from);
        let pixel = 2.0 * libm::tan(0.5 * camera.fov_deg.to_radians()) / height;
        Self {
            eye: camera.eye.as_vec3(),
            center_x: (0.5 * width) as f32,
            forward: (-back).as_vec3(),
            center_y: (0.5 * height) as f32,
            right: (pixel * right).as_vec3(),
            pad_right: 0.0,
            down: (-pixel * up).as_vec3(),
            pad_down: 0.0,
        }
    }
}

/// The ray through (x, y) of the picture, in pixels from its upper left corner; its direction is unit.
#[allow(clippy::inline_always, reason = "what is not inlined is not compiled for the lanes' CPU feature")]
#[inline(always)]
pub fn camera_ray(c: &CameraConstants, x: f32, y: f32) -> Ray {
    let direction = c.forward + c.right * (x - c.center_x) + c.down * (y - c.center_y);
    Ray { origin: c.eye, direction: direction.normalize() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;

    fn constants() -> CameraConstants {
        // looks along −z from z = 2; 90° high, twice as wide: at z = 1 the picture is 4 wide and 2 high
        let camera =
            Camera { eye: DVec3::new(0.0, 0.0, 2.0), look_at: DVec3::ZERO, up: DVec3::Y, fov_deg: 90.0 };
        CameraConstants::new(&camera, [200, 100])
    }

    #[test]
    fn corners_and_centre() {
        let c = constants();
        for (x, y, expected) in [
            (100.0, 50.0, Vec3::new(0.0, 0.0, -1.0)),
            (0.0, 0.0, Vec3::new(-2.0, 1.0, -1.0) / 6f32.sqrt()),
            (200.0, 0.0, Vec3::new(2.0, 1.0, -1.0) / 6f32.sqrt()),
            (0.0, 100.0, Vec3::new(-2.0, -1.0, -1.0) / 6f32.sqrt()),
            (200.0, 100.0, Vec3::new(2.0, -1.0, -1.0) / 6f32.sqrt()),
        ] {
            let ray = camera_ray(&c, x, y);
            assert_eq!(ray.origin, Vec3::new(0.0, 0.0, 2.0));
            assert!((ray.direction - expected).length() < 1e-6, "({x}, {y}): {:?}", ray.direction);
        }
    }

    #[test]
    fn straight_up_is_looked_at_without_nan() {
        let camera = Camera { eye: DVec3::ZERO, look_at: DVec3::Y, up: DVec3::Y, fov_deg: 40.0 };
        let ray = camera_ray(&CameraConstants::new(&camera, [3, 3]), 1.5, 1.5);
        assert_eq!(ray.direction, Vec3::Y);
    }
}
