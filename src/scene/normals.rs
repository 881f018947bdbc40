//! Derived shading normals (CONTRACT 5, "Normals"): the normalised sum of corner angle × unit triangle normal over
//! the triangles that use the same position index, in f64 and file order (the weights of Thürmer and Wüthrich 1998,
//! "Computing vertex normals from polygonal facets").
//!
//! Which corner has which normal is a function of faces and groups alone, so that a mesh that deforms keeps its
//! indices.

use super::geometry::ABSENT;
use crate::math::DVec3;
use std::collections::HashMap;

/// A position used by more triangles than this keeps flat normals where the angle between triangles decides: each
/// of its triangles is compared with each other.
pub const MAX_TRIANGLES_PER_POSITION: usize = 1024;

/// Over which triangles a normal is the mean.
#[derive(Clone, Copy, Debug)]
pub enum Smoothing<'a> {
    /// Those of the same smoothing group: one number a triangle, 0 for none.
    Groups(&'a [u32]),
    /// Those whose normals are within this angle of the triangle's own, degrees.
    AngleDeg(f64),
}

/// Normals and, for each triangle corner, which of them; [`ABSENT`] where the triangle's own serves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DerivedNormals {
    /// Unit normals, or zero: the sum had no direction, and no corner has it. It keeps the place, so that the
    /// others' indices do not move.
    pub values: Vec<[f32; 3]>,
    /// Places in `values`.
    pub corners: Vec<[u32; 3]>,
}

/// Derives normals for all corners. Position indices must be within `positions`, `groups` as long as `triangles`.
pub fn derive(positions: &[[f32; 3]], triangles: &[[u32; 3]], smoothing: Smoothing) -> DerivedNormals {
    let shape = Shape { positions, triangles };
    let mut derived = DerivedNormals { values: Vec::new(), corners: vec![[ABSENT; 3]; triangles.len()] };
    match smoothing {
        Smoothing::Groups(groups) => {
            let users = by_position(positions.len(), triangles, by_group(groups));
            let key = |user: &User| (user.position(triangles), groups[user.triangle()]);
            for run in users.chunk_by(|a, b| key(a) == key(b)) {
                derived.add(shape.mean(run), run);
            }
        }
        Smoothing::AngleDeg(angle) => {
            let least_cosine = angle.to_radians().cos();
            let users = by_position(positions.len(), triangles, (0..triangles.len() as u32).collect());
            let position = |user: &User| user.position(triangles);
            for run in users.chunk_by(|a, b| position(a) == position(b)) {
                if run.len() <= MAX_TRIANGLES_PER_POSITION {
                    shape.means_within(run, least_cosine, &mut derived);
                }
            }
        }
    }
    derived
}

/// A triangle's corner: three times the triangle, plus which.
#[derive(Clone, Copy)]
struct User(u32);

impl User {
    fn triangle(self) -> usize {
        self.0 as usize / 3
    }

    fn position(self, triangles: &[[u32; 3]]) -> u32 {
        triangles[self.triangle()][self.0 as usize % 3]
    }
}

impl DerivedNormals {
    /// One normal for all those corners; none where the sum has no direction.
    fn add(&mut self, sum: DVec3, users: &[User]) {
        let place = self.values.len() as u32;
        let normal = sum.try_normalize();
        self.values.push(normal.unwrap_or_default().as_vec3().to_array());
        if normal.is_some() {
            for user in users {
                self.corners[user.triangle()][user.0 as usize % 3] = place;
            }
        }
    }
}

/// The triangles in a group, ordered by group (of first use), then file order.
fn by_group(groups: &[u32]) -> Vec<u32> {
    let mut order = HashMap::new();
    for &group in groups.iter().filter(|&&group| group != 0) {
        let next = order.len();
        order.entry(group).or_insert(next);
    }
    let place = |triangle: u32| order.get(&groups[triangle as usize]).copied();
    let smooth: Vec<u32> = (0..groups.len() as u32).filter(|&t| place(t).is_some()).collect();
    // one group, the usual case, is in order already
    if order.len() < 2 { smooth } else { counting_sort(&smooth, order.len(), |t| place(t).unwrap_or(0)) }
}

/// The corners of `ordered` triangles, ordered by position, then as given.
fn by_position(positions: usize, triangles: &[[u32; 3]], ordered: Vec<u32>) -> Vec<User> {
    let corners: Vec<u32> = ordered.into_iter().flat_map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let sorted = counting_sort(&corners, positions, |corner| User(corner).position(triangles) as usize);
    sorted.into_iter().map(User).collect()
}

/// Stable, O(n + keys).
fn counting_sort(numbers: &[u32], keys: usize, key: impl Fn(u32) -> usize) -> Vec<u32> {
    let mut starts = vec![0; keys + 1];
    for &n in numbers {
        starts[key(n) + 1] += 1;
    }
    for k in 0..keys {
        starts[k + 1] += starts[k];
    }
    let mut sorted = vec![0; numbers.len()];
    for &n in numbers {
        let place: &mut usize = &mut starts[key(n)];
        sorted[*place] = n;
        *place += 1;
    }
    sorted
}

struct Shape<'a> {
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
}

