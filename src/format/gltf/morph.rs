//! Morph targets: what is added to positions and normals, weighed.

use super::mesh::Target;
use crate::math::DVec3;

/// Which list of a target is added.
type List = fn(&Target) -> &[[f32; 3]];

/// Adds the weighed targets in f64; vertices beyond those of a target stay.
pub(super) fn morph(rest: &[[f32; 3]], targets: &[Target], weights: &[f64], list: List) -> Vec<DVec3> {
    let mut morphed: Vec<DVec3> = rest.iter().map(|p| wide(*p)).collect();
    for (target, &weight) in targets.iter().zip(weights) {
        if weight != 0.0 {
            for (p, &d) in morphed.iter_mut().zip(list(target)) {
                *p += weight * wide(d);
            }
        }
    }
    morphed
}

/// f32 to f64.
pub(super) fn wide(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weighed_sums() {
        let target = |x: f32| Target { positions: vec![[x, 0.0, 1.0]], normals: vec![] };
        let targets = [target(1.0), target(10.0), target(100.0)];
        let positions = |weights: &[f64]| morph(&[[1.0, 2.0, 3.0]], &targets, weights, |t| &t.positions)[0];
        // 1 + 0.5·1 − 0.25·10 = −1; 3 + 0.5 − 0.25
        assert_eq!(positions(&[0.5, -0.25]), DVec3::new(-1.0, 2.0, 3.25));
        assert_eq!(positions(&[]), DVec3::new(1.0, 2.0, 3.0));
        // more weights than targets
        assert_eq!(positions(&[0.0, 0.0, 1.0, 1.0]), DVec3::new(101.0, 2.0, 4.0));
        assert_eq!(morph(&[[1.0; 3]], &targets, &[1.0], |t| &t.normals)[0], DVec3::ONE);
    }
}
