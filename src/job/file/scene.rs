//! What the job file says of cameras, lights, materials and transforms.

use super::fields::{
    Fields, Read, about, color, direction, elements, entries, integer, list, number, parsed, text, triple,
    unexpected, vector, whole,
};
use super::node::{Node, Value, Wrong};
use crate::format::{MaterialOverride, mtl_word_accepts, mtl_word_takes, mtl_words};
use crate::job::options::{CameraChoice, LightChoice, Options, limits};
use crate::job::settings::{FALLOFFS, INTERPOLATIONS, up_word};
use crate::job::track::{CameraPose, CameraTrack, Key, Placed, Transform};
use crate::job::words::{listed, nearest, one_of};
use crate::math::{DVec3, Vec3};
use crate::scene::{Falloff, Light};
use std::path::Path;

fn is_auto(node: &Node) -> bool {
    matches!(&node.value, Value::Text(text) if text == "auto")
}

/// ` (did you mean `auto`?)` where a word is near.
fn or_auto(node: &Node) -> String {
    let Value::Text(word) = &node.value else { return String::new() };
    nearest(word, std::iter::once("auto"))
}

/// What is up: a word or three numbers.
pub(super) fn up(node: &Node) -> Read<DVec3> {
    if let Value::Text(_) = node.value { parsed(up_word)(node) } else { direction(node) }
}

/// `auto`, a camera, keys of a camera, or what is to be changed of the auto camera.
pub(super) fn camera(node: &Node, options: &mut Options) -> Read<CameraChoice> {
    match node.value {
        _ if is_auto(node) => return Ok(CameraChoice::Auto),
        Value::Map(_) => {}
        _ => return Err(unexpected(node, &format!("`auto` or a map{}", or_auto(node)))),
    }
    let map = Fields::of(node, &[&["eye", "look_at", "up", "fov", "keys", "interpolate", "gltf"]])?;
    if let Some(gltf) = map.node("gltf") {
        if let Some((other, _)) =
            entries(node)?.iter().find(|(key, _)| key.value != "gltf" && key.value != "fov")
        {
            let text = format!("a glTF camera has no `{}` of its own; remove it", other.value);
            return Err(Wrong::at(other, text));
        }
        let fov_deg = map.get("fov", number(limits::FOV))?;
        return Ok(CameraChoice::Gltf { name: text(gltf)?, fov_deg });
    }
    let (up, fov_deg) = (map.get("up", up)?, map.get("fov", number(limits::FOV))?);
    let interpolation = map.get("interpolate", parsed(|w| one_of(&INTERPOLATIONS, w)))?.unwrap_or_default();
    let is_placed = map.node("eye").or(map.node("look_at")).is_some();
    let keys = match map.node("keys") {
        Some(_) if is_placed => {
            return Err(Wrong::at(node, "a camera with keys has eye and look_at in the keys"));
        }
        Some(_) => map.need("keys", |node| keys(node, &["eye", "look_at", "up", "fov"], pose))?,
        None if is_placed => vec![Key { frame: 0, value: pose(&map, node)? }],
        None => {
            options.up = up.or(options.up);
            options.fov = fov_deg.or(options.fov);
            return Ok(CameraChoice::Auto);
        }
    };
    let filled =
        |pose: CameraPose| CameraPose { up: pose.up.or(up), fov_deg: pose.fov_deg.or(fov_deg), ..pose };
    let keys = keys.into_iter().map(|k| Key { value: filled(k.value), ..k }).collect();
    Ok(CameraChoice::Given(CameraTrack { keys, interpolation }))
}

fn pose(map: &Fields<'_>, node: &Node) -> Read<CameraPose> {
    let pose = CameraPose {
        eye: map.need("eye", vector)?,
        look_at: map.need("look_at", vector)?,
        up: map.get("up", up)?,
        fov_deg: map.get("fov", number(limits::FOV))?,
    };
    if pose.eye == pose.look_at {
        return Err(Wrong::at(node, "eye and look_at are the same point"));
    }
    Ok(pose)
}

/// A list of keys in the order of their frames: at least one, and no two at a frame.
fn keys<T>(node: &Node, known: &[&str], read: impl Fn(&Fields<'_>, &Node) -> Read<T>) -> Read<Vec<Key<T>>> {
    let mut keys: Vec<Key<T>> = Vec::new();
    for node in elements(node)? {
        let map = Fields::of(node, &[&["frame"], known])?;
        let frame = map.need("frame", integer)?;
        if keys.iter().any(|k| k.frame == frame) {
            return Err(Wrong::at(node, format!("there is another key at frame {frame}; remove one")));
        }
        keys.push(Key { frame, value: read(&map, node)? });
    }
    if keys.is_empty() {
        return Err(Wrong::at(node, "the list of keys is empty"));
    }
    keys.sort_by_key(|key| key.frame);
    Ok(keys)
}

/// A transform, or keys of one.
pub(super) fn placed(node: &Node) -> Read<Placed> {
    const PARTS: [&str; 3] = ["translate", "rotate", "scale"];
    let map = Fields::of(node, &[&PARTS, &["keys"]])?;
    let transform = |map: &Fields<'_>, _: &Node| {
        Ok(Transform {
            translate: map.get("translate", vector)?.unwrap_or(DVec3::ZERO),
            rotate_deg: map.get("rotate", vector)?.unwrap_or(DVec3::ZERO),
            scale: map.get("scale", triple)?.unwrap_or(DVec3::ONE),
        })
    };
    let keys = match map.get("keys", |node| keys(node, &PARTS, transform))? {
        None => vec![Key { frame: 0, value: transform(&map, node)? }],
        Some(_) if PARTS.iter().any(|part| map.node(part).is_some()) => {
            let text = "a transform with keys has translate, rotate and scale in the keys";
            return Err(Wrong::at(node, text));
        }
        Some(keys) => keys,
    };
    Ok(Placed { keys })
}

