//! Materials: from glTF's metallic-roughness model to the MTL's words.
//!
//! | glTF | MTL |
//! | --- | --- |
//! | base colour b, metallic m | Kd = b·(1 − m), `map_Kd` the base texture; Ks = 0.04·(1 − m) + b·m, `map_Ks` the base texture from m = 0.5 on |
//! | roughness r | Ns = 2/r⁴ − 2, from 1 to 1000 |
//! | (both) | illum 2, Ka 0 |
//! | metallicRoughnessTexture | its mean |
//! | transmission t > 0 | illum 7, Ni = ior (1.5), Tf = b·t (a base texture by its mean), Kd·(1 − t), Ks 0: Fresnel's by Ni |
//! | emissive · strength | Ke, `map_Ke` |
//! | alphaMode OPAQUE, MASK, BLEND | d 1; d and `map_d` 0 or 1 by the cutoff; d and `map_d` alpha |
//! | unlit | illum 0, Kd = b |
//! | normalTexture | norm |
//! | `KHR_texture_transform` | scale and offset of the map; where all textures of a material are turned alike, texture coordinates are |
//!
//! What has no word is named once: textures of one material that are turned differently, `normalTexture.scale`,
//! occlusion, texture coordinates other than the first. Without effect are doubleSided (all surfaces have two sides) and
//! the filters of samplers (ours are trilinear).

use super::Cause;
use super::file::File;
use super::overlay::laid_over;
use super::picture::Pictures;
use crate::format::mtl::Given;
use crate::format::texture::{TextureUse, share_texture};
use crate::math::LINEAR_FROM_SRGB8;
use crate::scene::{Channel, Map, Material, Part, TexelSpace, Texels, Texture};
use crate::warning::Warnings;
use gltf::json::Index;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::{AlphaMode, NormalTexture};
use gltf::json::texture::{Info, WrappingMode};
use gltf::json::validation::Checked;
use std::collections::{HashMap, HashSet};

/// Reflectance of what is no metal, along the normal.
const DIELECTRIC: f32 = 0.04;

/// The least and the greatest exponent.
const EXPONENTS: (f32, f32) = (1.0, 1000.0);

/// The materials of a file as far as meshes use them.
#[derive(Debug)]
pub(super) struct Materials {
    pub pictures: Pictures,
    made: HashMap<usize, Part<Material>>,
    /// What the job says of materials, by their names.
    overlays: HashMap<Vec<u8>, Given>,
    /// Those of the names that a material has.
    met: HashSet<Vec<u8>>,
}

impl Materials {
    pub(super) fn new(pictures: Pictures, overlays: HashMap<Vec<u8>, Given>) -> Self {
        Self { pictures, made: HashMap::new(), overlays, met: HashSet::new() }
    }

    /// The names that the job speaks of and no material has.
    pub(super) fn unmet_overrides(&self) -> Vec<Vec<u8>> {
        self.overlays.keys().filter(|name| !self.met.contains(*name)).cloned().collect()
    }

    /// The material in that place of the file.
    pub(super) fn get(
        &mut self,
        file: &File,
        index: usize,
        warnings: &mut Warnings,
    ) -> Result<Part<Material>, Cause> {
        if let Some(made) = self.made.get(&index) {
            return Ok(made.clone());
        }
        let given = file
            .root
            .materials
            .get(index)
            .ok_or_else(|| Cause::broken(format!("material {index} is named and is not there")))?;
        let mut maps =
            Maps { turned: turn_of(given).is_some(), file, pictures: &mut self.pictures, warnings };
        let mut made = material(given, &mut maps)?;
        let name = given.name.as_deref().unwrap_or_default();
        if let Some(overlay) = self.overlays.get(name.as_bytes()) {
            if !overlay.maps.is_empty() {
                maps.warn("maps that the job gives to a glTF's material are not laid over its own");
            }
            made = laid_over(made, overlay);
            self.met.insert(name.as_bytes().to_vec());
        }
        let made = Part::new(made);
        self.made.insert(index, made.clone());
        Ok(made)
    }
}

/// The transform that all textures of a material have, where it turns them: texture coordinates take it, since maps
/// cannot turn.
pub(super) fn turn(file: &File, index: usize) -> Option<TextureTransform> {
    turn_of(file.root.materials.get(index)?)
}

