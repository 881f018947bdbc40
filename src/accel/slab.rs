//! Boxes and the slab test: one function for nodes and for the triangles' own boxes, so that a box that contains
//! another is never entered later nor missed (every step is monotonic in the planes).

use super::Ray;
use super::lanes::{Lanes, next_up, per_axis};

/// Factor on the exit of a box. Let u = 2⁻²⁴. The slab test's own roundings need 1 + 6u (Ize, "Robust BVH Ray
/// Traversal", 2013: 1 + 2γ₃); the edge test sees a vertex displaced by up to 4u of its distance from the origin,
/// which needs 8u more. The part of that displacement that is due to the triangle's size is in the own box's margin.
pub(crate) const EXIT_FACTOR: f32 = 1.0 + 1.0 / 1048576.0;

/// Direction components below this count as this, with their sign.
const LEAST_DIRECTION: f32 = 1e-20;

/// An axis-aligned box in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub min: [f32; 3],
    /// Greatest corner.
    pub max: [f32; 3],
}

impl Aabb {
    /// The box that holds nothing; no ray enters it.
    pub const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// The box of points; empty without any.
    pub fn of_points(points: &[[f32; 3]]) -> Self {
        points.iter().fold(Self::EMPTY, |b, &p| b.union(&Self { min: p, max: p }))
    }

    /// The least box that holds both.
    #[inline(always)]
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: per_axis(|k| Lanes::min(self.min[k], other.min[k])),
            max: per_axis(|k| Lanes::max(self.max[k], other.max[k])),
        }
    }

    /// Whether the other lies inside.
    pub fn contains(&self, other: &Self) -> bool {
        (0..3).all(|k| self.min[k] <= other.min[k] && self.max[k] >= other.max[k])
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.min[0] > self.max[0]
    }

    /// A triangle's own box: that of its corners, each side moved out by 8 ULP (2⁻²³) of the largest extent and then
    /// to the next float.
    #[inline(always)]
    pub fn own(corners: &[[f32; 3]; 3]) -> Self {
        let [a, b, c] = corners;
        let min = per_axis(|k| Lanes::min(a[k], Lanes::min(b[k], c[k])));
        let max = per_axis(|k| Lanes::max(a[k], Lanes::max(b[k], c[k])));
        let margin = own_margin(per_axis(|k| max[k] - min[k]));
        Self { min: per_axis(|k| below(min[k], margin)), max: per_axis(|k| above(max[k], margin)) }
    }
}

/// By how much a triangle's own box is larger than its corners'.
#[inline(always)]
pub(crate) fn own_margin<L: Lanes>(size: [L; 3]) -> L {
    size[0].max(size[1].max(size[2])).mul(L::splat(8.0 * f32::EPSILON))
}

/// The least side of an own box.
#[inline(always)]
fn below(min: f32, margin: f32) -> f32 {
    -next_up(margin - min)
}

/// The greatest side of an own box.
#[inline(always)]
fn above(max: f32, margin: f32) -> f32 {
    next_up(max + margin)
}

/// 1 / a direction's component; what is below [`LEAST_DIRECTION`] counts as that.
#[inline(always)]
pub(crate) fn inverse(d: f32) -> f32 {
    1.0 / if d.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(d) } else { d }
}

/// A ray as the slab test wants it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlabRay<L> {
    pub(crate) origin: [L; 3],
    /// 1 / direction, see [`inverse`].
    pub(crate) inverse: [L; 3],
    /// For each axis the side that is entered first: 0 the lesser plane, 1 the greater.
    pub(crate) near_side: [usize; 3],
}

