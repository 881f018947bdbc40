//! The canonical hit of one triangle: Woop's watertight edge test (Woop, Benthin, Wald, "Watertight Ray/Triangle
//! Intersection", JCGT 2013) without its double precision fallback, and the slab test of the triangle's own box.
//!
//! Watertight: a projected vertex is a function of ray and vertex alone, so neighbours see the same one; the two
//! products of an edge's value are rounded monotonically, so its sign is right or the value is 0, and 0 counts for
//! both neighbours, whose values are negatives of each other bit for bit (nothing is fused).
//!
//! Both sides of a triangle are hit, at distances above 0 only: a ray that starts in a plane does not hit it there.

use super::lanes::{Lanes, per_axis};
use super::slab::{Aabb, SlabRay};
use super::{HitOrder, Ray};

/// A ray as the edge test wants it: its largest component is along the last axis, the others are sheared away.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearRay<L> {
    /// The axes (x, y, z) of the sheared space.
    pub(crate) axes: [usize; 3],
    pub(crate) origin: [L; 3],
    pub(crate) shear: [L; 3],
}

/// The axis of a direction's largest component.
#[inline(always)]
pub(crate) fn last_axis(direction: [f32; 3]) -> usize {
    let [x, y, z] = direction.map(f32::abs);
    if x >= y && x >= z { 0 } else { 1 + usize::from(y < z) }
}

/// The axes of a sheared space.
#[inline(always)]
pub(crate) fn sheared_axes(last: usize) -> [usize; 3] {
    [(last + 1) % 3, (last + 2) % 3, last]
}

/// How far a step along the last axis goes along the others and along the ray; of directions with their components in the
/// order of [`sheared_axes`].
#[inline(always)]
pub(crate) fn shear<L: Lanes>([x, y, z]: [L; 3]) -> [L; 3] {
    [x.div(z), y.div(z), L::splat(1.0).div(z)]
}

/// Values of the three edges, each opposite to a corner: its weight times the determinant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edges<L> {
    /// Opposite to the first, second and third corner.
    pub(crate) values: [L; 3],
    depths: [L; 3],
}

impl<L: Lanes> ShearRay<L> {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.direction.to_array();
        let axes = sheared_axes(last_axis(d));
        let o = ray.origin.to_array();
        let shear = shear(axes.map(|k| d[k]));
        Self { axes, origin: per_axis(|k| L::splat(o[axes[k]])), shear: per_axis(|k| L::splat(shear[k])) }
    }

    /// A vertex, its coordinates in the order of [`Self::axes`], as seen along the ray.
    #[inline(always)]
    fn project(&self, v: [L; 3]) -> [L; 3] {
        let z = v[2].sub(self.origin[2]);
        let x = v[0].sub(self.origin[0]).sub(self.shear[0].mul(z));
        let y = v[1].sub(self.origin[1]).sub(self.shear[1].mul(z));
        [x, y, z]
    }

    /// The edges' values; corners with their coordinates in the order of [`Self::axes`].
    #[inline(always)]
    pub(crate) fn edges(&self, a: [L; 3], b: [L; 3], c: [L; 3]) -> Edges<L> {
        let [ax, ay, az] = self.project(a);
        let [bx, by, bz] = self.project(b);
        let [cx, cy, cz] = self.project(c);
        Edges {
            values: [cx.mul(by).sub(cy.mul(bx)), ax.mul(cy).sub(ay.mul(cx)), bx.mul(ay).sub(by.mul(ax))],
            depths: [az, bz, cz],
        }
    }

    /// The distance of the triangle's plane along the ray. NaN where the determinant is 0.
    #[inline(always)]
    pub(crate) fn plane(&self, edges: &Edges<L>) -> L {
        let [u, v, w] = edges.values;
        let [az, bz, cz] = edges.depths;
        let depth = u.mul(az).add(v.mul(bz)).add(w.mul(cz));
        depth.div(edges.determinant()).mul(self.shear[2])
    }
}

impl<L: Lanes> Edges<L> {
    /// Lanes whose values are all of one sign; 0 has either. Both sides of a triangle are hit.
    #[inline(always)]
    pub(crate) fn inside(&self) -> u32 {
        let [u, v, w] = self.values;
        let zero = L::splat(0.0);
        zero.le(u.min(v.min(w))) | u.max(v.max(w)).le(zero)
    }

    /// Weights of the second and third corner.
    #[inline(always)]
    pub(crate) fn barycentric(&self) -> [L; 2] {
        let det = self.determinant();
        [self.values[1].div(det), self.values[2].div(det)]
    }

    #[inline(always)]
    fn determinant(&self) -> L {
        let [u, v, w] = self.values;
        u.add(v).add(w)
    }
}