fn turn_of(given: &gltf::json::Material) -> Option<TextureTransform> {
    let pbr = &given.pbr_metallic_roughness;
    let transmission = given.extensions.as_ref().and_then(|e| e.transmission.as_ref());
    let infos = [
        pbr.base_color_texture.as_ref(),
        pbr.metallic_roughness_texture.as_ref(),
        given.emissive_texture.as_ref(),
        transmission.and_then(|t| t.transmission_texture.as_ref()),
    ];
    let own = |info: &Info| info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
    let of_normal = given.normal_texture.as_ref().map(normal_transform);
    let mut all = infos.into_iter().flatten().map(own).chain(of_normal);
    let first = all.next()?.filter(|t| t.rotation.0 != 0.0)?;
    let numbers = |t: &TextureTransform| (t.offset.0, t.rotation.0, t.scale.0);
    all.all(|t| t.is_some_and(|t| numbers(&t) == numbers(&first))).then_some(first)
}

fn normal_transform(normal: &NormalTexture) -> Option<TextureTransform> {
    let given = normal.extensions.as_ref()?.others.get("KHR_texture_transform")?.clone();
    // what is no transform is none
    gltf::json::deserialize::from_value(given).ok()
}

/// Finds the maps of a material.
struct Maps<'a> {
    /// Whether texture coordinates are turned already.
    turned: bool,
    file: &'a File,
    pictures: &'a mut Pictures,
    warnings: &'a mut Warnings,
}

impl Maps<'_> {
    fn warn(&mut self, text: &str) {
        self.warnings.add(Some(&self.file.path), None, text);
    }

    fn of(&mut self, info: Option<&Info>, texture_use: TextureUse) -> Result<Option<Map>, Cause> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        self.map(info.index, info.tex_coord, transform, texture_use)
    }

    fn map(
        &mut self,
        index: Index<gltf::json::Texture>,
        set: u32,
        transform: Option<&TextureTransform>,
        texture_use: TextureUse,
    ) -> Result<Option<Map>, Cause> {
        let root = &self.file.root;
        let index = index.value();
        let texture = root
            .textures
            .get(index)
            .ok_or_else(|| Cause::broken(format!("texture {index} is named and is not there")))?;
        if transform.and_then(|t| t.tex_coord).unwrap_or(set) != 0 {
            self.warn("textures of texture coordinates other than the first (TEXCOORD_0) are not mapped");
            return Ok(None);
        }
        let clamp = match texture.sampler {
            None => false,
            Some(sampler) => {
                let sampler = root.samplers.get(sampler.value()).ok_or_else(|| {
                    Cause::broken(format!("sampler {} is named and is not there", sampler.value()))
                })?;
                let is = |mode| [sampler.wrap_s, sampler.wrap_t].map(|wrap| wrap == Checked::Valid(mode));
                let (clamped, repeated) = (is(WrappingMode::ClampToEdge), is(WrappingMode::Repeat));
                if clamped != [true; 2] && repeated != [true; 2] {
                    self.warn("textures that are mirrored, or clamped one way only, repeat");
                }
                clamped == [true; 2]
            }
        };
        let source = texture.source.value();
        let Some(texture) = self.pictures.get(self.file, source, texture_use, self.warnings) else {
            return Ok(None);
        };
        let (mut scale, mut offset) = ([1.0; 2], [0.0; 2]);
        if let Some(transform) = transform.filter(|_| !self.turned) {
            if transform.rotation.0 != 0.0 {
                self.warn("a texture that is turned (KHR_texture_transform) beside others that are not is not turned");
            }
            scale = transform.scale.0;
            // with v' = 1 − v: 1 − (v·s + o) = v'·s + (1 − s − o)
            offset = [transform.offset.0[0], 1.0 - scale[1] - transform.offset.0[1]];
        }
        Ok(Some(Map {
            texture,
            scale,
            offset,
            clamp,
            base_gain: [0.0, 1.0],
            bump_multiplier: 1.0,
            channel: None,
        }))
    }
}

