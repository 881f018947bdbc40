//! Clips: which channels of which animations play.

use super::animate::Track;
use super::file::File;
use super::{Cause, accessor};
use crate::warning::Warnings;
use gltf::json::accessor::Type;
use gltf::json::animation::{Animation, Interpolation, Property, Sampler};
use gltf::json::validation::Checked;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Which clips of a file play.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub enum ClipChoice {
    /// All together where no two animate the same property of the same node, else the first.
    #[default]
    Auto,
    /// All together; where two animate the same, the later one.
    All,
    /// The one of that name, or of that place from 0.
    Named(String),
}

impl ClipChoice {
    /// From the word that users give: `all`, or a name.
    pub fn from_word(word: &str) -> Self {
        if word == "all" { Self::All } else { Self::Named(word.to_owned()) }
    }
}

/// What moves one property of one node.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// The node.
    pub node: usize,
    /// What of it.
    pub property: Property,
    /// Its keys.
    pub track: Arc<Track>,
}

/// One animation.
#[derive(Clone, Debug)]
pub(super) struct Clip {
    /// Its name, or its place where it has none.
    pub name: String,
    /// What it moves.
    pub channels: Vec<Channel>,
}

/// Reads all animations. Channels that cannot be played are named in warnings.
pub(super) fn clips(file: &File, warnings: &mut Warnings) -> Result<Vec<Clip>, Cause> {
    let animations = file.root.animations.iter().enumerate();
    animations
        .map(|(i, animation)| {
            let name = animation.name.clone().unwrap_or_else(|| i.to_string());
            let mut tracks: HashMap<_, Arc<Track>> = HashMap::new();
            let mut channels = Vec::new();
            for (k, channel) in animation.channels.iter().enumerate() {
                let what = format!("animation `{name}`, channel {k}");
                let Checked::Valid(property) = channel.target.path else {
                    let text = "animation channels of unknown properties are left out";
                    warnings.add(Some(&file.path), None, text);
                    continue;
                };
                let node = channel.target.node.value();
                if node >= file.root.nodes.len() {
                    return Err(Cause::broken(format!("{what}: node {node} is not there")));
                }
                let width = width(file, node, property);
                if width == 0 {
                    warnings.add(Some(&file.path), None, "animated weights of a mesh without morph targets");
                    continue;
                }
                let sampler = channel.sampler.value();
                let key = (sampler, property == Property::Rotation, width);
                let track = match tracks.get(&key) {
                    Some(track) => Arc::clone(track),
                    None => Arc::new(track(file, animation, sampler, property, width, &what)?),
                };
                tracks.insert(key, Arc::clone(&track));
                channels.push(Channel { node, property, track });
            }
            Ok(Clip { name, channels })
        })
        .collect()
}

/// How many numbers a value of that property has; of weights, how many targets the node's mesh has.
fn width(file: &File, node: usize, property: Property) -> usize {
    match property {
        Property::Translation | Property::Scale => 3,
        Property::Rotation => 4,
        Property::MorphTargetWeights => {
            let mesh = file.root.nodes[node].mesh.and_then(|mesh| file.root.meshes.get(mesh.value()));
            let targets = |p: &gltf::json::mesh::Primitive| p.targets.as_ref().map_or(0, Vec::len);
            mesh.map_or(0, |mesh| mesh.primitives.iter().map(targets).max().unwrap_or(0))
        }
    }
}

