//! Nodes: who stands on whom, and where they are at a time, in f64.

use super::Cause;
use super::clip::Clip;
use super::file::File;
use crate::math::{DAffine3, DMat3, DVec3};
use glam::DQuat;
use gltf::json::Index;
use gltf::json::animation::Property;
use std::collections::HashMap;

/// The nodes of a file.
#[derive(Debug)]
pub(super) struct Nodes {
    /// For each node the one that it stands on.
    parents: Vec<Option<usize>>,
    /// All nodes, each after its parent.
    order: Vec<usize>,
    /// Where they are without animation.
    rest: Vec<Local>,
    /// Those of the scene that is shown, in the order of a walk through it, depth first.
    pub shown: Vec<usize>,
    /// Whether the node or one that it stands on is given a place, or moves in any clip.
    pub is_placed: Vec<bool>,
}

/// A node's place on its parent.
#[derive(Clone, Copy, Debug)]
enum Local {
    /// A matrix, which is not animated.
    Matrix(DAffine3),
    /// Scale, then rotation, then translation.
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

/// Where all nodes are at one time.
#[derive(Debug)]
pub(super) struct Pose {
    /// World from node.
    pub worlds: Vec<DAffine3>,
    /// Weights of morph targets, where a clip gives them.
    pub weights: HashMap<usize, Vec<f64>>,
}

impl Local {
    fn affine(&self) -> DAffine3 {
        match *self {
            Self::Matrix(matrix) => matrix,
            Self::Parts { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
        }
    }
}

impl Nodes {
    /// Reads all nodes and the scene that is shown: the default one, else the first, else all.
    pub(super) fn read(file: &File, clips: &[Clip]) -> Result<Self, Cause> {
        let root = &file.root;
        let count = root.nodes.len();
        let mut parents = vec![None; count];
        for (i, node) in root.nodes.iter().enumerate() {
            for child in node.children.iter().flatten().map(Index::value) {
                let parent = parents.get_mut(child).ok_or_else(|| {
                    Cause::broken(format!("node {i} has child {child}, which is not there"))
                })?;
                if let Some(other) = parent.replace(i) {
                    return Err(Cause::broken(format!("node {child} is a child of nodes {other} and {i}")));
                }
            }
        }
        let roots: Vec<usize> = (0..count).filter(|&i| parents[i].is_none()).collect();
        let order = walk(file, &roots);
        if order.len() < count {
            return Err(Cause::broken("some nodes are below themselves"));
        }
        let scene = match root.scene {
            Some(scene) => Some(
                root.scenes
                    .get(scene.value())
                    .ok_or_else(|| Cause::broken(format!("scene {} is not there", scene.value())))?,
            ),
            None => root.scenes.first(),
        };
        let shown = match scene {
            None => order.clone(),
            Some(scene) => {
                let tops: Vec<usize> = scene.nodes.iter().map(Index::value).collect();
                if let Some(absent) = tops.iter().find(|&&top| top >= count) {
                    return Err(Cause::broken(format!("its scene has node {absent}, which is not there")));
                }
                let mut seen = vec![false; count];
                let mut shown = walk(file, &tops);
                shown.retain(|&i| !std::mem::replace(&mut seen[i], true));
                shown
            }
        };
        let rest: Vec<Local> = root.nodes.iter().map(rest).collect();
        if let Some(i) = rest.iter().position(|local| !local.affine().is_finite()) {
            return Err(Cause::broken(format!("node {i} has a place that is not finite")));
        }
        let mut is_placed: Vec<bool> =
            rest.iter().map(|local| local.affine() != DAffine3::IDENTITY).collect();
        for channel in clips.iter().flat_map(|clip| &clip.channels) {
            is_placed[channel.node] |= channel.property != Property::MorphTargetWeights;
        }
        for &i in &order {
            is_placed[i] |= parents[i].is_some_and(|parent| is_placed[parent]);
        }
        Ok(Self { parents, order, rest, shown, is_placed })
    }