/// `auto`, or a list of lights.
pub(super) fn lights(node: &Node) -> Read<LightChoice> {
    match node.value {
        _ if is_auto(node) => Ok(LightChoice::Auto),
        Value::List(_) => list(light)(node).map(LightChoice::Given),
        _ => Err(unexpected(node, &format!("`auto`, or a list of lights, [] for none{}", or_auto(node)))),
    }
}

fn light(node: &Node) -> Read<Light> {
    let map = Fields::of(node, &[&["point", "directional", "spot", "area"]])?;
    if entries(node)?.len() != 1 {
        return Err(Wrong::at(node, "each light is one of point, directional, spot, area"));
    }
    let point = map.get("point", point)?;
    let directional = map.get("directional", directional)?;
    let spot = map.get("spot", spot)?;
    let area = map.get("area", area)?;
    point.or(directional).or(spot).or(area).ok_or_else(|| Wrong::at(node, "is no light"))
}

fn shine(map: &Fields<'_>) -> Read<(Vec3, f32)> {
    let intensity = map.get("intensity", number(limits::COLOR))?.unwrap_or(1.0) as f32;
    Ok((map.get("color", color)?.unwrap_or(Vec3::ONE), intensity))
}

fn falloff(map: &Fields<'_>) -> Read<Falloff> {
    Ok(map.get("falloff", parsed(|w| one_of(&FALLOFFS, w)))?.unwrap_or_default())
}

fn point(node: &Node) -> Read<Light> {
    let map = Fields::of(node, &[&["position", "color", "intensity", "falloff"]])?;
    let (color, intensity) = shine(&map)?;
    let position = map.need("position", vector)?.as_vec3();
    Ok(Light::Point { position, color, intensity, falloff: falloff(&map)? })
}

fn directional(node: &Node) -> Read<Light> {
    let map = Fields::of(node, &[&["direction", "color", "intensity"]])?;
    let (color, intensity) = shine(&map)?;
    Ok(Light::Directional { direction: map.need("direction", direction)?.as_vec3(), color, intensity })
}

fn spot(node: &Node) -> Read<Light> {
    let known = ["position", "direction", "inner", "outer", "color", "intensity", "falloff"];
    let map = Fields::of(node, &[&known])?;
    let (color, intensity) = shine(&map)?;
    let half_angle = |key| map.need(key, number(limits::HALF_ANGLE));
    let (inner, outer) = (half_angle("inner")?, half_angle("outer")?);
    if inner > outer {
        return Err(Wrong::at(node, format!("inner is {inner}, more than outer, {outer}")));
    }
    Ok(Light::Spot {
        position: map.need("position", vector)?.as_vec3(),
        direction: map.need("direction", direction)?.as_vec3(),
        inner_deg: inner as f32,
        outer_deg: outer as f32,
        color,
        intensity,
        falloff: falloff(&map)?,
    })
}

/// All triangles that glow.
fn area(node: &Node) -> Read<Light> {
    let map = Fields::of(node, &[&["material", "samples"]])?;
    map.get("material", parsed(|w| one_of(&[("all", ())], w)))?;
    Ok(Light::Area { samples: map.get("samples", whole(limits::SAMPLES))?.unwrap_or(1.0) as u32 })
}

/// For each material by name the words of an MTL and what stands behind them.
pub(super) fn materials(node: &Node, said_in: &Path) -> Read<Vec<MaterialOverride>> {
    let mut materials = Vec::new();
    for (name, node) in entries(node)? {
        let words = statements(node).map_err(|wrong| about(&name.value, wrong))?;
        let name = name.value.clone().into_bytes();
        materials.push(MaterialOverride { name, words, said_in: said_in.to_path_buf() });
    }
    Ok(materials)
}

/// The words for one material, each with a value that it takes.
fn statements(node: &Node) -> Read<Vec<(String, String)>> {
    let mut words = Vec::new();
    for (word, node) in entries(node)? {
        let Some(wanted) = mtl_word_takes(&word.value) else {
            let hint = nearest(&word.value, mtl_words());
            let allowed = listed(mtl_words());
            let text = format!("`{}` is not a word of an MTL{hint}; allowed: {allowed}", word.value);
            return Err(Wrong::at(word, text));
        };
        let about_word = |wrong| about(&word.value, wrong);
        let value = match node.value {
            Value::Number(_) | Value::Long(_) | Value::Text(_) | Value::List(_) => {
                behind(node).map_err(about_word)?
            }
            _ => return Err(about_word(unexpected(node, &wanted))),
        };
        if !mtl_word_accepts(&word.value, &value) {
            return Err(about_word(unexpected(node, &wanted)));
        }
        words.push((word.value.clone(), value));
    }
    Ok(words)
}

/// A number, text, or a list of them, as an MTL has it behind a word.
fn behind(node: &Node) -> Read<String> {
    match &node.value {
        Value::Number(_) | Value::Long(_) => Ok(number(limits::NUMBER)(node)?.to_string()),
        Value::List(_) => Ok(list(behind)(node)?.join(" ")),
        _ => text(node),
    }
}
