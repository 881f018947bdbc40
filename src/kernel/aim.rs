//! The camera rays of one sample of many pixels: where samples lie costs as much as a ray, if it is not computed side by
//! side.

#![allow(clippy::inline_always, reason = "what is not inlined is not compiled for the lanes' CPU feature")]

use super::camera::{CameraConstants, camera_ray};
use super::sampler::Places;
use crate::accel::Ray;
use crate::accel::lanes::{InLanes, Lanes8, Width};
use crate::math::Vec3;

/// Makes the ray of each pixel, (column, row after `first_row`), and the point of the picture that it goes through.
pub fn aim(
    camera: &CameraConstants,
    places: Places,
    first_row: u32,
    pixels: &[[u32; 2]],
    points: &mut Vec<[f32; 2]>,
    rays: &mut Vec<Ray>,
) {
    points.resize(pixels.len(), [0.0; 2]);
    rays.resize(pixels.len(), Ray { origin: Vec3::ZERO, direction: Vec3::ZERO });
    Width::detect().compute(Aim { camera, places, first_row, pixels, points, rays });
}

struct Aim<'a> {
    camera: &'a CameraConstants,
    places: Places,
    first_row: u32,
    pixels: &'a [[u32; 2]],
    points: &'a mut [[f32; 2]],
    rays: &'a mut [Ray],
}

impl InLanes for Aim<'_> {
    type Output = ();

    /// Plain loops without branches: the compiler makes as many lanes of them as the CPU's feature allows.
    #[inline(always)]
    fn compute<L: Lanes8>(self) {
        let Self { camera, places, first_row, pixels, points, rays } = self;
        places.fill(first_row, pixels, points);
        for (ray, &[x, y]) in rays.iter_mut().zip(points.iter()) {
            *ray = camera_ray(camera, x, y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::scene::{Camera, Filter};

    #[test]
    fn widths_do_not_show() {
        let camera =
            Camera { eye: DVec3::new(3.0, 1.0, 2.0), look_at: DVec3::ZERO, up: DVec3::Y, fov_deg: 40.0 };
        let camera = CameraConstants::new(&camera, [1280, 720]);
        let pixels: Vec<[u32; 2]> = (0..1000).map(|i| [i * 7 % 1280, i % 11]).collect();
        for filter in [Filter::Box, Filter::Triangle, Filter::Gaussian] {
            for (index, count) in [(0, 1), (0, 16), (5, 16)] {
                let places = Places::new(filter, index, count, 3);
                let rays_in = |width: Width| {
                    let mut points = vec![[0.0; 2]; pixels.len()];
                    let mut rays = vec![Ray { origin: Vec3::ZERO, direction: Vec3::ZERO }; pixels.len()];
                    let (points, rays_of) = (&mut points, &mut rays);
                    width.compute(Aim {
                        camera: &camera,
                        places,
                        first_row: 600,
                        pixels: &pixels,
                        points,
                        rays: rays_of,
                    });
                    rays
                };
                let [first, others @ ..] = Width::available() else { unreachable!() };
                let rays = rays_in(*first);
                assert!(rays.iter().all(|ray| (ray.direction.length() - 1.0).abs() < 1e-6));
                assert!(
                    others.iter().all(|&width| rays_in(width) == rays),
                    "{filter:?}, sample {index} of {count}"
                );
            }
        }
    }
}