fn material(given: &gltf::json::Material, maps: &mut Maps<'_>) -> Result<Material, Cause> {
    let pbr = &given.pbr_metallic_roughness;
    let extensions = given.extensions.as_ref();
    let [r, g, b, alpha] = pbr.base_color_factor.0;
    let base = [r, g, b];
    let base_map = maps.of(pbr.base_color_texture.as_ref(), TextureUse::Color)?;
    let mut made = Material { kd: base, ..Material::default() };
    set_alpha(&mut made, given, alpha, base_map.as_ref(), maps);
    if extensions.is_some_and(|e| e.unlit.is_some()) {
        made.illum = 0;
        made.textures.map_kd = base_map;
        return Ok(made);
    }

    let (mut metallic, mut roughness) = (pbr.metallic_factor.0, pbr.roughness_factor.0);
    if let Some(map) = maps.of(pbr.metallic_roughness_texture.as_ref(), TextureUse::Data)? {
        maps.warn("metalness and roughness of a texture are its means");
        let mean = mean(&map.texture);
        metallic *= mean[2];
        roughness *= mean[1];
    }
    let metallic = metallic.clamp(0.0, 1.0);
    let transmission = transmission(extensions, maps)?;
    made.illum = 2;
    made.ns = exponent(roughness);
    made.kd = base.map(|b| b * (1.0 - metallic) * (1.0 - transmission));
    if transmission > 0.0 {
        let color = mean_color(base, base_map.as_ref());
        made.illum = 7;
        made.ni = extensions.and_then(|e| e.ior.as_ref()).map_or(1.5, |ior| ior.ior.0);
        // 0 stands for no refraction at all in KHR_materials_ior
        made.ni = if made.ni > 0.0 { made.ni } else { 1.0 };
        made.tf = color.map(|c| c * transmission * (1.0 - metallic));
        made.tf_given = true;
    } else if metallic >= 0.5 {
        made.ks = base.map(|b| DIELECTRIC * (1.0 - metallic) + b * metallic);
        made.textures.map_ks.clone_from(&base_map);
    } else {
        let color = mean_color(base, base_map.as_ref());
        made.ks = color.map(|c| DIELECTRIC * (1.0 - metallic) + c * metallic);
    }
    made.textures.map_kd = base_map.filter(|_| made.kd != [0.0; 3]);

    let strength =
        extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |s| s.emissive_strength.0);
    made.ke = given.emissive_factor.0.map(|e| e * strength);
    if made.ke != [0.0; 3] {
        made.textures.map_ke = maps.of(given.emissive_texture.as_ref(), TextureUse::Color)?;
    }
    if let Some(normal) = &given.normal_texture {
        let transform = normal_transform(normal);
        if normal.scale != 1.0 {
            maps.warn("the scale of a normal texture is not mapped");
        }
        made.textures.norm =
            maps.map(normal.index, normal.tex_coord, transform.as_ref(), TextureUse::Data)?;
    }
    if given.occlusion_texture.is_some() {
        maps.warn("occlusion textures have no effect");
    }
    Ok(made)
}

/// The share of light that goes through.
fn transmission(
    extensions: Option<&gltf::json::extensions::material::Material>,
    maps: &mut Maps<'_>,
) -> Result<f32, Cause> {
    let Some(given) = extensions.and_then(|e| e.transmission.as_ref()) else { return Ok(0.0) };
    let mut share = given.transmission_factor.0;
    if share > 0.0
        && let Some(map) = maps.of(given.transmission_texture.as_ref(), TextureUse::Data)?
    {
        maps.warn("the transmission of a texture is its mean");
        share *= mean(&map.texture)[0];
    }
    Ok(share.clamp(0.0, 1.0))
}

fn set_alpha(
    made: &mut Material,
    given: &gltf::json::Material,
    alpha: f32,
    base: Option<&Map>,
    maps: &mut Maps<'_>,
) {
    let varying = base.filter(|map| map.texture.alpha_varies);
    match given.alpha_mode {
        Checked::Valid(AlphaMode::Opaque) => {}
        Checked::Valid(AlphaMode::Blend) => {
            made.d = alpha.clamp(0.0, 1.0);
            made.textures.map_d = varying.map(|map| Map { channel: Some(Channel::Alpha), ..map.clone() });
        }
        Checked::Valid(AlphaMode::Mask) => {
            let cutoff = given.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
            match varying {
                None => made.d = f32::from(alpha >= cutoff),
                Some(map) => {
                    let texture = mask(&map.texture, alpha, cutoff);
                    made.textures.map_d =
                        Some(Map { texture, channel: Some(Channel::Luminance), ..map.clone() });
                }
            }
        }
        Checked::Invalid => maps.warn("an unknown alphaMode counts as OPAQUE"),
    }
}

