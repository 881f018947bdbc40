//! Coherent rays side by side, and the interval of them all.

use super::Ray;
use super::lanes::{Lanes, Lanes8, per_axis};
use super::slab::{EXIT_FACTOR, SlabRay, inverse};
use super::tree::WIDTH;
use super::triangle::{ShearRay, last_axis, shear, sheared_axes};

/// Rays in a packet.
pub(crate) const RAYS: usize = GROUPS * WIDTH;
pub(crate) const GROUPS: usize = 2;

/// The slab tests of a packet's rays. All meet the sides of boxes in the same order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PacketSlabs<L> {
    /// By axis and ray; a packet that is not full repeats its first ray.
    origin: [[f32; RAYS]; 3],
    direction: [[f32; RAYS]; 3],
    inverse: [[f32; RAYS]; 3],
    pub(crate) groups: [SlabRay<L>; GROUPS],
    pub(crate) interval: Interval<L>,
}

impl<L: Lanes8> PacketSlabs<L> {
    /// None without rays, and where they are not finite or do not meet the sides of boxes in the same order.
    #[inline(always)]
    pub(crate) fn new(rays: &[Ray]) -> Option<Self> {
        let (first, len) = (rays.first()?, rays.len().min(RAYS));
        let mut origin = per_axis(|k| [first.origin[k]; RAYS]);
        let mut direction = per_axis(|k| [first.direction[k]; RAYS]);
        for (i, ray) in rays[..len].iter().enumerate().skip(1) {
            for k in 0..3 {
                origin[k][i] = ray.origin[k];
                direction[k][i] = ray.direction[k];
            }
        }
        let mut inverses = direction;
        for axis in &mut inverses {
            for d in axis {
                *d = inverse(*d);
            }
        }
        let [least_origin, greatest_origin] = extremes::<L>(&origin);
        let [least_inverse, greatest_inverse] = extremes::<L>(&inverses);
        let mut near_side = [0; 3];
        for k in 0..3 {
            near_side[k] = usize::from(least_inverse[k] < 0.0);
            if near_side[k] == 1 && greatest_inverse[k] > 0.0 {
                return None;
            }
        }
        if !(are_finite::<L>(&origin) && are_finite::<L>(&direction)) {
            return None;
        }
        let group = |g: usize| {
            let load = |from: &[[f32; RAYS]; 3]| per_axis(|k| L::load(&from[k].as_chunks::<WIDTH>().0[g]));
            SlabRay { origin: load(&origin), inverse: load(&inverses), near_side }
        };
        let [x, y, z] = near_side;
        let origins = [least_origin, greatest_origin];
        let near = [origins[1 - x][0], origins[1 - y][1], origins[1 - z][2]];
        let far = [origins[x][0], origins[y][1], origins[z][2]];
        let splat = |p: [f32; 3]| per_axis(|k| L::splat(p[k]));
        let interval = Interval {
            near_origin: splat(near),
            far_origin: splat(far),
            least_inverse: splat(least_inverse),
            greatest_inverse: splat(greatest_inverse),
            near_side,
        };
        Some(Self { origin, direction, inverse: inverses, groups: [group(0), group(1)], interval })
    }

    /// Whether these are the axes of every ray's sheared space.
    #[inline(always)]
    fn share_axes(&self, [x, y, z]: [usize; 3]) -> bool {
        let mut are_shared = true;
        for g in 0..GROUPS {
            let size = per_axis(|k| {
                let d = L::load(&self.direction[k].as_chunks::<WIDTH>().0[g]);
                d.max(L::splat(0.0).sub(d))
            });
            // strictly, so that it does not matter which is taken of two that are as long
            are_shared &= size[x].lt(size[z]) & size[y].lt(size[z]) == 0xff;
        }
        are_shared
    }

    /// One of the rays.
    #[inline(always)]
    pub(crate) fn ray(&self, i: usize) -> SlabRay<f32> {
        SlabRay {
            origin: per_axis(|k| self.origin[k][i]),
            inverse: per_axis(|k| self.inverse[k][i]),
            near_side: self.interval.near_side,
        }
    }
}

/// The edge tests of a packet's rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PacketShears {
    /// By axis of the sheared space and ray.
    shear: [[f32; RAYS]; 3],
    axes: Axes,
}

/// The axes of the sheared space; where not all rays have the same, the last of each.
#[derive(Clone, Copy, Debug)]
enum Axes {
    Shared([usize; 3]),
    ByRay([u8; RAYS]),
}