impl Shape<'_> {
    /// The triangle's unit normal and its angle at the corner, radians; None where it has no area.
    fn normal_and_angle(&self, user: User) -> Option<(DVec3, f64)> {
        let k = user.0 as usize % 3;
        let triangle = self.triangles[user.triangle()];
        let at = |k: usize| DVec3::from(self.positions[triangle[k % 3] as usize].map(f64::from));
        let (to_next, to_last) = (at(k + 1) - at(k), at(k + 2) - at(k));
        let cross = to_next.cross(to_last);
        let normal = cross.try_normalize()?;
        Some((normal, cross.length().atan2(to_next.dot(to_last))))
    }

    fn mean(&self, users: &[User]) -> DVec3 {
        users
            .iter()
            .filter_map(|&user| self.normal_and_angle(user))
            .map(|(normal, angle)| angle * normal)
            .sum()
    }

    /// Of triangles around one position: for each the mean over those within the angle of it.
    fn means_within(&self, users: &[User], least_cosine: f64, derived: &mut DerivedNormals) {
        let terms: Vec<_> = users.iter().map(|&user| self.normal_and_angle(user)).collect();
        for (user, term) in users.iter().zip(&terms) {
            let own = term.map_or(DVec3::ZERO, |(normal, _)| normal);
            // its own is within any angle, whatever rounding makes of its square; without area it has none
            let near = |normal: DVec3| normal == own || normal.dot(own) >= least_cosine;
            let sum = terms.iter().flatten().filter(|_| term.is_some()).filter(|(normal, _)| near(*normal));
            derived.add(sum.map(|&(normal, angle)| angle * normal).sum(), std::slice::from_ref(user));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corner at the origin of a cube: one right angle in each of the three planes.
    const POSITIONS: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const CUBE_CORNER: [[u32; 3]; 3] = [[0, 1, 2], [0, 2, 3], [0, 3, 1]];

    fn normal_at(derived: &DerivedNormals, triangle: usize, corner: usize) -> [f32; 3] {
        derived.values[derived.corners[triangle][corner] as usize]
    }

    fn near(a: [f32; 3], b: [f64; 3]) {
        assert!((0..3).all(|i| (f64::from(a[i]) - b[i]).abs() < 1e-6), "{a:?}, not {b:?}");
    }

    #[test]
    fn a_cube_corner_is_its_diagonal() {
        // three unit normals weighted by 90° each: (1, 1, 1)/√3; at the end of an axis two of 45°: (0, 1, 1)/√2
        let derived = derive(&POSITIONS, &CUBE_CORNER, Smoothing::Groups(&[1, 1, 1]));
        let (third, half) = (1.0 / 3f64.sqrt(), 0.5f64.sqrt());
        for triangle in 0..3 {
            near(normal_at(&derived, triangle, 0), [third; 3]);
        }
        near(normal_at(&derived, 0, 1), [0.0, half, half]);
        assert_eq!(derived.values.len(), 4, "one a position and group");
    }

    #[test]
    fn corners_weigh_by_their_angle() {
        // Two faces in z = 0 share a corner with one in x = 0: 45° + 45° against 90°. By angle the cut does not
        // count: (1, 0, 1)/√2; unweighted it would be (1, 0, 2)/√5.
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 4]];
        let derived = derive(&positions, &triangles, Smoothing::Groups(&[7, 7, 7]));
        near(normal_at(&derived, 0, 0), [0.5f64.sqrt(), 0.0, 0.5f64.sqrt()]);
    }

    #[test]
    fn groups_keep_apart_and_none_is_flat() {
        let derived = derive(&POSITIONS, &CUBE_CORNER, Smoothing::Groups(&[1, 0, 2]));
        near(normal_at(&derived, 0, 0), [0.0, 0.0, 1.0]);
        near(normal_at(&derived, 2, 0), [0.0, 1.0, 0.0]);
        assert_eq!(derived.corners[1], [ABSENT; 3]);
        let same = derive(&POSITIONS, &CUBE_CORNER, Smoothing::Groups(&[2, 0, 2]));
        near(normal_at(&same, 0, 0), [0.0, 0.5f64.sqrt(), 0.5f64.sqrt()]);
        assert_eq!(same.corners[0][0], same.corners[2][0]);
    }

    #[test]
    fn an_angle_takes_in_what_is_within_it() {
        // the planes stand at 90° to each other
        let sharp = derive(&POSITIONS, &CUBE_CORNER, Smoothing::AngleDeg(89.9));
        near(normal_at(&sharp, 0, 0), [0.0, 0.0, 1.0]);
        near(normal_at(&sharp, 1, 0), [1.0, 0.0, 0.0]);
        let smooth = derive(&POSITIONS, &CUBE_CORNER, Smoothing::AngleDeg(90.1));
        near(normal_at(&smooth, 0, 0), [1.0 / 3f64.sqrt(); 3]);
        let own = derive(&POSITIONS, &CUBE_CORNER, Smoothing::AngleDeg(0.0));
        near(normal_at(&own, 2, 2), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn what_has_no_direction_stays_flat() {
        // a face and its back cancel out; a face without area has no normal
        let derived = derive(&POSITIONS, &[[0, 1, 2], [0, 2, 1]], Smoothing::Groups(&[1, 1]));
        assert_eq!(derived.corners, [[ABSENT; 3]; 2]);
        let derived = derive(&POSITIONS, &[[0, 1, 1], [0, 1, 2]], Smoothing::Groups(&[1, 1]));
        near(normal_at(&derived, 0, 0), [0.0, 0.0, 1.0]);
    }
}