/// Whether a triangle can be hit: its normal, computed in f64 (which neither overflows nor underflows), is neither 0 nor
/// not finite.
pub fn has_area(corners: &[[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(|p| p.map(f64::from));
    let e = per_axis(|k| b[k] - a[k]);
    let f = per_axis(|k| c[k] - a[k]);
    let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    n.iter().all(|x| x.is_finite()) && n != [0.0; 3]
}

/// Lanes of triangles that surely have area, by corner and axis: most that have, none that have not.
///
/// With u = 2⁻²⁴, each of the normal's six products is within 3u of itself and 2⁻¹⁴⁹ of the true one, each difference
/// within u. Where the components' sizes together are 16u of the products' sizes together and 2⁻¹⁰⁰ at least, rounding
/// is less than half of that, so that the true normal is not 0, nor is it in f64, whose roundings are 2⁻²⁹ of those.
/// What is not finite makes the products' sum so, and nothing is greater than that.
#[inline(always)]
pub(crate) fn surely_have_area<L: Lanes>(corners: &[[L; 3]; 3]) -> u32 {
    let [a, b, c] = corners;
    let e = per_axis(|k| b[k].sub(a[k]));
    let f = per_axis(|k| c[k].sub(a[k]));
    let size = |x: L| x.max(L::splat(0.0).sub(x));
    let products = per_axis(|k| (e[(k + 1) % 3].mul(f[(k + 2) % 3]), e[(k + 2) % 3].mul(f[(k + 1) % 3])));
    let sum = |[x, y, z]: [L; 3]| x.add(y).add(z);
    let normal = sum(per_axis(|k| size(products[k].0.sub(products[k].1))));
    let terms = sum(per_axis(|k| size(products[k].0).add(size(products[k].1))));
    terms.mul(L::splat(16.0 / 16_777_216.0)).max(L::splat(LEAST_SURE_NORMAL)).lt(normal)
}

/// 2⁻¹⁰⁰: below this, see [`surely_have_area`].
const LEAST_SURE_NORMAL: f32 = f32::from_bits(27 << 23);

/// What is looked for along a ray: the first candidate strictly between two places of the order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search {
    after: HitOrder,
    /// The first candidate yet, or where the search ends.
    pub(crate) before: HitOrder,
}

impl Search {
    /// After a place, or anywhere along the ray: distances are above 0.
    #[inline(always)]
    pub(crate) fn after(after: Option<HitOrder>) -> Self {
        Self {
            after: after.unwrap_or(HitOrder { distance: 0.0, primitive: 0 }),
            before: HitOrder { distance: f32::INFINITY, primitive: 0 },
        }
    }

    /// Before a distance; NaN is before all of them.
    #[inline(always)]
    pub(crate) fn until(end: f32) -> Self {
        let distance = Lanes::max(end, f32::NEG_INFINITY);
        Self { before: HitOrder { distance, primitive: 0 }, ..Self::after(None) }
    }

    /// Looks for nothing more.
    #[inline(always)]
    pub(crate) fn end(&mut self) {
        self.before.distance = f32::NEG_INFINITY;
    }

    /// Whether a candidate is what is looked for.
    #[inline(always)]
    pub(crate) fn admits(&self, candidate: HitOrder) -> bool {
        precedes(self.after, candidate) && precedes(candidate, self.before)
    }
}

#[inline(always)]
fn precedes(a: HitOrder, b: HitOrder) -> bool {
    a.distance < b.distance || (a.distance == b.distance && a.primitive < b.primitive)
}

/// A ray against one triangle at a time: the reference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScalarRay {
    slab: SlabRay<f32>,
    shear: ShearRay<f32>,
}

impl ScalarRay {
    pub(crate) fn new(ray: &Ray) -> Self {
        Self { slab: SlabRay::new(ray), shear: ShearRay::new(ray) }
    }

    /// The canonical distance of a triangle that has area, and the weights of its second and third corner; None where
    /// it is not hit.
    pub(crate) fn hit(&self, corners: &[[f32; 3]; 3]) -> Option<(f32, [f32; 2])> {
        let [a, b, c] = corners.map(|p| self.shear.axes.map(|k| p[k]));
        let edges = self.shear.edges(a, b, c);
        if edges.inside() == 0 {
            return None;
        }
        let t = self.shear.plane(&edges);
        if t > 0.0 { Some((distance_in_plane(&self.slab, corners, t)?, edges.barycentric())) } else { None }
    }
}

