//! Polygons to triangles: the fan from the first corner where all its triangles face the way the polygon does,
//! else ear clipping in the polygon's plane. All in f64, relative to the first corner.

use crate::math::DVec3;
use glam::DVec2;

/// A polygon of more corners than this is a fan, concave or not: cutting ears takes the square of their number.
pub(super) const MAX_EAR_CORNERS: usize = 16_384;

/// Appends the n − 2 triangles of a polygon of n corners, as indices of `corners`.
///
/// `corners`: its position indices, all within `positions`.
pub(super) fn triangulate(positions: &[[f32; 3]], corners: &[u32], out: &mut Vec<[u32; 3]>) {
    let [a, b, c, rest @ ..] = corners else { return };
    let at = |corner: u32| DVec3::from(positions[corner as usize].map(f64::from));
    let origin = at(*a);
    match rest {
        [] => out.push([0, 1, 2]),
        [d] => {
            let (b, c, d) = (at(*b) - origin, at(*c) - origin, at(*d) - origin);
            let (first, second) = (b.cross(c), c.cross(d));
            let normal = first + second;
            if (first.dot(normal) > 0.0 && second.dot(normal) > 0.0) || normal == DVec3::ZERO {
                out.extend([[0, 1, 2], [0, 2, 3]]);
            } else {
                clip_ears(&in_plane(&[DVec3::ZERO, b, c, d], normal), out);
            }
        }
        _ => {
            // the sum over the fan is Newell's sum over the edges (Sutherland et al. 1974), seen from the first corner
            let point = |corner: &u32| at(*corner) - origin;
            let fan = || corners[1..].windows(2).map(|pair| point(&pair[0]).cross(point(&pair[1])));
            let normal: DVec3 = fan().sum();
            let is_fan = normal == DVec3::ZERO || fan().all(|n| n.dot(normal) > 0.0);
            if is_fan || corners.len() > MAX_EAR_CORNERS {
                out.extend((1..corners.len() as u32 - 1).map(|i| [0, i, i + 1]));
            } else {
                let points: Vec<DVec3> = corners.iter().map(point).collect();
                clip_ears(&in_plane(&points, normal), out);
            }
        }
    }
}

/// Coordinates in the plane with that normal, in which the polygon runs counter-clockwise.
fn in_plane(points: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    let (u, v) = normal.normalize_or(DVec3::Z).any_orthonormal_pair();
    points.iter().map(|p| DVec2::new(p.dot(u), p.dot(v))).collect()
}

/// What a corner of the remaining polygon is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Corner {
    /// Convex, and the line between its neighbours lies inside.
    Ear,
    /// Convex, with something in the way.
    Blocked,
    /// On the line of its neighbours.
    Flat,
    /// Turning the other way.
    Reflex,
}

/// A polygon from which corners are taken, as a ring.
struct Ring<'a> {
    points: &'a [DVec2],
    previous: Vec<u32>,
    next: Vec<u32>,
    corners: Vec<Corner>,
}

/// Ear clipping (Meisters 1975). Cutting an ear changes what its two neighbours are and no other corner, so that the
/// whole is O(n²). Where a polygon crosses itself there may be no ear; a flat corner, else a convex one, else any
/// is cut then, so that there are n − 2 triangles always.
fn clip_ears(points: &[DVec2], out: &mut Vec<[u32; 3]>) {
    let count = points.len() as u32;
    let mut ring = Ring {
        points,
        previous: (0..count).map(|i| (i + count - 1) % count).collect(),
        next: (0..count).map(|i| (i + 1) % count).collect(),
        corners: vec![Corner::Reflex; points.len()],
    };
    // first all turns, then what is in the way: only corners that are not convex can be
    for i in 0..count {
        ring.corners[i as usize] = ring.turn(i);
    }
    for i in 0..count {
        ring.corners[i as usize] = ring.judge(i);
    }
    let mut at = 0;
    for _ in 0..count - 2 {
        let corner = ring.to_cut(at);
        let (previous, next) = (ring.previous[corner as usize], ring.next[corner as usize]);
        out.push([previous, corner, next]);
        ring.next[previous as usize] = next;
        ring.previous[next as usize] = previous;
        for neighbour in [previous, next] {
            ring.corners[neighbour as usize] = ring.turn(neighbour);
        }
        for neighbour in [previous, next] {
            ring.corners[neighbour as usize] = ring.judge(neighbour);
        }
        // a step aside, else the ears form a fan of slivers
        at = ring.next[next as usize];
    }
}

impl Ring<'_> {
    /// The corner to cut next, searched from `at` on.
    fn to_cut(&self, at: u32) -> u32 {
        let around =
            || std::iter::successors(Some(at), |&i| Some(self.next[i as usize]).filter(|&i| i != at));
        let first = |kind| around().find(|&i| self.corners[i as usize] == kind);
        first(Corner::Ear).or_else(|| first(Corner::Flat)).or_else(|| first(Corner::Blocked)).unwrap_or(at)
    }

    fn triangle(&self, i: u32) -> [DVec2; 3] {
        [self.previous[i as usize], i, self.next[i as usize]].map(|i| self.points[i as usize])
    }

    /// What a corner is by its own angle; a convex one counts as an ear.
    fn turn(&self, i: u32) -> Corner {
        let area = doubled_area(self.triangle(i));
        if area > 0.0 {
            Corner::Ear
        } else if area == 0.0 {
            Corner::Flat
        } else {
            Corner::Reflex
        }
    }

    /// What a corner is, of those whose turns are known.
    fn judge(&self, i: u32) -> Corner {
        let turn = self.turn(i);
        if turn != Corner::Ear {
            return turn;
        }
        let triangle = self.triangle(i);
        let (min, max) =
            (triangle[0].min(triangle[1]).min(triangle[2]), triangle[0].max(triangle[1]).max(triangle[2]));
        let last = self.previous[i as usize];
        let mut other = self.next[self.next[i as usize] as usize];
        while other != last {
            let kind = self.corners[other as usize];
            if kind == Corner::Reflex || kind == Corner::Flat {
                let p = self.points[other as usize];
                let near = p.cmpge(min).all() && p.cmple(max).all();
                // a bridge to a hole passes its corners twice: what lies on a corner is not in the way
                if near && !triangle.contains(&p) && inside(triangle, p) {
                    return Corner::Blocked;
                }
            }
            other = self.next[other as usize];
        }
        Corner::Ear
    }
}

/// Twice the signed area, positive counter-clockwise.
fn doubled_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether a point is in a counter-clockwise triangle or on its border.
fn inside([a, b, c]: [DVec2; 3], p: DVec2) -> bool {
    [[a, b, p], [b, c, p], [c, a, p]].into_iter().all(|t| doubled_area(t) >= 0.0)
}

#[cfg(test)]
mod tests;