fn track(
    file: &File,
    animation: &Animation,
    sampler: usize,
    property: Property,
    width: usize,
    what: &str,
) -> Result<Track, Cause> {
    let broken = |text: String| Cause::broken(format!("{what}: {text}"));
    let sampler: &Sampler =
        animation.samplers.get(sampler).ok_or_else(|| broken(format!("sampler {sampler} is not there")))?;
    let Checked::Valid(interpolation) = sampler.interpolation else {
        return Err(broken("its interpolation is unknown".to_owned()));
    };
    let times_s = accessor::numbers(file, sampler.input, &[Type::Scalar], what)?.values;
    if times_s.is_empty() || !times_s.iter().all(|t| t.is_finite()) || times_s.windows(2).any(|w| w[1] < w[0])
    {
        return Err(broken("its times are none, not finite or do not ascend".to_owned()));
    }
    let read = accessor::numbers(file, sampler.output, &[Type::Scalar, Type::Vec3, Type::Vec4], what)?;
    let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let wanted = times_s.len().saturating_mul(parts).saturating_mul(width);
    if read.values.len() != wanted {
        return Err(broken(format!("it has {} numbers for {wanted}", read.values.len())));
    }
    if !read.values.iter().all(|x| x.is_finite()) {
        return Err(broken("a value is not finite".to_owned()));
    }
    let is_rotation = property == Property::Rotation;
    Ok(Track { times_s, values: read.values, width, interpolation, is_rotation })
}

/// The clips that play, by their places; an error says which there are.
pub(super) fn chosen(clips: &[Clip], choice: &ClipChoice) -> Result<Vec<usize>, Cause> {
    match choice {
        ClipChoice::All => Ok((0..clips.len()).collect()),
        ClipChoice::Auto if are_disjoint(clips) => Ok((0..clips.len()).collect()),
        ClipChoice::Auto => Ok(vec![0]),
        ClipChoice::Named(name) => {
            let by_place = || name.parse().ok().filter(|&place: &usize| place < clips.len());
            let found = clips.iter().position(|clip| clip.name == *name).or_else(by_place);
            found.map(|place| vec![place]).ok_or_else(|| {
                let names: Vec<String> = clips.iter().map(|clip| format!("`{}`", clip.name)).collect();
                let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                Cause(format!("has no clip `{name}`; it has {names}"))
            })
        }
    }
}

/// Whether no two clips move the same property of the same node.
pub(super) fn are_disjoint(clips: &[Clip]) -> bool {
    let mut seen = HashSet::new();
    clips.iter().all(|clip| {
        let of_clip: HashSet<_> = clip.channels.iter().map(|c| (c.node, c.property as u8)).collect();
        of_clip.into_iter().all(|target| seen.insert(target))
    })
}

/// The greatest time of the keys of those clips, seconds.
pub(super) fn duration_s(clips: &[Clip], chosen: &[usize]) -> f64 {
    let channels = chosen.iter().filter_map(|&i| clips.get(i)).flat_map(|clip| &clip.channels);
    channels.filter_map(|c| c.track.times_s.last()).fold(0.0, |most, &t| t.max(most))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(name: &str, targets: &[(usize, Property)], last_s: f64) -> Clip {
        let track = |&(node, property)| Channel {
            node,
            property,
            track: Arc::new(Track {
                times_s: vec![0.0, last_s],
                values: vec![0.0; 6],
                width: 3,
                interpolation: Interpolation::Linear,
                is_rotation: false,
            }),
        };
        Clip { name: name.to_owned(), channels: targets.iter().map(track).collect() }
    }

    #[test]
    fn what_plays_together() {
        let apart = [
            clip("a", &[(0, Property::Translation)], 1.0),
            clip("b", &[(0, Property::Scale), (1, Property::Translation)], 2.5),
        ];
        assert_eq!(chosen(&apart, &ClipChoice::Auto).unwrap(), [0, 1]);
        assert_eq!(duration_s(&apart, &[0, 1]), 2.5);
        let same = [clip("a", &[(0, Property::Scale)], 1.0), clip("b", &[(0, Property::Scale)], 2.5)];
        assert_eq!(chosen(&same, &ClipChoice::Auto).unwrap(), [0]);
        assert_eq!(chosen(&same, &ClipChoice::All).unwrap(), [0, 1]);
        assert_eq!(chosen(&same, &ClipChoice::Named("b".to_owned())).unwrap(), [1]);
        assert_eq!(chosen(&same, &ClipChoice::Named("1".to_owned())).unwrap(), [1]);
        let error = chosen(&same, &ClipChoice::Named("c".to_owned())).unwrap_err().0;
        assert_eq!(error, "has no clip `c`; it has `a`, `b`");
        assert_eq!(chosen(&[], &ClipChoice::Auto).unwrap(), [0; 0]);
    }
}
