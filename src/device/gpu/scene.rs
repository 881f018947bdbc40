//! A frame's records: what kernels look its surfaces up in, from its parts, its shot, and where all that is held.

use super::cuts::LANES_MOST;
use super::records::{
    ABSENT, EmitterRecord, MAP_ALPHA_VARIES, MAP_CLAMP, MAP_FLOAT, MAP_SRGB, MATERIAL_MAPS, MIRRORED,
    MapRecord, ObjectRecord, PLACED, ShotConstants,
};
use super::resident::Resident;
use super::shaders::far;
use crate::accel::{Aabb, PackedNode, PackedTop, Placement};
use crate::device::Output;
use crate::film::{Srgb8, gain_from_stops};
use crate::kernel::camera::CameraConstants;
use crate::kernel::light::{AREA, LightRecord};
use crate::kernel::material::{HALO, MaterialRecord, TEXTURED};
use crate::kernel::scene::{emitters, spread};
use crate::kernel::world::{World, cofactors};
use crate::math::Vec3;
use crate::scene::{
    Aov, Background, Channel, Frame, Geometry, Map, Part, PartHash, Reflection, Shot, TexelSpace, Texels,
    Texture, Textures,
};
use bytemuck::Zeroable;
use std::collections::HashMap;

/// What a frame has: kernels are made for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(clippy::struct_excessive_bools, reason = "each is a constant of a kernel")]
pub(super) struct Has {
    pub(super) single_tree: bool,
    pub(super) branches: bool,
    pub(super) textures: bool,
    pub(super) area_light: bool,
    pub(super) transparency: bool,
    pub(super) goes_on: bool,
    pub(super) albedo: bool,
    pub(super) one_light: bool,
    /// Whether a thread takes one sample at most, of a path that ends at its first surface.
    pub(super) one_ray: bool,
    /// Entries of stacks in threads' own memory.
    pub(super) far: u32,
    /// Words of the film for each pixel.
    pub(super) film_words: u32,
}

/// A frame's records.
#[derive(Debug)]
pub(super) struct Records {
    pub(super) shot: ShotConstants,
    pub(super) has: Has,
    pub(super) lights: Vec<LightRecord>,
    pub(super) emitters: Vec<EmitterRecord>,
    pub(super) materials: Vec<MaterialRecord>,
    pub(super) material_maps: Vec<u32>,
    pub(super) maps: Vec<MapRecord>,
    pub(super) objects: Vec<ObjectRecord>,
    pub(super) tables: Vec<u32>,
    /// The level above the objects, its nodes counted from 0 as yet; empty where there is none.
    pub(super) top: Vec<PackedNode>,
}

