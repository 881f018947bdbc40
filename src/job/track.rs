//! Cameras and transforms over time: keys at frames, held before the first and after the last.

use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::Camera;
use glam::DQuat;

/// How values between keys are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Straight.
    #[default]
    Linear,
    /// With a rest at each key: x²·(3 − 2x).
    Smooth,
}

/// A value at a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key<T> {
    /// The frame.
    pub frame: i64,
    /// The value.
    pub value: T,
}

/// What can be mixed.
trait Mix: Copy {
    fn mix(self, other: Self, x: f64) -> Self;
}

/// The value at a frame; keys are in the order of their frames and there is at least one.
fn at<T: Mix>(keys: &[Key<T>], frame: i64, interpolation: Interpolation) -> Option<T> {
    let after = keys.iter().position(|k| k.frame > frame).unwrap_or(keys.len());
    let before = keys.get(after.checked_sub(1)?.min(keys.len()))?;
    Some(match keys.get(after) {
        None => before.value,
        Some(next) => {
            let x = frames_between(before.frame, frame) / frames_between(before.frame, next.frame);
            let x = if interpolation == Interpolation::Smooth { x * x * (3.0 - 2.0 * x) } else { x };
            before.value.mix(next.value, x)
        }
    })
}

/// How many frames there are from one to another; each may be any of 64 bits.
fn frames_between(from: i64, to: i64) -> f64 {
    (i128::from(to) - i128::from(from)) as f64
}

/// The value at a frame, the first key's before it.
fn held<T: Mix>(keys: &[Key<T>], frame: i64, interpolation: Interpolation) -> Option<T> {
    at(keys, frame, interpolation).or_else(|| keys.first().map(|k| k.value))
}

/// A camera's pose; what is not given comes from the settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraPose {
    /// Where it stands.
    pub eye: DVec3,
    /// What it looks at.
    pub look_at: DVec3,
    /// What is up.
    pub up: Option<DVec3>,
    /// Vertical field of view, degrees.
    pub fov_deg: Option<f64>,
}

impl Mix for CameraPose {
    fn mix(self, o: Self, x: f64) -> Self {
        let mix = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a + (b - a) * x).or(a).or(b);
        Self {
            eye: self.eye.lerp(o.eye, x),
            look_at: self.look_at.lerp(o.look_at, x),
            up: self.up.zip(o.up).map(|(a, b)| a.lerp(b, x)).or(self.up).or(o.up),
            fov_deg: mix(self.fov_deg, o.fov_deg),
        }
    }
}

/// A camera over time; one key is a camera that stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraTrack {
    /// Keys in the order of their frames, at least one.
    pub keys: Vec<Key<CameraPose>>,
    /// Between them.
    pub interpolation: Interpolation,
}

impl CameraTrack {
    /// The camera at a frame, with what it leaves open filled in.
    pub fn at(&self, frame: i64, up: DVec3, fov_deg: f64) -> Option<Camera> {
        let pose = held(&self.keys, frame, self.interpolation)?;
        Some(Camera {
            eye: pose.eye,
            look_at: pose.look_at,
            up: pose.up.unwrap_or(up),
            fov_deg: pose.fov_deg.unwrap_or(fov_deg),
        })
    }
}

/// A transform by its parts: scale, then rotate about x, then y, then z (degrees), then translate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// By how much.
    pub translate: DVec3,
    /// Degrees about x, y, z.
    pub rotate_deg: DVec3,
    /// Factor of each axis.
    pub scale: DVec3,
}

impl Default for Transform {
    fn default() -> Self {
        Self { translate: DVec3::ZERO, rotate_deg: DVec3::ZERO, scale: DVec3::ONE }
    }
}

impl Mix for Transform {
    fn mix(self, o: Self, x: f64) -> Self {
        Self {
            translate: self.translate.lerp(o.translate, x),
            rotate_deg: self.rotate_deg.lerp(o.rotate_deg, x),
            scale: self.scale.lerp(o.scale, x),
        }
    }
}

impl Transform {
    /// World from object.
    pub fn matrix(&self) -> DAffine3 {
        let [x, y, z] = self.rotate_deg.to_array().map(f64::to_radians);
        let turn = DMat3::from_quat(
            DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x),
        );
        DAffine3 { matrix3: turn * DMat3::from_diagonal(self.scale), translation: self.translate }
    }
}

/// A transform over time; one key stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// Keys in the order of their frames, at least one.
    pub keys: Vec<Key<Transform>>,
}

impl Placed {
    /// World from object at a frame.
    pub fn at(&self, frame: i64) -> DAffine3 {
        held(&self.keys, frame, Interpolation::Linear).unwrap_or_default().matrix()
    }

    /// World from object at each key.
    pub fn matrices(&self) -> impl Iterator<Item = DAffine3> {
        self.keys.iter().map(|k| k.value.matrix())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DVec3, b: [f64; 3]) -> bool {
        (a - DVec3::from_array(b)).length() < 1e-12
    }

    #[test]
    fn scale_then_turn_about_x_y_z_then_translate() {
        let t = Transform {
            translate: DVec3::new(10.0, 0.0, 0.0),
            rotate_deg: DVec3::new(90.0, 90.0, 0.0),
            scale: DVec3::new(1.0, 2.0, 1.0),
        };
        // (0, 1, 0) is scaled to (0, 2, 0), about x to (0, 0, 2), about y to (2, 0, 0), moved to (12, 0, 0)
        assert!(close(t.matrix().transform_point3(DVec3::Y), [12.0, 0.0, 0.0]));
        assert_eq!(Transform::default().matrix(), DAffine3::IDENTITY);
    }

    #[test]
    fn keys_are_mixed_between_and_held_outside() {
        let pose =
            |x: f64, fov| CameraPose { eye: DVec3::X * x, look_at: DVec3::ZERO, up: None, fov_deg: fov };
        let keys = vec![
            Key { frame: 1, value: pose(0.0, Some(20.0)) },
            Key { frame: 5, value: pose(8.0, Some(40.0)) },
        ];
        let linear = CameraTrack { keys: keys.clone(), interpolation: Interpolation::Linear };
        let eye = |t: &CameraTrack, f: i64| t.at(f, DVec3::Y, 40.0).unwrap().eye.x;
        assert_eq!([-3, 1, 2, 5, 9].map(|f| eye(&linear, f)), [0.0, 0.0, 2.0, 8.0, 8.0]);
        assert_eq!(linear.at(3, DVec3::Y, 40.0).unwrap().fov_deg, 30.0);
        let smooth = CameraTrack { keys, interpolation: Interpolation::Smooth };
        // a quarter of the way: x² (3 − 2x) = 0.15625
        assert_eq!(eye(&smooth, 2), 8.0 * 0.15625);
        // numbers beyond those that f64 holds, as of files named by their time
        let long = |track: &CameraTrack| {
            let later = |k: &Key<CameraPose>| Key { frame: 20_240_101_123_045_120 + k.frame, ..*k };
            CameraTrack { keys: track.keys.iter().map(later).collect(), ..*track }
        };
        assert_eq!(eye(&long(&linear), 20_240_101_123_045_122), 2.0);
    }
}
