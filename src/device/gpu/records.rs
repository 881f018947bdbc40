//! Records as kernels read them: each is the twin of the structure of the same name in `shaders/`.

use crate::kernel::camera::CameraConstants;
use crate::math::Vec3;
use bytemuck::{Pod, Zeroable};

/// An index that is not there.
pub const ABSENT: u32 = u32::MAX;

/// Words of a pixel's auxiliary pictures of its centre.
pub const CENTER_WORDS: u64 = 12;
/// Rows of counts of rays, of words of which five are used.
pub const COUNTER_ROWS: u64 = 256;
/// Rows of four words that a waiting ray takes.
pub const WAITING_ROWS: u64 = 10;
/// Nodes that a workgroup fits, below the tops of trees.
pub const NODES_IN_GROUP: u32 = 8;

/// Everything but the geometry that bears on a frame's film.
#[allow(missing_docs, reason = "said in shaders/parts/scene.wgsl")]
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ShotConstants {
    pub camera: CameraConstants,
    pub ambient: Vec3,
    pub samples: u32,
    pub background: Vec3,
    pub background_map: u32,
    pub size: [u32; 2],
    pub seed: u32,
    pub depth: u32,
    pub prune: f32,
    pub spread: f32,
    pub alpha: u32,
    pub is_z_up: u32,
    pub pixel_filter: u32,
    pub light_count: u32,
    pub emitter_count: u32,
    pub object_count: u32,
    pub top_node: u32,
    pub top_reach: u32,
    pub top_objects: u32,
    pub material_slots: u32,
    pub gain: f32,
    pub code_steps: u32,
    pub pad: [u32; 2],
}

/// Which part of the picture one dispatch traces.
#[allow(missing_docs, reason = "said in shaders/parts/scene.wgsl")]
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Slice {
    pub first_row: u32,
    pub end_row: u32,
    pub first_tile: u32,
    pub lanes: u32,
    pub waiting_each: u32,
}

/// A texture as a material uses it.
#[allow(missing_docs, reason = "said in shaders/parts/scene.wgsl")]
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MapRecord {
    pub scale: [f32; 2],
    pub offset: [f32; 2],
    pub base_gain: [f32; 2],
    pub bump_multiplier: f32,
    pub channel: u32,
    pub size: [u32; 2],
    pub first_texel: u32,
    pub flags: u32,
}

/// In [`MapRecord::flags`]: outside 0 to 1 the border's texel.
pub const MAP_CLAMP: u32 = 1;
/// In [`MapRecord::flags`]: 8 bits on the sRGB curve.
pub const MAP_SRGB: u32 = 2;
/// In [`MapRecord::flags`]: four words a texel.
pub const MAP_FLOAT: u32 = 4;
/// In [`MapRecord::flags`]: alpha differs somewhere from 1.
pub const MAP_ALPHA_VARIES: u32 = 8;
/// Words of a material in the list of its maps; the last says what `refl` is: 0 nothing, 1 a sphere, 2 a cube.
pub const MATERIAL_MAPS: usize = 16;

/// A triangle that glows.
#[allow(missing_docs, reason = "said in shaders/parts/scene.wgsl")]
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct EmitterRecord {
    pub a: Vec3,
    pub material: u32,
    pub b: Vec3,
    pub share: f32,
    pub c: Vec3,
    pub object: u32,
    pub magnitude: Vec3,
    pub triangle: u32,
    pub normal: Vec3,
    pub pad_normal: u32,
    pub radiance: Vec3,
    pub pad_radiance: u32,
}

/// An object: where it stands, and where its parts are.
#[allow(missing_docs, reason = "said in shaders/parts/scene.wgsl")]
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ObjectRecord {
    pub world_from_object: [[f32; 4]; 3],
    pub object_from_world: [[f32; 4]; 3],
    pub margin_of_origin: [[f32; 4]; 3],
    pub cofactors: [[f32; 4]; 3],
    pub box_min: [f32; 3],
    pub flags: u32,
    pub box_max: [f32; 3],
    pub first_primitive: u32,
    pub root: u32,
    pub first_triangle: u32,
    pub first_part: u32,
    pub meshes: u32,
    pub mesh_count: u32,
    pub triangle_slots: u32,
    pub slots: u32,
    pub corners: u32,
    pub colors: u32,
    pub normals: u32,
    pub normal_corners: u32,
    pub texcoords: u32,
    pub texcoord_corners: u32,
    pub pad_a: u32,
    pub pad_b: u32,
    pub pad_c: u32,
}

/// In [`ObjectRecord::flags`]: it has a transform.
pub const PLACED: u32 = 1;
/// In [`ObjectRecord::flags`]: its transform mirrors.
pub const MIRRORED: u32 = 2;

/// A tree that is fitted.
#[allow(missing_docs, reason = "said in shaders/refit.wgsl")]
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct RefitTree {
    pub positions: u32,
    pub vertices: u32,
    pub by_height: u32,
    pub heights: u32,
    pub height_count: u32,
    pub top_height: u32,
    pub first_node: u32,
    pub first_triangle: u32,
    pub first_box: u32,
    pub pad_a: u32,
    pub pad_b: u32,
    pub pad_c: u32,
}

/// One dispatch of a fit.
#[allow(missing_docs, reason = "said in shaders/refit.wgsl")]
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct RefitLevel {
    pub tree: u32,
    pub first: u32,
    pub count: u32,
    pub trees: u32,
}
