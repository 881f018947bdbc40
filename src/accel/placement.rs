//! Where an object stands in the world: its transform, the ray in its own space, its box in the world.

use super::Ray;
use super::slab::Aabb;
use crate::math::{DAffine3, DMat3, DVec3, Vec3};

/// 8 ULP (2⁻²³).
const MARGIN: f64 = 8.0 * f32::EPSILON as f64;

/// A 3x3 matrix by rows. Products are summed from the left, unfused, so that every path gives the same bits.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rows([[f32; 3]; 3]);

impl Rows {
    const ZERO: Self = Self([[0.0; 3]; 3]);

    /// Rounds; None where an element does not fit f32.
    fn of(m: &DMat3) -> Option<Self> {
        m.is_finite()
            .then(|| Self(m.transpose().to_cols_array_2d().map(|row| row.map(|x| x as f32))))
            .filter(|r| r.0.as_flattened().iter().all(|x| x.is_finite()))
    }

    #[inline(always)]
    fn times(&self, v: [f32; 3]) -> [f32; 3] {
        self.0.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }
}

/// A placed object. A transform that has no inverse (a scale of 0) makes an object that is never hit.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    world_from_object: Rows,
    object_from_world: Rows,
    translation: [f32; 3],
    /// The box of the transformed corners of the vertex box.
    world_box: Aabb,
    /// What `world_box` is widened by, per axis, for a ray that starts in the world's origin,
    margin: [f32; 3],
    /// and what is added for each unit of |origin|.
    margin_of_origin: Rows,
}

/// The numbers of a [`Placement`]; matrices by rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacementRows {
    /// The linear part.
    pub world_from_object: [[f32; 3]; 3],
    /// The rest of it.
    pub translation: [f32; 3],
    /// The linear part's inverse.
    pub object_from_world: [[f32; 3]; 3],
    /// The box of the transformed corners of the vertex box.
    pub world_box: Aabb,
    /// What that is widened by on each axis for a ray that starts in the world's origin,
    pub margin: [f32; 3],
    /// and what is added for each unit of |origin|.
    pub margin_of_origin: [[f32; 3]; 3],
}

impl Placement {
    /// Places an object whose vertices lie in a box.
    pub fn new(world_from_object: &DAffine3, vertex_box: &Aabb) -> Self {
        Self::invertible(world_from_object, vertex_box).unwrap_or(Self {
            world_from_object: Rows::of(&world_from_object.matrix3).unwrap_or(Rows::ZERO),
            object_from_world: Rows::ZERO,
            translation: world_from_object.translation.as_vec3().to_array(),
            world_box: Aabb::EMPTY,
            margin: [0.0; 3],
            margin_of_origin: Rows::ZERO,
        })
    }

    fn invertible(world_from_object: &DAffine3, vertex_box: &Aabb) -> Option<Self> {
        let m = world_from_object.matrix3;
        let t = world_from_object.translation;
        let inverse = m.inverse();
        let [abs_m, abs_inverse] = [abs(&m), abs(&inverse)];
        let [min, max] = [vertex_box.min, vertex_box.max].map(|p| Vec3::from_array(p).as_dvec3());
        let corners = crate::math::Bounds { min, max }.corners();
        let world_box = if vertex_box.is_empty() {
            Aabb::EMPTY
        } else {
            Aabb::of_points(&corners.map(|c| world_from_object.transform_point3(c).as_vec3().to_array()))
        };
        // |M|·(|corner| + |M⁻¹|·(|o| + |T|)) + |T|, apart what depends on the ray's origin o
        let margin = MARGIN * (abs_m * (min.abs().max(max.abs()) + abs_inverse * t.abs()) + t.abs());
        let finite = |v: DVec3| v.as_vec3().is_finite().then(|| v.as_vec3().to_array());
        Some(Self {
            world_from_object: Rows::of(&m)?,
            object_from_world: Rows::of(&inverse)?,
            translation: finite(t)?,
            world_box,
            margin: if vertex_box.is_empty() { [0.0; 3] } else { finite(margin)? },
            margin_of_origin: Rows::of(&(MARGIN * (abs_m * abs_inverse)))?,
        })
    }

    /// The ray in the object's space; its direction is not normalised, so that distances are the world's.
    #[inline(always)]
    pub(crate) fn object_ray(&self, ray: &Ray) -> Ray {
        let o = ray.origin.to_array();
        let from_translation = std::array::from_fn(|k| o[k] - self.translation[k]);
        Ray {
            origin: Vec3::from_array(self.object_from_world.times(from_translation)),
            direction: Vec3::from_array(self.object_from_world.times(ray.direction.to_array())),
        }
    }

