//! A frame: what stands in one picture, as parts.

use super::geometry::Geometry;
use super::part::{PartHash, PartHasher};
use crate::math::DAffine3;
use std::collections::BTreeMap;
use std::sync::Arc;

/// One layer's geometry in a frame (or one glTF node's).
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Its shape and materials.
    pub geometry: Arc<Geometry>,
    /// From its own space to the world; None where the job or glTF gives no transform. A rigid motion is never
    /// guessed from vertices.
    pub transform: Option<DAffine3>,
}

/// The objects of one picture in the order (layer, node). Primitive ids count through them in this order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// The objects.
    pub objects: Vec<Object>,
}

impl Frame {
    /// Triangles in all.
    pub fn triangles(&self) -> u64 {
        self.objects.iter().map(|o| o.geometry.triangles.0.len() as u64).sum()
    }

    /// Bytes of all textures, each once.
    pub fn texture_bytes(&self) -> u64 {
        let textures = self.objects.iter().flat_map(|o| o.geometry.textures());
        let textures: BTreeMap<_, _> = textures.map(|texture| (texture.hash(), texture.bytes())).collect();
        textures.values().sum()
    }

    /// A name for the whole: geometries and transforms in order.
    pub fn hash(&self) -> PartHash {
        let mut h = PartHasher::new("frame");
        h.u64(self.objects.len() as u64);
        for o in &self.objects {
            h.part(o.geometry.hash());
            h.u64(u64::from(o.transform.is_some()));
            if let Some(t) = &o.transform {
                for x in t.to_cols_array() {
                    h.f64(x);
                }
            }
        }
        h.finish()
    }
}
