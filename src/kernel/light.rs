//! Lights as a shading point sees them.

use crate::math::{DVec3, Vec3};
use crate::scene::{Falloff, Light};
use bytemuck::{Pod, Zeroable};

/// [`LightRecord::kind`] of a point light.
pub const POINT: u32 = 0;
/// [`LightRecord::kind`] of a directional light.
pub const DIRECTIONAL: u32 = 1;
/// [`LightRecord::kind`] of a spot.
pub const SPOT: u32 = 2;
/// [`LightRecord::kind`] of the triangles that glow.
pub const AREA: u32 = 3;

/// A light, ready for shading.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LightRecord {
    /// Where it stands; of a directional one the unit vector towards it.
    pub place: Vec3,
    /// [`POINT`], [`DIRECTIONAL`], [`SPOT`] or [`AREA`].
    pub kind: u32,
    /// Colour × intensity, linear RGB.
    pub radiance: Vec3,
    /// 1 where it weakens by 1/d², else 0.
    pub inverse_square: u32,
    /// A spot's axis, the way the light travels; unit.
    pub axis: Vec3,
    /// Cosine of a spot's inner half angle.
    pub cos_inner: f32,
    /// Cosine of a spot's outer half angle.
    pub cos_outer: f32,
    /// Points of an area light that each shading point looks at.
    pub samples: u32,
    /// Fills the row of four.
    pub pad: [u32; 2],
}

impl LightRecord {
    /// From a light as the job gives it.
    pub fn new(light: &Light) -> Self {
        let unit = |v: Vec3| v.as_dvec3().normalize_or(DVec3::ZERO).as_vec3();
        let cos = |degrees: f32| libm::cos(f64::from(degrees).to_radians()) as f32;
        let weakens = |falloff: Falloff| u32::from(falloff == Falloff::InverseSquare);
        let mut record = Self::zeroed();
        match *light {
            Light::Point { position, color, intensity, falloff } => {
                record.kind = POINT;
                record.place = position;
                record.radiance = color * intensity;
                record.inverse_square = weakens(falloff);
            }
            Light::Directional { direction, color, intensity } => {
                record.kind = DIRECTIONAL;
                record.place = -unit(direction);
                record.radiance = color * intensity;
            }
            Light::Spot { position, direction, inner_deg, outer_deg, color, intensity, falloff } => {
                record.kind = SPOT;
                record.place = position;
                record.radiance = color * intensity;
                record.inverse_square = weakens(falloff);
                record.axis = unit(direction);
                record.cos_inner = cos(inner_deg);
                record.cos_outer = cos(outer_deg);
            }
            Light::Area { samples } => {
                record.kind = AREA;
                record.samples = samples.max(1);
            }
        }
        record
    }

    /// From a shadow ray's origin to the light: the ray's direction, and the distance at which it ends, in units of
    /// that direction's length.
    pub fn shadow_segment(&self, origin: Vec3) -> (Vec3, f32) {
        if self.kind == DIRECTIONAL { (self.place, f32::INFINITY) } else { (self.place - origin, 1.0) }
    }
}

/// Light that arrives at a point where nothing is in the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Unit vector towards the light; 0 at the light itself.
    pub direction: Vec3,
    /// Colour · intensity · falloff · the spot's share.
    pub radiance: Vec3,
}

/// What arrives at a point from a light.
pub fn incident(light: &LightRecord, point: Vec3) -> Incident {
    if light.kind == DIRECTIONAL {
        return Incident { direction: light.place, radiance: light.radiance };
    }
    let to_light = light.place - point;
    let direction = to_light.normalize_or_zero();
    let mut radiance = light.radiance;
    if light.inverse_square != 0 {
        radiance /= to_light.length_squared();
    }
    if light.kind == SPOT {
        radiance *= smoothstep(light.cos_outer, light.cos_inner, -light.axis.dot(direction));
    }
    Incident { direction, radiance }
}

/// 0 up to `low`, 1 from `high` on, 3t² − 2t³ between; a step where they are equal.
fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    if x >= high {
        1.0
    } else if x <= low {
        0.0
    } else {
        let t = (x - low) / (high - low);
        t * t * (3.0 - 2.0 * t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(falloff: Falloff) -> LightRecord {
        let color = Vec3::new(1.0, 0.5, 0.25);
        LightRecord::new(&Light::Point { position: Vec3::new(0.0, 4.0, 0.0), color, intensity: 2.0, falloff })
    }

    #[test]
    fn point_lights_weaken_only_where_they_are_told_to() {
        let at = incident(&point(Falloff::None), Vec3::ZERO);
        assert_eq!(at, Incident { direction: Vec3::Y, radiance: Vec3::new(2.0, 1.0, 0.5) });
        // 4 away: a sixteenth
        let at = incident(&point(Falloff::InverseSquare), Vec3::ZERO);
        assert_eq!(at.radiance, Vec3::new(2.0, 1.0, 0.5) / 16.0);
        assert_eq!(incident(&point(Falloff::None), Vec3::new(0.0, 4.0, 0.0)).direction, Vec3::ZERO);
    }

    #[test]
    fn shadow_rays_end_at_the_light() {
        let light = point(Falloff::None);
        assert_eq!(light.shadow_segment(Vec3::X), (Vec3::new(-1.0, 4.0, 0.0), 1.0));
        let direction = Vec3::new(0.0, -3.0, 0.0);
        let sun = LightRecord::new(&Light::Directional { direction, color: Vec3::ONE, intensity: 0.5 });
        assert_eq!(sun.shadow_segment(Vec3::X), (Vec3::Y, f32::INFINITY));
        assert_eq!(incident(&sun, Vec3::X), Incident { direction: Vec3::Y, radiance: Vec3::splat(0.5) });
    }

    #[test]
    fn a_spot_fades_by_the_smoothstep_of_the_cosine() {
        let spot = |inner_deg, outer_deg| {
            LightRecord::new(&Light::Spot {
                position: Vec3::new(0.0, 1.0, 0.0),
                direction: Vec3::new(0.0, -2.0, 0.0),
                inner_deg,
                outer_deg,
                color: Vec3::ONE,
                intensity: 1.0,
                falloff: Falloff::None,
            })
        };
        // a point on the floor at angle a from the axis lies at tan a
        let share = |light, degrees: f32| incident(&light, Vec3::X * degrees.to_radians().tan()).radiance.x;
        assert_eq!(share(spot(20.0, 40.0), 19.0), 1.0);
        assert_eq!(share(spot(20.0, 40.0), 41.0), 0.0);
        // cos 30° = 0.866025 between cos 40° = 0.766044 and cos 20° = 0.939693: t = 0.575767, 3t² − 2t³ = 0.612781
        assert!((share(spot(20.0, 40.0), 30.0) - 0.612_781).abs() < 2e-6);
        // no border: a step
        assert_eq!(share(spot(30.0, 30.0), 29.9), 1.0);
        assert_eq!(share(spot(30.0, 30.0), 30.1), 0.0);
    }
}
