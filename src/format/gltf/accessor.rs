//! Accessors: numbers in buffers, with strides, normalised integers and sparse changes.

use super::Cause;
use super::file::File;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};

/// The most elements of an accessor that has no bytes in the file: zeros, but for what a sparse part changes.
const MAX_ZEROS: u64 = 1 << 22;

/// Numbers of an accessor, element by element.
#[derive(Debug)]
pub(super) struct Numbers {
    /// How many numbers an element has.
    pub width: usize,
    /// The numbers.
    pub values: Vec<f64>,
}

impl Numbers {
    /// How many elements there are.
    pub(super) fn count(&self) -> usize {
        self.values.len() / self.width
    }

    /// The elements as f32, which float accessors hold; N must be the width.
    pub(super) fn arrays<const N: usize>(&self) -> Vec<[f32; N]> {
        self.values.as_chunks::<N>().0.iter().map(|element| element.map(|x| x as f32)).collect()
    }
}

/// Reads an accessor of one of those types. `what` names it in errors.
pub(super) fn numbers(
    file: &File,
    index: Index<Accessor>,
    types: &[Type],
    what: &str,
) -> Result<Numbers, Cause> {
    let accessor = accessor(file, index, what)?;
    let broken = |text: &str| Cause::broken(format!("{what}: accessor {} {text}", index.value()));
    let (Checked::Valid(kind), Checked::Valid(component)) = (accessor.type_, accessor.component_type) else {
        return Err(broken("has an unknown type"));
    };
    if !types.contains(&kind) {
        return Err(broken(&format!("is {kind:?}, {types:?} is wanted")));
    }
    let (width, component) = (kind.multiplicity(), component.0);
    let count = accessor.count.0;
    file.take_numbers(count.saturating_mul(width as u64))?;
    let cell = Cell { component, width, normalized: accessor.normalized };
    let mut values = match accessor.buffer_view {
        Some(view) => {
            let (bytes, stride) = file.view(view)?;
            let offset = accessor.byte_offset.unwrap_or_default().0;
            cell.read(bytes, stride, offset, count).ok_or_else(|| broken("reaches beyond its buffer view"))?
        }
        None if count <= MAX_ZEROS => vec![0.0; count as usize * width],
        None => return Err(broken(&format!("is of {count} zeros, more than {MAX_ZEROS}"))),
    };
    if let Some(sparse) = &accessor.sparse {
        file.take_numbers(sparse.count.0.saturating_mul(width as u64 + 1))?;
        let Checked::Valid(index_type) = sparse.indices.component_type else {
            return Err(broken("has sparse indices of an unknown type"));
        };
        let beyond = || broken("has a sparse part that reaches beyond its buffer view");
        let (bytes, stride) = file.view(sparse.indices.buffer_view)?;
        let scalar = Cell { component: index_type.0, width: 1, normalized: false };
        let places = scalar.read(bytes, stride, sparse.indices.byte_offset.0, sparse.count.0);
        let (bytes, stride) = file.view(sparse.values.buffer_view)?;
        let changes = cell.read(bytes, stride, sparse.values.byte_offset.0, sparse.count.0);
        let (places, changes) = (places.ok_or_else(beyond)?, changes.ok_or_else(beyond)?);
        for (place, change) in places.iter().zip(changes.chunks_exact(width)) {
            let from = *place as usize * width;
            values
                .get_mut(from..from + width)
                .ok_or_else(|| broken("has a sparse index beyond its elements"))?
                .copy_from_slice(change);
        }
    }
    Ok(Numbers { width, values })
}

/// Reads an accessor of vertex indices.
pub(super) fn indices(file: &File, index: Index<Accessor>, what: &str) -> Result<Vec<u32>, Cause> {
    let accessor = accessor(file, index, what)?;
    let is_whole = matches!(
        &accessor.component_type,
        Checked::Valid(json::accessor::GenericComponentType(
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32
        ))
    );
    if !is_whole {
        return Err(Cause::broken(format!("{what}: accessor {} is no list of indices", index.value())));
    }
    let read = numbers(file, index, &[Type::Scalar], what)?;
    // 32 bits fit an f64
    Ok(read.values.into_iter().map(|x| x as u32).collect())
}

fn accessor<'a>(file: &'a File, index: Index<Accessor>, what: &str) -> Result<&'a Accessor, Cause> {
    file.root
        .accessors
        .get(index.value())
        .ok_or_else(|| Cause::broken(format!("{what}: accessor {} is not there", index.value())))
}

/// How an element lies in bytes.
#[derive(Clone, Copy)]
struct Cell {
    component: ComponentType,
    width: usize,
    normalized: bool,
}