impl Records {
    /// Of a frame that is resident, with the place of its background's texels; `box_of` gives the box of an object's
    /// vertices. Else the first object of which something is not there.
    pub(super) fn new(
        frame: &Frame,
        shot: &Shot,
        output: Output,
        resident: &Resident,
        background: Option<u32>,
        mut box_of: impl FnMut(&Geometry) -> Aabb,
    ) -> Result<Self, usize> {
        let world = World::new(frame);
        let is_single = frame.objects.len() == 1 && frame.objects[0].transform.is_none();
        let mut tables = Vec::new();
        let mut objects = Vec::with_capacity(frame.objects.len());
        let mut boxes = Vec::with_capacity(frame.objects.len());
        let (mut first_primitive, mut levels) = (0_u32, 0);
        for (i, object) in frame.objects.iter().enumerate() {
            let geometry = &*object.geometry;
            let tree = resident.tree(geometry).ok_or(i)?;
            let mut record = ObjectRecord::zeroed();
            (record.root, record.first_triangle) = tree.root();
            levels = levels.max(tree.levels());
            record.first_primitive = first_primitive;
            first_primitive = first_primitive.wrapping_add(geometry.triangles.0.len() as u32);
            lists(&mut record, &mut tables, geometry, &world, i);
            places(&mut record, geometry, resident).ok_or(i)?;
            let vertex_box = if is_single { Aabb::EMPTY } else { box_of(geometry) };
            let placement = object.transform.as_ref().map(|t| Placement::new(t, &vertex_box));
            if let (Some(p), Some(t)) = (&placement, &object.transform) {
                place_object(&mut record, p, cofactors(t));
            } else {
                let b = widened(&vertex_box);
                (record.box_min, record.box_max) = (b.min, b.max);
            }
            boxes.push((placement, widened(&vertex_box)));
            objects.push(record);
        }
        let top = if is_single || objects.is_empty() {
            PackedTop::default()
        } else {
            let boxes: Vec<_> = boxes.iter().map(|(placement, b)| (placement.as_ref(), *b)).collect();
            PackedTop::build(&boxes)
        };
        let mut maps = Maps { records: Vec::new(), places: HashMap::new(), resident };
        let mut material_maps = Vec::with_capacity(world.materials.len() * MATERIAL_MAPS);
        for material in 0..world.materials.len() as u32 {
            maps.add_material(world.textures(material), &mut material_maps).ok_or(0_usize)?;
        }
        let (background_color, background_map, is_z_up) = match &shot.background {
            Background::Color(color) => (*color, ABSENT, false),
            Background::Picture { texture, is_z_up } => {
                (Vec3::ZERO, background.map_or(ABSENT, |first| maps.add_picture(texture, first)), *is_z_up)
            }
        };
        let emitters = emitters(&world, shot);
        let lights: Vec<LightRecord> = shot.lights.iter().map(LightRecord::new).collect();
        let top_objects = tables.len() as u32;
        tables.extend(&top.tree.order);
        let top_reach = tables.len() as u32;
        tables.push(top.reach.to_bits());
        let material_slots = tables.len() as u32;
        tables.extend(world.material_slots());
        let code_steps = tables.len() as u32;
        let gain = match output {
            Output::Linear => 1.0,
            Output::Codes { exposure_stops } => {
                tables.extend(Srgb8::steps());
                gain_from_stops(exposure_stops)
            }
        };
        let has = Has {
            film_words: film_words(shot, output),
            far: far(levels, top.tree.heights.len()),
            ..has(&world, shot, &lights, background_map != ABSENT, is_single)
        };
        let shot = ShotConstants {
            camera: CameraConstants::new(&shot.camera, shot.size),
            ambient: shot.ambient,
            samples: shot.samples,
            background: background_color,
            background_map,
            size: shot.size,
            seed: shot.seed,
            depth: shot.depth,
            prune: shot.prune,
            spread: spread(shot),
            alpha: shot.alpha.into(),
            is_z_up: is_z_up.into(),
            pixel_filter: shot.filter as u32,
            light_count: lights.len() as u32,
            emitter_count: emitters.emitters.len() as u32,
            object_count: objects.len() as u32,
            top_node: ABSENT,
            top_reach,
            top_objects,
            material_slots,
            gain,
            code_steps,
            pad: [0; 2],
        };
        let emitters = emitters.emitters.iter().zip(&emitters.shares).map(|(e, &share)| EmitterRecord {
            a: e.corners[0],
            material: e.material,
            b: e.corners[1],
            share,
            c: e.corners[2],
            object: e.place.object,
            magnitude: e.magnitude,
            triangle: e.place.triangle,
            normal: e.normal,
            radiance: e.radiance,
            ..EmitterRecord::zeroed()
        });
        Ok(Self {
            shot,
            has,
            lights,
            emitters: emitters.collect(),
            material_maps,
            maps: maps.records,
            objects,
            tables,
            top: top.tree.nodes,
            materials: world.materials,
        })
    }
}

fn has(world: &World, shot: &Shot, lights: &[LightRecord], has_picture: bool, is_single: bool) -> Has {
    let all = || (0..).zip(&world.materials);
    let textures = |material| world.textures(material);
    let lets_through = |(material, m): (u32, &MaterialRecord)| {
        m.cover() < 1.0 || m.is(HALO) || textures(material).is_some_and(|t| t.map_d.is_some())
    };
    let reflects = |(material, _)| textures(material).is_some_and(|t| t.refl.is_some());
    let goes_on = all().any(lets_through);
    Has {
        single_tree: is_single,
        branches: world.has_models_beyond_2,
        one_ray: shot.samples <= LANES_MOST && !world.has_models_beyond_2 && !goes_on,
        textures: has_picture || all().any(|(_, m)| m.is(TEXTURED)) || all().any(reflects),
        area_light: lights.iter().any(|l| l.kind == AREA),
        transparency: !world.is_opaque,
        goes_on,
        albedo: shot.aovs.contains(Aov::Albedo),
        one_light: lights.len() == 1 && lights[0].kind != AREA,
        film_words: 0,
        far: 0,
    }
}

/// One for codes, three for linear RGB, four with what the background counts for.
pub(super) fn film_words(shot: &Shot, output: Output) -> u32 {
    match output {
        Output::Codes { .. } => 1,
        Output::Linear if shot.alpha || shot.aovs.contains(Aov::Coverage) => 4,
        Output::Linear => 3,
    }
}

/// The lists of an object that are made for the frame.
fn lists(
    record: &mut ObjectRecord,
    tables: &mut Vec<u32>,
    geometry: &Geometry,
    world: &World,
    object: usize,
) {
    record.first_part = world.first_part(object);
    record.meshes = tables.len() as u32;
    record.mesh_count = geometry.meshes.len() as u32;
    tables.extend(geometry.meshes.iter().map(|m| m.first_triangle));
    record.slots = tables.len() as u32;
    tables.extend(world.materials_of(object));
}