impl<L: Lanes> SlabRay<L> {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let o = ray.origin.to_array();
        let d = ray.direction.to_array();
        let i = per_axis(|k| inverse(d[k]));
        Self {
            origin: per_axis(|k| L::splat(o[k])),
            inverse: per_axis(|k| L::splat(i[k])),
            near_side: per_axis(|k| usize::from(i[k] < 0.0)),
        }
    }

    /// Which of the rays enter one box, not after their ends.
    #[inline(always)]
    pub(crate) fn enters(&self, b: &Aabb, ends: L) -> u32 {
        let (near, far) = sides(b, self.near_side);
        let (entry, exit) = self.pass(per_axis(|k| L::splat(near[k])), per_axis(|k| L::splat(far[k])));
        entry.le(ends.min(exit))
    }

    /// Where the ray enters (0 where it starts inside) and leaves boxes whose planes are given in the order in which
    /// it meets them. A box is hit where the entry is not greater than the exit.
    #[inline(always)]
    pub(crate) fn pass(&self, near: [L; 3], far: [L; 3]) -> (L, L) {
        let [o, i] = [&self.origin, &self.inverse];
        let near = per_axis(|k| near[k].sub(o[k]).mul(i[k]));
        let far = per_axis(|k| far[k].sub(o[k]).mul(i[k]));
        let entry = near[0].max(near[1]).max(near[2].max(L::splat(0.0)));
        let exit = far[0].min(far[1]).min(far[2]).mul(L::splat(EXIT_FACTOR));
        (entry, exit)
    }
}

/// A box's corner that is met first, and the one met last.
#[inline(always)]
fn sides(b: &Aabb, near_side: [usize; 3]) -> ([f32; 3], [f32; 3]) {
    let sides = [&b.min, &b.max];
    let [x, y, z] = near_side;
    ([sides[x][0], sides[y][1], sides[z][2]], [sides[1 - x][0], sides[1 - y][1], sides[1 - z][2]])
}

impl SlabRay<f32> {
    /// Where the ray enters one box; None where it misses it.
    #[inline(always)]
    pub(crate) fn entry(&self, b: &Aabb) -> Option<f32> {
        let (near, far) = sides(b, self.near_side);
        let (entry, exit) = self.pass(near, far);
        (entry <= exit).then_some(entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn an_own_box_is_eight_ulp_of_the_largest_extent_and_a_float_larger() {
        // extents 1, 0.5, 0: margin 8 · 2⁻²³ = 2⁻²⁰ on every axis
        let b = Aabb::own(&[[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 0.5, 2.0]]);
        let m = 1.0 / 1048576.0_f32;
        assert_eq!(b.min, [(-m).next_down(), (-m).next_down(), (2.0 - m).next_down()]);
        assert_eq!(b.max, [(1.0 + m).next_up(), (0.5 + m).next_up(), (2.0 + m).next_up()]);
    }

    #[test]
    fn next_up_is_that_of_the_standard_library() {
        for bits in
            (0..=u32::MAX).step_by(65_521).chain([0, 1 << 31, 0x7f7f_ffff, 0xff7f_ffff, 1, (1 << 31) + 1])
        {
            let x = f32::from_bits(bits);
            let expected = if x.is_finite() { x.next_up() } else { x };
            assert!(next_up(x) == expected || x.is_nan() && next_up(x).is_nan(), "{x:e}");
        }
    }

    #[test]
    fn a_ray_enters_and_leaves_where_it_meets_the_planes() {
        // from (-1, 0.5, 0.5) along 2x: at x = 0 after 0.5, at x = 3 after 2
        let ray = SlabRay::<f32>::new(&Ray {
            origin: Vec3::new(-1.0, 0.5, 0.5),
            direction: Vec3::new(2.0, 0.0, 0.0),
        });
        let b = Aabb { min: [0.0; 3], max: [3.0, 1.0, 1.0] };
        let (near, far) = sides(&b, ray.near_side);
        assert_eq!(ray.pass(near, far), (0.5, 2.0 * EXIT_FACTOR));
        assert_eq!(ray.entry(&b), Some(0.5));
        assert_eq!(ray.entry(&Aabb { min: [0.0, 0.6, 0.0], ..b }), None);
        assert_eq!(ray.entry(&Aabb { min: [-2.0, 0.0, 0.0], ..b }), Some(0.0), "it starts inside");
        assert_eq!(ray.entry(&Aabb::EMPTY), None);
    }
}
