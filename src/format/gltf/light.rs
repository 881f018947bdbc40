//! Lights (`KHR_lights_punctual`) and cameras.
//!
//! A point or spot light's intensity, candela, is ours with 1/d²; a directional one's, lux, is ours as it stands. Our
//! diffuse term has no 1/π, so that surfaces are π times as bright as glTF's formulas make them.

use super::file::File;
use crate::math::{DAffine3, DVec3, Vec3};
use crate::scene::{Camera, Falloff, Light};
use crate::warning::Warnings;
use gltf::json;
use gltf::json::extensions::scene::khr_lights_punctual as punctual;
use gltf::json::validation::Checked;

/// A camera and what it is called.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The camera's name, else its node's, else `camera N`.
    pub name: String,
    /// Its node's name; None where it has none.
    pub node: Option<String>,
    /// Where it is at that time.
    pub camera: Camera,
}

/// A light or camera at a node; None where there is none or it cannot be mapped, which `check` says.
pub(super) fn light(file: &File, node: &json::Node, world: &DAffine3) -> Option<Light> {
    let light = given_light(file, node)?;
    let Checked::Valid(kind) = light.type_ else { return None };
    let position = world.translation.as_vec3();
    let direction = (world.matrix3 * DVec3::NEG_Z).normalize_or(DVec3::NEG_Z).as_vec3();
    let color = Vec3::from_array(light.color);
    let intensity = light.intensity;
    let falloff = Falloff::InverseSquare;
    if !position.is_finite() || !color.is_finite() || !intensity.is_finite() {
        return None;
    }
    match kind {
        punctual::Type::Point => Some(Light::Point { position, color, intensity, falloff }),
        punctual::Type::Directional => Some(Light::Directional { direction, color, intensity }),
        punctual::Type::Spot => {
            let spot = light.spot.as_ref()?;
            let degrees = |angle: f32| f64::from(angle).to_degrees().clamp(0.0, 90.0) as f32;
            let (inner_deg, outer_deg) = (degrees(spot.inner_cone_angle), degrees(spot.outer_cone_angle));
            Some(Light::Spot { position, direction, inner_deg, outer_deg, color, intensity, falloff })
        }
    }
}

fn given_light<'a>(file: &'a File, node: &json::Node) -> Option<&'a punctual::Light> {
    let index = node.extensions.as_ref()?.khr_lights_punctual.as_ref()?.light.value();
    file.root.extensions.as_ref()?.khr_lights_punctual.as_ref()?.lights.get(index)
}

/// The perspective camera at a node: it looks along −z, +y is up.
pub(super) fn camera(file: &File, node: &json::Node, world: &DAffine3) -> Option<NamedCamera> {
    let index = node.camera?.value();
    let given = file.root.cameras.get(index)?;
    let perspective = perspective(given)?;
    let eye = world.translation;
    let [back, up] = [DVec3::Z, DVec3::Y].map(|axis| (world.matrix3 * axis).normalize_or(axis));
    if !eye.is_finite() {
        return None;
    }
    Some(NamedCamera {
        name: given.name.clone().or_else(|| node.name.clone()).unwrap_or_else(|| format!("camera {index}")),
        node: node.name.clone(),
        camera: Camera { eye, look_at: eye - back, up, fov_deg: f64::from(perspective.yfov).to_degrees() },
    })
}

fn perspective(camera: &json::Camera) -> Option<&json::camera::Perspective> {
    let is_perspective = camera.type_ == Checked::Valid(json::camera::Type::Perspective);
    let usable = |yfov: f32| yfov > 0.0 && yfov < std::f32::consts::PI;
    camera.perspective.as_ref().filter(|p| is_perspective && usable(p.yfov))
}

/// Names what nodes have and is not mapped.
pub(super) fn check(file: &File, warnings: &mut Warnings) {
    let mut warn = |text: &str| warnings.add(Some(&file.path), None, text);
    for node in &file.root.nodes {
        if let Some(camera) = node.camera {
            match file.root.cameras.get(camera.value()) {
                Some(camera) if perspective(camera).is_some() => {}
                Some(camera) if camera.type_ == Checked::Valid(json::camera::Type::Orthographic) => {
                    warn("orthographic cameras are not supported");
                }
                _ => warn("a camera is broken and left out"),
            }
        }
        let names_light = node.extensions.as_ref().is_some_and(|e| e.khr_lights_punctual.is_some());
        match given_light(file, node) {
            Some(light) if light.range.is_some() => warn("the range of a light has no effect"),
            Some(light) if light.type_ == Checked::Invalid => warn("a light of unknown type is left out"),
            None if names_light => warn("a light that is named is not there"),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_lamp_and_a_camera_by_hand() {
        let json = r#"{"asset":{"version":"2.0"},"cameras":[
            {"name":"front","type":"perspective","perspective":{"yfov":1.5707963267948966,"znear":0.1}},
            {"type":"orthographic","orthographic":{"xmag":1,"ymag":1,"zfar":9,"znear":0}}],
            "extensions":{"KHR_lights_punctual":{"lights":[
                {"type":"spot","intensity":7,"color":[1,0.5,0],"spot":{"innerConeAngle":0.5235987755982988}},
                {"type":"point","range":3}]}},
            "nodes":[{"camera":0,"extensions":{"KHR_lights_punctual":{"light":0}}},{"camera":1},
                {"extensions":{"KHR_lights_punctual":{"light":1}}},
                {"extensions":{"KHR_lights_punctual":{"light":2}}}]}"#;
        let file = File::from_bytes(json.as_bytes(), Path::new("x.gltf")).unwrap();
        let nodes = &file.root.nodes;
        // a quarter turn about y: −z becomes −x
        let world = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2);
        let world = DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)) * world;
        let Some(Light::Spot { position, direction, inner_deg, outer_deg, intensity, falloff, .. }) =
            light(&file, &nodes[0], &world)
        else {
            panic!()
        };
        assert!(position == Vec3::new(1.0, 2.0, 3.0) && (direction - Vec3::NEG_X).length() < 1e-6);
        assert!((inner_deg - 30.0).abs() < 1e-4 && (outer_deg - 45.0).abs() < 1e-4);
        assert_eq!((intensity, falloff), (7.0, Falloff::InverseSquare));
        let c = camera(&file, &nodes[0], &world).unwrap();
        assert_eq!(c.name, "front");
        assert!((c.camera.look_at - DVec3::new(0.0, 2.0, 3.0)).length() < 1e-12);
        assert!(c.camera.up == DVec3::Y && (c.camera.fov_deg - 90.0).abs() < 1e-5);
        assert_eq!(camera(&file, &nodes[1], &world), None);
        let mut warnings = Warnings::default();
        check(&file, &mut warnings);
        assert_eq!(warnings.list().len(), 3, "{:?}", warnings.list());
    }
}