/// Where an object's parts are; None where one is not there.
fn places(record: &mut ObjectRecord, geometry: &Geometry, resident: &Resident) -> Option<()> {
    let of = |part: Option<PartHash>| part.map_or(Some(ABSENT), |part| resident.words_of(part));
    record.triangle_slots =
        of((!geometry.material_runs.0.is_empty()).then(|| geometry.material_runs.hash()))?;
    record.corners = of(Some(geometry.triangles.hash()))?;
    record.colors = of(geometry.colors.as_ref().map(Part::hash))?;
    record.normals = of(geometry.normals.as_ref().map(|a| a.values.hash()))?;
    record.normal_corners = of(geometry.normals.as_ref().map(|a| a.corners.hash()))?;
    record.texcoords = of(geometry.texcoords.as_ref().map(|a| a.values.hash()))?;
    record.texcoord_corners = of(geometry.texcoords.as_ref().map(|a| a.corners.hash()))?;
    Some(())
}

fn place_object(
    record: &mut ObjectRecord,
    placement: &Placement,
    (normals, orientation): (crate::math::Mat3, f32),
) {
    let rows = placement.rows();
    let with = |m: [[f32; 3]; 3], fourth: [f32; 3]| [0, 1, 2].map(|k| [m[k][0], m[k][1], m[k][2], fourth[k]]);
    record.world_from_object = with(rows.world_from_object, rows.translation);
    record.object_from_world = with(rows.object_from_world, rows.margin);
    record.margin_of_origin = with(rows.margin_of_origin, [0.0; 3]);
    record.cofactors = with(normals.to_cols_array_2d(), [0.0; 3]);
    (record.box_min, record.box_max) = (rows.world_box.min, rows.world_box.max);
    record.flags = PLACED | if orientation < 0.0 { MIRRORED } else { 0 };
}

/// A box that holds the own boxes of all triangles with corners in it: larger by 16 ULP of its extent, and more than a
/// float.
fn widened(b: &Aabb) -> Aabb {
    if b.is_empty() {
        return *b;
    }
    let extent = (0..3).map(|k| b.max[k] - b.min[k]).fold(0.0, f32::max);
    let margin = extent * (16.0 * f32::EPSILON);
    Aabb {
        min: b.min.map(|x| (x - margin).next_down().next_down()),
        max: b.max.map(|x| (x + margin).next_up().next_up()),
    }
}

/// The maps of a frame, each once.
struct Maps<'a> {
    records: Vec<MapRecord>,
    places: HashMap<Vec<u8>, u32>,
    resident: &'a Resident,
}

impl Maps<'_> {
    /// Adds the words of a material; None where a texture is not there.
    fn add_material(&mut self, textures: Option<&Textures>, words: &mut Vec<u32>) -> Option<()> {
        let none = Textures::default();
        let textures = textures.unwrap_or(&none);
        for map in textures.slots() {
            words.push(match map {
                None => ABSENT,
                Some(map) => {
                    let first = self.resident.texels_of(map.texture.hash())?;
                    self.add(map_record(map, first))
                }
            });
        }
        words.push(match &textures.refl {
            None => 0,
            Some(Reflection::Sphere(_)) => 1,
            Some(Reflection::Cube(_)) => 2,
        });
        Some(())
    }

    fn add_picture(&mut self, texture: &Texture, first: u32) -> u32 {
        let plain = MapRecord { scale: [1.0; 2], base_gain: [0.0, 1.0], ..MapRecord::zeroed() };
        self.add(with_texture(plain, texture, first))
    }

    fn add(&mut self, record: MapRecord) -> u32 {
        let next = self.records.len() as u32;
        let place = *self.places.entry(bytemuck::bytes_of(&record).to_vec()).or_insert(next);
        if place == next {
            self.records.push(record);
        }
        place
    }
}

fn map_record(map: &Map, first_texel: u32) -> MapRecord {
    let channel = map.channel.map_or(0, |channel| match channel {
        Channel::R => 1,
        Channel::G => 2,
        Channel::B => 3,
        Channel::Alpha => 4,
        Channel::Luminance => 5,
    });
    let record = MapRecord {
        scale: map.scale,
        offset: map.offset,
        base_gain: map.base_gain,
        bump_multiplier: map.bump_multiplier,
        channel,
        flags: if map.clamp { MAP_CLAMP } else { 0 },
        ..MapRecord::zeroed()
    };
    with_texture(record, &map.texture, first_texel)
}

fn with_texture(record: MapRecord, texture: &Texture, first_texel: u32) -> MapRecord {
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    let is_float = matches!(texture.texels, Texels::F32(_));
    MapRecord {
        size: texture.size,
        first_texel,
        flags: record.flags
            | flag(is_float, MAP_FLOAT)
            | flag(!is_float && texture.space == TexelSpace::Srgb, MAP_SRGB)
            | flag(texture.alpha_varies, MAP_ALPHA_VARIES),
        ..record
    }
}
