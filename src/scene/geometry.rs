//! The shape of one OBJ file (or one glTF node): vertex arrays as the file gives them, the faces as written, the
//! triangles derived from them, and the meshes that are runs of those faces.

use super::material::Material;
use super::part::{Content, Part, PartHash, PartHasher, SharedPart};
use super::texture::Texture;
use std::collections::HashSet;

/// An attribute index that is not there.
pub const ABSENT: u32 = u32::MAX;

macro_rules! list_part {
    ($(#[$doc:meta])* $name:ident, $item:ty, $kind:literal) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $name(pub Vec<$item>);

        impl Content for $name {
            const KIND: &'static str = $kind;
            fn hash_into(&self, hasher: &mut PartHasher) {
                hasher.slice(&self.0);
            }
            fn bytes(&self) -> u64 {
                size_of_val(self.0.as_slice()) as u64
            }
        }
    };
}

list_part!(
    /// All positions of a file in its order, used or not; not all need be finite, those that faces use are.
    Positions, [f32; 3], "positions"
);
list_part!(
    /// Texture coordinates in file order, v running up.
    Texcoords, [f32; 2], "texcoords"
);
list_part!(
    /// Normals as the file gives them (any length), or derived ones (unit).
    Normals, [f32; 3], "normals"
);
list_part!(
    /// One colour a position, sRGB as written. A position without one has NaN in all channels.
    Colors, [f32; 3], "colors"
);
list_part!(
    /// Three position indices a triangle, in the order (mesh, face in file order, place in the polygon). A polygon
    /// of n corners always fills n − 2 places.
    Triangles, [u32; 3], "triangles"
);
list_part!(
    /// Three indices of an attribute a triangle, [`ABSENT`] where a corner has none.
    Corners, [u32; 3], "corners"
);
list_part!(
    /// `(first triangle, slot)`: from this triangle on the material in that slot, up to the next run. Slot
    /// [`ABSENT`] means that no material was named. Runs start at triangle 0 and ascend.
    MaterialRuns, [u32; 2], "material runs"
);

/// Faces as written: position indices (0-based), polygon by polygon.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faces {
    /// Number of corners of each face, 3 or more.
    pub counts: Vec<u32>,
    /// The faces' position indices one after the other.
    pub corners: Vec<u32>,
}

impl Content for Faces {
    const KIND: &'static str = "faces";
    fn hash_into(&self, hasher: &mut PartHasher) {
        hasher.slice(&self.counts);
        hasher.slice(&self.corners);
    }
    fn bytes(&self) -> u64 {
        4 * (self.counts.len() + self.corners.len()) as u64
    }
}

/// An attribute with its own indices.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute<T> {
    /// The values.
    pub values: Part<T>,
    /// For each triangle corner the place in `values`.
    pub corners: Part<Corners>,
}

/// A mesh: a run of faces between `o` lines (or the whole file). Matched to the frame before by its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mesh {
    /// Its first face in [`Geometry::faces`].
    pub first_face: u32,
    /// How many faces.
    pub face_count: u32,
    /// Its first triangle in [`Geometry::triangles`].
    pub first_triangle: u32,
    /// How many triangles.
    pub triangle_count: u32,
}

/// One file's (or node's) shape and the materials it uses.
#[derive(Clone, Debug, PartialEq)]
pub struct Geometry {
    /// Positions.
    pub positions: Part<Positions>,
    /// Faces as written.
    pub faces: Part<Faces>,
    /// Triangles derived from faces and positions.
    pub triangles: Part<Triangles>,
    /// Texture coordinates, if any face has some.
    pub texcoords: Option<Attribute<Texcoords>>,
    /// Shading normals: vn where the file has valid ones, else derived by smoothing; None where all are flat.
    pub normals: Option<Attribute<Normals>>,
    /// Colours, if any position has one.
    pub colors: Option<Part<Colors>>,
    /// Which triangle has which material.
    pub material_runs: Part<MaterialRuns>,
    /// The materials in order of first use; a slot is a place in this list.
    pub materials: Vec<Part<Material>>,
    /// The meshes in file order; together they cover all faces.
    pub meshes: Vec<Mesh>,
}

impl Geometry {
    /// The textures of all its materials, as often as they are used.
    pub fn textures(&self) -> impl Iterator<Item = &Part<Texture>> {
        self.materials.iter().flat_map(|m| m.textures.slots()).flatten().map(|map| &map.texture)
    }

    /// The names of all its parts with their bytes, each once, in a fixed order.
    pub fn parts(&self) -> Vec<(PartHash, u64)> {
        self.listed().into_iter().map(|(name, bytes, _)| (name, bytes)).collect()
    }

    /// All its parts by name.
    pub fn shared_parts(&self) -> impl Iterator<Item = (PartHash, SharedPart)> {
        self.listed().into_iter().map(|(name, _, part)| (name, part))
    }

    fn listed(&self) -> Vec<(PartHash, u64, SharedPart)> {
        fn entry<T: Content + Send + Sync + 'static>(part: &Part<T>) -> (PartHash, u64, SharedPart) {
            (part.hash(), part.bytes(), part.shared())
        }
        let mut parts = vec![
            entry(&self.positions),
            entry(&self.faces),
            entry(&self.triangles),
            entry(&self.material_runs),
        ];
        if let Some(a) = &self.texcoords {
            parts.extend([entry(&a.values), entry(&a.corners)]);
        }
        if let Some(a) = &self.normals {
            parts.extend([entry(&a.values), entry(&a.corners)]);
        }
        parts.extend(self.colors.as_ref().map(entry));
        parts.extend(self.materials.iter().map(entry));
        let mut seen = HashSet::new();
        parts.extend(self.textures().filter(|texture| seen.insert(texture.hash())).map(entry));
        parts
    }

    /// A name for the whole: all parts' names, which attribute is there, and the meshes' borders.
    pub fn hash(&self) -> PartHash {
        let mut h = PartHasher::new("geometry");
        h.u64(
            u64::from(self.texcoords.is_some())
                | u64::from(self.normals.is_some()) << 1
                | u64::from(self.colors.is_some()) << 2,
        );
        for (hash, _) in self.parts() {
            h.part(hash);
        }
        for m in &self.meshes {
            h.u64(u64::from(m.first_triangle));
        }
        h.finish()
    }
}
