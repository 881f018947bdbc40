//! Skins: vertices that follow joints (glTF 2.0, 3.7.3.3), linear blend skinning in f64.

use super::file::File;
use super::mesh::Influences;
use super::{Cause, accessor};
use crate::math::{DAffine3, DMat3, DVec3};
use gltf::json::Index;
use gltf::json::accessor::Type;

/// A skin.
#[derive(Debug)]
pub(super) struct Skin {
    /// The nodes that are its joints.
    joints: Vec<usize>,
    /// Joint from mesh, at rest.
    inverse_binds: Vec<DAffine3>,
}

/// Reads a skin.
pub(super) fn skin(file: &File, index: usize) -> Result<Skin, Cause> {
    let broken = |text: &str| Cause::broken(format!("skin {index} {text}"));
    let skin = file.root.skins.get(index).ok_or_else(|| broken("is named and is not there"))?;
    let joints: Vec<usize> = skin.joints.iter().map(Index::value).collect();
    if joints.iter().any(|&joint| joint >= file.root.nodes.len()) {
        return Err(broken("has a joint that is not there"));
    }
    let inverse_binds = match skin.inverse_bind_matrices {
        None => vec![DAffine3::IDENTITY; joints.len()],
        Some(accessor) => {
            let read = accessor::numbers(file, accessor, &[Type::Mat4], &format!("skin {index}"))?;
            read.values.as_chunks::<16>().0.iter().map(matrix).collect()
        }
    };
    if inverse_binds.len() < joints.len() {
        return Err(broken("has fewer inverse bind matrices than joints"));
    }
    if !inverse_binds.iter().all(DAffine3::is_finite) {
        return Err(broken("has an inverse bind matrix that is not finite"));
    }
    Ok(Skin { joints, inverse_binds })
}

fn matrix(m: &[f64; 16]) -> DAffine3 {
    let column = |k: usize| DVec3::new(m[4 * k], m[4 * k + 1], m[4 * k + 2]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

impl Skin {
    /// How many joints it has.
    pub(super) fn joints(&self) -> usize {
        self.joints.len()
    }

    /// World from mesh, for each joint.
    pub(super) fn matrices(&self, worlds: &[DAffine3]) -> Vec<DAffine3> {
        self.joints.iter().zip(&self.inverse_binds).map(|(&joint, bind)| worlds[joint] * *bind).collect()
    }
}

/// Moves vertices to the world; one that no joint moves stays. Normals, where there are any, turn with them: by the
/// cofactors of the blended matrix, which are its inverse transpose but for a factor, also where it has no inverse.
pub(super) fn skinned(
    positions: &mut [DVec3],
    normals: &mut [DVec3],
    influences: &Influences,
    matrices: &[DAffine3],
) {
    let mut start = 0;
    for (vertex, &end) in influences.ends.iter().enumerate() {
        let own = &influences.list[start as usize..end as usize];
        start = end;
        if own.is_empty() {
            continue;
        }
        let (mut linear, mut moved) = (DMat3::ZERO, DVec3::ZERO);
        for &(joint, weight) in own {
            let matrix = &matrices[joint as usize];
            linear += matrix.matrix3 * weight;
            moved += matrix.translation * weight;
        }
        if let Some(p) = positions.get_mut(vertex) {
            *p = linear * *p + moved;
        }
        if let Some(n) = normals.get_mut(vertex) {
            *n = (cofactors(&linear) * *n) * linear.determinant().signum();
        }
    }
}

fn cofactors(m: &DMat3) -> DMat3 {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn a_vertex_between_two_joints() {
        // one joint stays, one moves by (0, 4, 0) and doubles: (1, 0, 0) goes to (1, 0, 0) and (2, 4, 0)
        let matrices = [
            DAffine3::IDENTITY,
            DAffine3::from_scale_rotation_translation(
                DVec3::splat(2.0),
                DQuat::IDENTITY,
                DVec3::new(0.0, 4.0, 0.0),
            ),
        ];
        let influences = Influences { ends: vec![2, 3, 3], list: vec![(0, 0.25), (1, 0.75), (1, 1.0)] };
        let mut p = [DVec3::X; 3];
        skinned(&mut p, &mut [], &influences, &matrices);
        assert_eq!(p, [DVec3::new(1.75, 3.0, 0.0), DVec3::new(2.0, 4.0, 0.0), DVec3::X]);
    }

    #[test]
    fn normals_stay_perpendicular() {
        // the plane x + y = 0, stretched along x by 2: x/2 + y = 0; mirrored in x: y − x = 0
        let normal = |scale: DVec3| {
            let matrices = [DAffine3::from_scale(scale)];
            let mut n = [DVec3::new(1.0, 1.0, 0.0)];
            let influences = Influences { ends: vec![1], list: vec![(0, 1.0)] };
            skinned(&mut [DVec3::ZERO], &mut n, &influences, &matrices);
            n[0].normalize()
        };
        let near = |a: DVec3, b: DVec3| assert!((a - b.normalize()).length() < 1e-12, "{a} {b}");
        near(normal(DVec3::new(2.0, 1.0, 1.0)), DVec3::new(0.5, 1.0, 0.0));
        near(normal(DVec3::new(-1.0, 1.0, 1.0)), DVec3::new(-1.0, 1.0, 0.0));
    }
}