/// The canonical distance of a triangle whose plane is hit inside it at t.
#[inline(always)]
pub(crate) fn distance_in_plane(slab: &SlabRay<f32>, corners: &[[f32; 3]; 3], t: f32) -> Option<f32> {
    slab.entry(&Aabb::own(corners)).map(|entry| Lanes::max(t, entry))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

    fn hit(x: f32, y: f32, direction: Vec3) -> Option<(f32, [f32; 2])> {
        ScalarRay::new(&Ray { origin: Vec3::new(x, y, 2.0), direction }).hit(&CORNERS)
    }

    #[test]
    fn distance_and_weights_are_those_worked_out_on_paper() {
        // (1, 2) = 1/4 · (0, 0) + 1/4 · (4, 0) + 1/2 · (0, 4). The own box ends 4 · 2⁻²⁰ and a float above the plane, so
        // it is entered before it, and the distance is the plane's.
        assert_eq!(hit(1.0, 2.0, Vec3::NEG_Z), Some((2.0, [0.25, 0.5])));
        assert_eq!(hit(1.0, 2.0, Vec3::NEG_Z * 4.0), Some((0.5, [0.25, 0.5])));
        assert_eq!(hit(1.0, 2.0, Vec3::Z), None, "it is behind");
        assert_eq!(hit(3.0, 2.0, Vec3::NEG_Z), None, "beside");
        assert_eq!(hit(1.0, 2.0, Vec3::X), None, "parallel");
    }

    #[test]
    fn edges_corners_and_both_sides_are_hit() {
        for (x, y) in [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (2.0, 2.0), (2.0, 0.0), (0.0, 1.0)] {
            assert!(hit(x, y, Vec3::NEG_Z).is_some(), "{x} {y}");
        }
        let from_below = Ray { origin: Vec3::new(1.0, 2.0, -2.0), direction: Vec3::Z };
        assert_eq!(ScalarRay::new(&from_below).hit(&CORNERS), Some((2.0, [0.25, 0.5])));
    }

    #[test]
    fn neighbours_see_opposite_values_of_their_edge() {
        let shear = ShearRay::<f32>::new(&Ray {
            origin: Vec3::new(0.1, 0.7, 3.0),
            direction: Vec3::new(0.3, -0.2, -1.0),
        });
        let [a, b, c, d] = [[0.13, 0.2, 0.7], [5.1, 0.3, 0.9], [0.2, 4.7, 0.11], [6.3, 5.9, 0.77]];
        assert_eq!(shear.edges(a, b, c).values[0], -shear.edges(d, c, b).values[0]);
    }

    #[test]
    fn collinear_coincident_and_broken_corners_have_no_area_and_tiny_ones_have() {
        assert!(!has_area(&[[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [4.0, 4.0, 4.0]]));
        assert!(!has_area(&[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
        assert!(!has_area(&[[f32::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
        assert!(has_area(&[[0.0; 3], [1e-30, 0.0, 0.0], [0.0, 1e-30, 0.0]]));
        assert!(has_area(&[[-3e38; 3], [3e38, 0.0, 0.0], [0.0, 3e38, 0.0]]));
    }

    #[test]
    fn what_surely_has_area_has_it() {
        let special = [0.0, -0.0, 1.0, -1.0, 1e-45, 1e-38, 1e-25, 1e-20, 1e25, 3e38, f32::INFINITY, f32::NAN];
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(0x915f_77f5).wrapping_add(0x9e37_79b9);
            state >> 8
        };
        let (mut sure, mut without, mut doubtful) = (0, 0, 0);
        for round in 0..200_000 {
            let mut float = || match round % 4 {
                0 => special[random() as usize % special.len()],
                1 => f32::from_bits(random() << 8 ^ random()),
                _ => random() as f32 / 16_777_216.0 - 0.5,
            };
            let mut corners: [[f32; 3]; 3] =
                [[float(), float(), float()], [float(), float(), float()], [float(), float(), float()]];
            if round % 4 == 3 {
                // nearly or wholly on a line
                let along = random() as f32 / 16_777_216.0;
                corners[2] = per_axis(|k| corners[0][k] + along * (corners[1][k] - corners[0][k]));
            }
            let is_sure = surely_have_area(&corners) == 1;
            assert!(!is_sure || has_area(&corners), "{corners:?}");
            doubtful += u32::from(round % 4 == 2 && !is_sure);
            sure += u32::from(is_sure);
            without += u32::from(!has_area(&corners));
        }
        assert!(sure > 50_000 && without > 10_000 && doubtful < 10, "{sure} {without} {doubtful}");
        let tiny = [[0.0; 3], [1e-30, 0.0, 0.0], [0.0, 1e-30, 0.0]];
        assert_eq!((surely_have_area(&tiny), has_area(&tiny)), (0, true));
    }
}