    /// A box in the world that a ray enters not after any of the object's triangles: widened by what the roundings of
    /// [`Self::object_ray`] and of the corners amount to.
    #[inline(always)]
    pub(crate) fn box_for(&self, ray: &Ray) -> Aabb {
        let more = self.margin_of_origin.times(ray.origin.to_array().map(f32::abs));
        let margin: [f32; 3] = std::array::from_fn(|k| self.margin[k] + more[k]);
        Aabb {
            min: std::array::from_fn(|k| self.world_box.min[k] - margin[k]),
            max: std::array::from_fn(|k| self.world_box.max[k] + margin[k]),
        }
    }

    /// What kernels of other devices compute the same from.
    pub fn rows(&self) -> PlacementRows {
        PlacementRows {
            world_from_object: self.world_from_object.0,
            translation: self.translation,
            object_from_world: self.object_from_world.0,
            world_box: self.world_box,
            margin: self.margin,
            margin_of_origin: self.margin_of_origin.0,
        }
    }

    /// A vertex in the world.
    pub fn point(&self, p: [f32; 3]) -> Vec3 {
        Vec3::from_array(self.world_from_object.times(p)) + Vec3::from_array(self.translation)
    }

    /// |M|·|p| + |T|: how large the numbers are that [`Self::point`] adds up, per axis.
    pub fn magnitude(&self, p: [f32; 3]) -> Vec3 {
        let rows = Rows(self.world_from_object.0.map(|row| row.map(f32::abs)));
        Vec3::from_array(rows.times(p.map(f32::abs))) + Vec3::from_array(self.translation).abs()
    }
}

fn abs(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::accel::slab::SlabRay;
    use crate::accel::triangle::ScalarRay;
    use crate::math::DVec3;
    use glam::DQuat;

    /// Numbers in [-1, 1): the fractional parts of multiples of the golden ratio.
    pub(crate) fn numbers() -> impl FnMut() -> f64 {
        let mut n = 0.0_f64;
        move || {
            n += 1.0;
            2.0 * (n * 0.618_033_988_749_894_9).fract() - 1.0
        }
    }

    #[test]
    fn the_box_in_the_world_is_entered_not_after_any_triangle() {
        let mut next = numbers();
        let mut hits = 0;
        for i in 0..20_000 {
            let size = [1.0, 1e-3, 1e4][i % 3];
            let far = [0.0, 1.0, 1e5][i / 3 % 3];
            let mut vector = |s: f64| DVec3::new(next() * s, next() * s, next() * s);
            let corners = [vector(size), vector(size), vector(size)].map(|v| v.as_vec3().to_array());
            let turn = DQuat::from_axis_angle(vector(1.0).normalize(), vector(3.0).x);
            let m = DAffine3::from_scale_rotation_translation(vector(2.0), turn, vector(far));
            let placement = Placement::new(&m, &Aabb::of_points(&corners));
            // towards the triangle's middle, from near and far
            let middle = corners.iter().map(|c| placement.point(*c)).sum::<Vec3>() / 3.0;
            let origin = middle + vector([2.0, 300.0][i % 2] * size).as_vec3();
            let ray = Ray { origin, direction: (middle - origin).normalize() };
            let Some((distance, _)) = ScalarRay::new(&placement.object_ray(&ray)).hit(&corners) else {
                continue;
            };
            hits += 1;
            let entry = SlabRay::new(&ray).entry(&placement.box_for(&ray));
            assert!(
                entry.is_some_and(|e| e <= distance),
                "{entry:?}, {distance}: {ray:?}, {m:?}, {corners:?}"
            );
        }
        assert!(hits > 15_000, "{hits}");
    }

    #[test]
    fn a_transform_without_inverse_is_never_entered() {
        let b = Aabb { min: [-1.0; 3], max: [1.0; 3] };
        for scale in [DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0), DVec3::NAN, DVec3::splat(1e-60)] {
            let placement = Placement::new(&DAffine3::from_scale(scale), &b);
            let ray = Ray { origin: Vec3::ZERO, direction: Vec3::Z };
            assert_eq!(SlabRay::new(&ray).entry(&placement.box_for(&ray)), None, "{scale}");
        }
    }

    #[test]
    fn a_point_is_turned_and_moved_and_its_magnitude_adds_up_without_signs() {
        // a quarter turn about z: (x, y, z) -> (-y, x, z), then moved
        let m = DAffine3::from_cols_array(&[0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 10.0, -20.0, 30.0]);
        let placement = Placement::new(&m, &Aabb { min: [0.0; 3], max: [1.0; 3] });
        assert_eq!(placement.point([1.0, 2.0, -3.0]), Vec3::new(8.0, -19.0, 27.0));
        assert_eq!(placement.magnitude([1.0, 2.0, -3.0]), Vec3::new(12.0, 21.0, 33.0));
        let ray = placement
            .object_ray(&Ray { origin: Vec3::new(8.0, -19.0, 27.0), direction: Vec3::new(0.0, 2.0, 0.0) });
        assert_eq!((ray.origin, ray.direction), (Vec3::new(1.0, 2.0, -3.0), Vec3::new(2.0, 0.0, 0.0)));
    }
}