    /// Where they are when those clips are at a time.
    pub(super) fn pose<'a>(&self, time_s: f64, clips: impl Iterator<Item = &'a Clip>) -> Pose {
        let mut locals = self.rest.clone();
        let mut weights = HashMap::new();
        for channel in clips.flat_map(|clip| &clip.channels) {
            let value = channel.track.at(time_s);
            if channel.property == Property::MorphTargetWeights {
                weights.insert(channel.node, value);
                continue;
            }
            if let Local::Matrix(matrix) = locals[channel.node] {
                // no animated node may have one; what it says is taken apart
                let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
                locals[channel.node] = Local::Parts { translation, rotation, scale };
            }
            let Local::Parts { translation, rotation, scale } = &mut locals[channel.node] else { continue };
            match (channel.property, value.as_slice()) {
                (Property::Translation, &[x, y, z]) => *translation = DVec3::new(x, y, z),
                (Property::Scale, &[x, y, z]) => *scale = DVec3::new(x, y, z),
                (Property::Rotation, &[x, y, z, w]) => *rotation = DQuat::from_xyzw(x, y, z, w),
                _ => {}
            }
        }
        let mut worlds = vec![DAffine3::IDENTITY; locals.len()];
        for &i in &self.order {
            let local = locals[i].affine();
            worlds[i] = self.parents[i].map_or(local, |parent| worlds[parent] * local);
        }
        Pose { worlds, weights }
    }
}

/// The nodes below those, themselves first, children in their order.
fn walk(file: &File, tops: &[usize]) -> Vec<usize> {
    let nodes = &file.root.nodes;
    let mut order = Vec::new();
    let mut stack: Vec<usize> = tops.iter().rev().copied().collect();
    while let Some(i) = stack.pop() {
        order.push(i);
        let children = nodes.get(i).and_then(|node| node.children.as_deref()).unwrap_or_default();
        stack.extend(children.iter().rev().map(Index::value));
        // each node has one parent, so that more than all of them are named again by the scene itself
        if order.len() > 2 * nodes.len() {
            break;
        }
    }
    order
}

fn rest(node: &gltf::json::Node) -> Local {
    let vector = |v: Option<[f32; 3]>, absent: f64| {
        v.map_or(DVec3::splat(absent), |v| DVec3::from_array(v.map(f64::from)))
    };
    if let Some(m) = node.matrix {
        let column = |k: usize| DVec3::new(m[4 * k].into(), m[4 * k + 1].into(), m[4 * k + 2].into());
        return Local::Matrix(DAffine3 {
            matrix3: DMat3::from_cols(column(0), column(1), column(2)),
            translation: column(3),
        });
    }
    let q = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |q| q.0.map(f64::from));
    let q = DQuat::from_array(q);
    Local::Parts {
        translation: vector(node.translation, 0.0),
        rotation: if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY },
        scale: vector(node.scale, 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn nodes(json: &str) -> Result<Nodes, String> {
        let json = format!(r#"{{"asset":{{"version":"2.0"}},{json}}}"#);
        let file = File::from_bytes(json.as_bytes(), Path::new("x.gltf")).unwrap();
        Nodes::read(&file, &[]).map_err(|cause| cause.0)
    }

    #[test]
    fn places_by_hand() {
        // a child one to the right of a parent that is twice as large, turned by 90° about z, and at (0, 0, 5)
        let half = 0.5f64.sqrt();
        let n = nodes(&format!(
            r#""nodes":[{{"translation":[1,0,0]}},
            {{"children":[0],"translation":[0,0,5],"rotation":[0,0,{half},{half}],"scale":[2,2,2]}},{{}}],
            "scenes":[{{"nodes":[1]}}]"#
        ))
        .unwrap();
        assert_eq!((n.shown.as_slice(), n.is_placed.as_slice()), (&[1, 0][..], &[true, true, false][..]));
        let pose = n.pose(0.0, std::iter::empty());
        let at = pose.worlds[0].transform_point3(DVec3::ZERO);
        assert!((at - DVec3::new(0.0, 2.0, 5.0)).length() < 1e-6, "{at}");
    }

    #[test]
    fn broken_hierarchies() {
        assert!(
            nodes(r#""nodes":[{"children":[1]},{"children":[0]}]"#).unwrap_err().contains("below themselves")
        );
        assert!(nodes(r#""nodes":[{"children":[0]}]"#).unwrap_err().contains("below themselves"));
        assert!(nodes(r#""nodes":[{"children":[2]},{"children":[2]},{}]"#).unwrap_err().contains("child of"));
        assert!(nodes(r#""nodes":[{"children":[7]}]"#).unwrap_err().contains("not there"));
        assert!(nodes(r#""nodes":[{}],"scenes":[{"nodes":[1]}]"#).unwrap_err().contains("not there"));
        assert!(nodes(r#""nodes":[{}],"scene":3"#).unwrap_err().contains("scene 3"));
        let twice = nodes(r#""nodes":[{"children":[1]},{}],"scenes":[{"nodes":[0,1,0]}]"#).unwrap();
        assert_eq!(twice.shown, [0, 1]);
    }
}
