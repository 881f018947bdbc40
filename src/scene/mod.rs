//! Frames, parts, meshes, materials, lights, cameras: plain data, no files, no clock, no threads.

pub mod camera;
pub mod frame;
pub mod geometry;
pub mod light;
pub mod material;
pub mod normals;
pub mod part;
pub mod shot;
pub mod texture;

pub use camera::Camera;
pub use frame::{Frame, Object};
pub use geometry::{
    ABSENT, Attribute, Colors, Corners, Faces, Geometry, MaterialRuns, Mesh, Normals, Positions, Texcoords,
    Triangles,
};
pub use light::{Falloff, Light};
pub use material::{Material, Textures};
pub use part::{Content, Part, PartHash, PartHasher, SharedPart};
pub use shot::{Aov, AovSet, Background, Filter, Shot};
pub use texture::{Channel, Map, Reflection, TexelSpace, Texels, Texture};