/// 1 where alpha is at least the cutoff, else 0.
fn mask(base: &Texture, factor: f32, cutoff: f32) -> Part<Texture> {
    let count = base.size[0] as usize * base.size[1] as usize;
    let shows = |alpha: f32| factor * alpha >= cutoff;
    let shares: Vec<bool> = match &base.texels {
        Texels::U8(texels) => texels[..count].iter().map(|t| shows(f32::from(t[3]) / 255.0)).collect(),
        Texels::F32(texels) => texels[..count].iter().map(|t| shows(t[3])).collect(),
    };
    Part::new(share_texture(base.size, shares.into_iter().map(|shows| if shows { 255 } else { 0 })))
}

/// The smallest mip level: the mean of all texels, in linear light.
fn mean(texture: &Texture) -> [f32; 4] {
    match &texture.texels {
        Texels::F32(texels) => texels.last().copied().unwrap_or([1.0; 4]),
        Texels::U8(texels) => {
            let [r, g, b, a] = texels.last().copied().unwrap_or([255; 4]);
            let linear = |x: u8| match texture.space {
                TexelSpace::Srgb => LINEAR_FROM_SRGB8[usize::from(x)],
                TexelSpace::Linear => f32::from(x) / 255.0,
            };
            [linear(r), linear(g), linear(b), f32::from(a) / 255.0]
        }
    }
}

fn mean_color(factor: [f32; 3], map: Option<&Map>) -> [f32; 3] {
    let mean = map.map_or([1.0; 4], |map| mean(&map.texture));
    [factor[0] * mean[0], factor[1] * mean[1], factor[2] * mean[2]]
}