impl Cell {
    /// Reads that many elements; None where they reach beyond the bytes.
    fn read(self, bytes: &[u8], stride: Option<usize>, offset: u64, count: u64) -> Option<Vec<f64>> {
        let size = self.component.size() * self.width;
        let stride = stride.filter(|&stride| stride > 0).unwrap_or(size);
        if count == 0 {
            return Some(Vec::new());
        }
        let end = (count - 1).checked_mul(stride as u64)?.checked_add(offset)?.checked_add(size as u64)?;
        if end > bytes.len() as u64 || stride < size {
            return None;
        }
        let mut values = Vec::with_capacity(count as usize * self.width);
        for element in 0..count as usize {
            let from = offset as usize + element * stride;
            let parts = bytes[from..from + size].chunks_exact(self.component.size());
            values.extend(parts.map(|part| self.number(part)));
        }
        Some(values)
    }

    /// One number. Normalised integers are shares of the greatest (glTF 2.0, 3.6.2.2).
    fn number(self, bytes: &[u8]) -> f64 {
        let mut wide = [0; 4];
        wide[..bytes.len()].copy_from_slice(bytes);
        let bits = u32::from_le_bytes(wide);
        let (value, greatest) = match self.component {
            ComponentType::I8 => (f64::from(bits as u8 as i8), 127.0),
            ComponentType::U8 => (f64::from(bits), 255.0),
            ComponentType::I16 => (f64::from(bits as u16 as i16), 32_767.0),
            ComponentType::U16 => (f64::from(bits), 65_535.0),
            ComponentType::U32 => (f64::from(bits), 4_294_967_295.0),
            ComponentType::F32 => return f64::from(f32::from_bits(bits)),
        };
        if self.normalized { f64::max(value / greatest, -1.0) } else { value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// A file of one buffer (0, 1, … 255) whose accessors are given.
    fn file(views: &str, accessors: &str) -> File {
        let bytes = super::super::uri::escaped(&(0..=255u8).collect::<Vec<_>>());
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":256,"uri":"data:,{bytes}"}}],
            "bufferViews":[{views}],"accessors":[{accessors}]}}"#
        );
        File::from_bytes(json.as_bytes(), Path::new("x.gltf")).unwrap()
    }

    fn read(file: &File) -> Result<Vec<f64>, String> {
        numbers(file, Index::new(0), &[Type::Scalar, Type::Vec2, Type::Vec3], "x")
            .map(|n| n.values)
            .map_err(|c| c.0)
    }

    #[test]
    fn strides_types_and_shares() {
        let views = r#"{"buffer":0,"byteOffset":4,"byteLength":20,"byteStride":8}"#;
        let f =
            file(views, r#"{"bufferView":0,"byteOffset":1,"count":2,"type":"VEC2","componentType":5121}"#);
        assert_eq!(read(&f).unwrap(), [5.0, 6.0, 13.0, 14.0]);
        let f = file(
            views,
            r#"{"bufferView":0,"byteOffset":0,"count":1,"type":"SCALAR","componentType":5123,"normalized":true}"#,
        );
        assert_eq!(read(&f).unwrap(), [f64::from(4 + 256 * 5) / 65_535.0]);
        // the last element must be there whole, the rest of its stride need not
        let three =
            |count| format!(r#"{{"bufferView":0,"count":{count},"type":"SCALAR","componentType":5125}}"#);
        assert_eq!(read(&file(views, &three(3))).unwrap().len(), 3);
        assert!(read(&file(views, &three(4))).unwrap_err().contains("beyond"));
        // 200 as i8 is −56
        let f = file(
            r#"{"buffer":0,"byteOffset":200,"byteLength":1}"#,
            r#"{"bufferView":0,"count":1,"type":"SCALAR","componentType":5120,"normalized":true}"#,
        );
        assert_eq!(read(&f).unwrap(), [-56.0 / 127.0]);
    }

    #[test]
    fn sparse_parts_change_zeros() {
        let views =
            r#"{"buffer":0,"byteOffset":1,"byteLength":2},{"buffer":0,"byteOffset":10,"byteLength":2}"#;
        let sparse = |count: u32, elements: u32| {
            format!(
                r#"{{"count":{elements},"type":"SCALAR","componentType":5121,"sparse":{{"count":{count},
                "indices":{{"bufferView":0,"componentType":5121}},"values":{{"bufferView":1}}}}}}"#
            )
        };
        assert_eq!(read(&file(views, &sparse(2, 4))).unwrap(), [0.0, 10.0, 11.0, 0.0]);
        assert!(read(&file(views, &sparse(2, 2))).unwrap_err().contains("sparse index"));
        assert!(read(&file(views, &sparse(3, 9))).unwrap_err().contains("sparse part"));
        assert!(read(&file(views, &sparse(1, 100_000_000))).unwrap_err().contains("zeros"));
    }
}
