//! Everything that a frame's tiles have in common.

use super::camera::CameraConstants;
use super::emitter::Emitters;
use super::light::LightRecord;
use super::world::World;
use crate::scene::{Frame, Light, Shot};

/// A frame and a shot, ready for rays.
#[derive(Debug)]
pub struct Scene<'a, A> {
    /// What rays are traced against: the triangles of the frame.
    pub aggregate: &'a A,
    /// The surfaces of the frame.
    pub world: World<'a>,
    /// The camera.
    pub camera: CameraConstants,
    /// How much wider a ray's cone, a pixel at first, becomes with each unit of its path.
    pub spread: f32,
    /// The lights in the order given.
    pub lights: Vec<LightRecord>,
    /// What area lights are made of; empty where there are none.
    pub emitters: Emitters,
    /// The rest.
    pub shot: &'a Shot,
}

impl<'a, A> Scene<'a, A> {
    /// Takes a frame, what its rays are traced against, and a shot.
    pub fn new(aggregate: &'a A, frame: &'a Frame, shot: &'a Shot) -> Self {
        let world = World::new(frame);
        let emitters = emitters(&world, shot);
        Self {
            aggregate,
            world,
            camera: CameraConstants::new(&shot.camera, shot.size),
            spread: spread(shot),
            lights: shot.lights.iter().map(LightRecord::new).collect(),
            emitters,
            shot,
        }
    }
}

/// What the area lights of a shot are made of; nothing where it has none.
pub fn emitters(world: &World, shot: &Shot) -> Emitters {
    let has_area_light = shot.lights.iter().any(|l| matches!(l, Light::Area { .. }));
    if has_area_light { Emitters::new(world) } else { Emitters::default() }
}

/// How much wider a ray's cone becomes with each unit of its path.
pub fn spread(shot: &Shot) -> f32 {
    let half_fov = (0.5 * shot.camera.fov_deg).to_radians();
    (2.0 * libm::tan(half_fov) / f64::from(shot.size[1])) as f32
}