/// Blinn-Phong's exponent of a roughness (α = r², n = 2/α² − 2).
fn exponent(roughness: f32) -> f32 {
    let r2 = roughness * roughness;
    (2.0 / (r2 * r2) - 2.0).clamp(EXPONENTS.0, EXPONENTS.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// The material, and what was said of it. Image 0 is of 2x1 texels: white and wholly there, black and a quarter
    /// there.
    fn made(material: &str) -> (Material, Vec<String>) {
        // a TGA: 18 bytes of header, 2x1, 32 bits, from the top; blue, green, red, alpha
        let tga = [0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 32, 0x28, 255, 255, 255, 255, 0, 0, 0, 64];
        let data = super::super::uri::escaped(&tga);
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"data:,{data}"}}],
            "samplers":[{{"wrapS":33071,"wrapT":33071}},{{"wrapS":33071}}],
            "textures":[{{"source":0}},{{"source":0,"sampler":0}},{{"source":0,"sampler":1}}],
            "materials":[{material}]}}"#
        );
        let file = File::from_bytes(json.as_bytes(), Path::new("x.tga")).unwrap();
        let mut warnings = Warnings::default();
        let mut materials = Materials::new(Pictures::with_limit(u64::MAX), HashMap::new());
        let made = materials.get(&file, 0, &mut warnings).unwrap();
        ((*made).clone(), warnings.list().into_iter().map(|w| w.text).collect())
    }

    fn near(a: [f32; 3], b: [f32; 3]) {
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-6), "{a:?}, not {b:?}");
    }

    #[test]
    fn metal_and_plastic() {
        let (m, said) = made(
            r#"{"pbrMetallicRoughness":{"baseColorFactor":[0.5,1,0,1],"metallicFactor":0.25,"roughnessFactor":0.5}}"#,
        );
        near(m.kd, [0.375, 0.75, 0.0]);
        // 0.04·0.75 + b·0.25
        near(m.ks, [0.155, 0.28, 0.03]);
        // 2·16 − 2
        assert_eq!((m.ns, m.illum, m.d, m.ka, said.len()), (30.0, 2, 1.0, [0.0; 3], 0));
        let (m, _) = made("{}");
        assert_eq!((m.kd, m.ks, m.ns), ([0.0; 3], [1.0; 3], 1.0));
        assert_eq!((exponent(0.0), exponent(0.1), exponent(1.0)), (1000.0, 1000.0, 1.0));
    }

    #[test]
    fn glass_glow_and_unlit() {
        let (m, _) = made(
            r#"{"pbrMetallicRoughness":{"baseColorFactor":[0.5,1,0,1],"metallicFactor":0},
            "emissiveFactor":[1,0.5,0],"extensions":{"KHR_materials_transmission":{"transmissionFactor":1},
            "KHR_materials_emissive_strength":{"emissiveStrength":4}}}"#,
        );
        assert_eq!((m.illum, m.ni, m.tf, m.kd, m.ks), (7, 1.5, [0.5, 1.0, 0.0], [0.0; 3], [0.0; 3]));
        assert_eq!(m.ke, [4.0, 2.0, 0.0]);
        let (m, _) = made(
            r#"{"extensions":{"KHR_materials_ior":{"ior":1.25},
            "KHR_materials_transmission":{"transmissionFactor":0.5}},"pbrMetallicRoughness":{"metallicFactor":0}}"#,
        );
        assert_eq!((m.ni, m.tf, m.kd), (1.25, [0.5; 3], [0.5; 3]));
        let (m, _) = made(r#"{"extensions":{"KHR_materials_unlit":{}}}"#);
        assert_eq!((m.illum, m.kd), (0, [1.0; 3]));
    }

    #[test]
    fn alpha() {
        let with = |rest: &str| {
            made(&format!(
                r#"{{"pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,0.5],"metallicFactor":0,
                "baseColorTexture":{{"index":0}}}}{rest}}}"#
            ))
            .0
        };
        let opaque = with("");
        assert!(opaque.textures.map_d.is_none() && opaque.textures.map_kd.is_some() && opaque.d == 1.0);
        let blend = with(r#","alphaMode":"BLEND""#);
        assert_eq!((blend.d, blend.textures.map_d.unwrap().channel), (0.5, Some(Channel::Alpha)));
        // alpha is 0.5 and 0.125
        let masked = |cutoff: &str| {
            let m = with(&format!(r#","alphaMode":"MASK"{cutoff}"#));
            let map = m.textures.map_d.unwrap();
            let Texels::U8(texels) = &map.texture.texels else { panic!() };
            [texels[0][0], texels[1][0]]
        };
        assert_eq!([masked(""), masked(r#","alphaCutoff":0.1"#)], [[255, 0], [255, 255]]);
        assert_eq!(masked(r#","alphaCutoff":0.6"#), [0, 0]);
        let plain = made(r#"{"pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0.4]},"alphaMode":"MASK"}"#).0;
        assert_eq!((plain.d, plain.textures.map_d), (0.0, None));
    }

    #[test]
    fn maps_are_moved_and_what_has_no_word_is_named() {
        let with = |info: &str| {
            made(&format!(r#"{{"pbrMetallicRoughness":{{"metallicFactor":0,"baseColorTexture":{info}}}}}"#))
        };
        let (m, said) =
            with(r#"{"index":1,"extensions":{"KHR_texture_transform":{"offset":[0.25,0.5],"scale":[2,4]}}}"#);
        let map = m.textures.map_kd.unwrap();
        // v' = 1 − v; v = 0 goes to 0.5, that is 0.5; v = 1 to 4.5, that is −3.5: 4·v' − 3.5
        assert_eq!((map.scale, map.offset, map.clamp, said.len()), ([2.0, 4.0], [0.25, -3.5], true, 0));
        // turned texture coordinates need no other map
        let (m, said) =
            with(r#"{"index":2,"extensions":{"KHR_texture_transform":{"rotation":1,"scale":[2,2]}}}"#);
        assert!(m.textures.map_kd.is_some_and(|map| !map.clamp && map.scale == [1.0; 2]));
        assert_eq!(said.len(), 1, "{said:?}");
        let (_, said) = made(
            r#"{"emissiveTexture":{"index":0},"emissiveFactor":[1,1,1],"pbrMetallicRoughness":{"metallicFactor":0,
            "baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"rotation":1}}}}}"#,
        );
        assert_eq!(said.len(), 1, "{said:?}");
        let (m, said) = with(r#"{"index":0,"texCoord":1}"#);
        assert_eq!((m.textures.map_kd, said.len()), (None, 1));
        let (m, said) = made(r#"{"pbrMetallicRoughness":{"metallicRoughnessTexture":{"index":0}}}"#);
        // blue and green: the mean of 1 and 0; 2·16 − 2
        assert!((m.kd[0] - 0.5).abs() < 0.01 && (m.ns - 30.0).abs() < 1.0 && said.len() == 1, "{m:?}");
    }
}