impl PacketShears {
    #[inline(always)]
    pub(crate) fn new<L: Lanes8>(of: &PacketSlabs<L>) -> Self {
        let last = |i: usize| last_axis(per_axis(|k| of.direction[k][i]));
        let mut shears = [[0.0; RAYS]; 3];
        let first = sheared_axes(last(0));
        if of.share_axes(first) {
            for g in 0..GROUPS {
                let direction = first.map(|k| L::load(&of.direction[k].as_chunks::<WIDTH>().0[g]));
                for (to, lanes) in shears.iter_mut().zip(shear(direction)) {
                    to.as_chunks_mut::<WIDTH>().0[g] = lanes.store();
                }
            }
            return Self { shear: shears, axes: Axes::Shared(first) };
        }
        let mut by_ray = [0; RAYS];
        for (i, of_ray) in by_ray.iter_mut().enumerate() {
            *of_ray = last(i) as u8;
            let shear = shear(sheared_axes(last(i)).map(|k| of.direction[k][i]));
            for k in 0..3 {
                shears[k][i] = shear[k];
            }
        }
        Self { shear: shears, axes: Axes::ByRay(by_ray) }
    }

    /// One of the rays in all lanes.
    #[inline(always)]
    pub(crate) fn ray<L: Lanes8>(&self, slabs: &PacketSlabs<L>, i: usize) -> ShearRay<L> {
        let axes = match &self.axes {
            Axes::Shared(axes) => *axes,
            Axes::ByRay(last) => sheared_axes(usize::from(last[i])),
        };
        ShearRay {
            axes,
            origin: per_axis(|k| L::splat(slabs.origin[axes[k]][i])),
            shear: per_axis(|k| L::splat(self.shear[k][i])),
        }
    }

    /// Eight of the rays side by side; None where not all of the packet have the same axes.
    #[inline(always)]
    pub(crate) fn group<L: Lanes8>(&self, slabs: &PacketSlabs<L>, g: usize) -> Option<ShearRay<L>> {
        let Axes::Shared(axes) = self.axes else { return None };
        Some(ShearRay {
            axes,
            origin: per_axis(|k| slabs.groups[g].origin[axes[k]]),
            shear: per_axis(|k| L::load(&self.shear[k].as_chunks::<WIDTH>().0[g])),
        })
    }
}

/// The least and the greatest on each axis.
#[inline(always)]
fn extremes<L: Lanes8>(values: &[[f32; RAYS]; 3]) -> [[f32; 3]; 2] {
    [per_axis(|k| fold(&values[k], L::min, Lanes::min)), per_axis(|k| fold(&values[k], L::max, Lanes::max))]
}

/// The greatest float of a packet's.
#[inline(always)]
pub(crate) fn greatest<L: Lanes8>(values: &[f32; RAYS]) -> f32 {
    fold(values, L::max, Lanes::max)
}

#[inline(always)]
fn fold<L: Lanes8>(values: &[f32; RAYS], wide: impl Fn(L, L) -> L, narrow: impl Fn(f32, f32) -> f32) -> f32 {
    let groups = values.as_chunks::<WIDTH>().0;
    let mut lanes = wide(L::load(&groups[0]), L::load(&groups[1])).store();
    for half in [4, 2, 1] {
        for i in 0..half {
            lanes[i] = narrow(lanes[i], lanes[i + half]);
        }
    }
    lanes[0]
}

/// Whether none is infinite or NaN: x − x is 0 for the others only.
#[inline(always)]
fn are_finite<L: Lanes8>(values: &[[f32; RAYS]; 3]) -> bool {
    let mut sum = L::splat(0.0);
    for group in values.as_flattened().as_chunks::<WIDTH>().0 {
        let x = L::load(group);
        sum = sum.add(x.sub(x));
    }
    sum.le(L::splat(0.0)) == 0xff
}

/// All rays of a packet at once: the least and greatest of their origins and inverse directions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval<L> {
    /// The origins from which near sides are nearest,
    near_origin: [L; 3],
    /// and those from which far sides are farthest.
    far_origin: [L; 3],
    least_inverse: [L; 3],
    greatest_inverse: [L; 3],
    near_side: [usize; 3],
}

impl<L: Lanes8> Interval<L> {
    /// Bounds of where the rays enter and leave eight boxes: none enters before or leaves after them, as roundings are
    /// monotonic.
    #[inline(always)]
    pub(crate) fn pass(&self, planes: &[[[f32; WIDTH]; 3]; 2]) -> (L, L) {
        let [x, y, z] = self.near_side;
        let near = |side: usize, k: usize| {
            let d = L::load(&planes[side][k]).sub(self.near_origin[k]);
            d.mul(self.least_inverse[k]).min(d.mul(self.greatest_inverse[k]))
        };
        let far = |side: usize, k: usize| {
            let d = L::load(&planes[1 - side][k]).sub(self.far_origin[k]);
            d.mul(self.least_inverse[k]).max(d.mul(self.greatest_inverse[k]))
        };
        let entry = near(x, 0).max(near(y, 1)).max(near(z, 2).max(L::splat(0.0)));
        let exit = far(x, 0).min(far(y, 1)).min(far(z, 2));
        (entry, exit.mul(L::splat(EXIT_FACTOR)))
    }
}
