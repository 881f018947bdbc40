//! Decoded textures with their levels in the store: size, what the numbers are, texels.

use super::TextureUse;
use crate::scene::{PartHasher, TexelSpace, Texels, Texture};
use crate::store::{Key, Payload, Store};

/// Another name for each form in which textures are kept, or in which they are decoded.
const KIND: &str = "texture-1";

/// The name of what becomes of a picture file.
pub(super) fn key(file: &[u8], texture_use: TextureUse) -> Key {
    let mut h = PartHasher::new(KIND);
    h.u64(u64::from(texture_use == TextureUse::Color));
    h.bytes(file);
    Key(h.finish().0)
}

pub(super) fn put(store: &Store, key: Key, texture: &Texture) {
    let is_float = matches!(texture.texels, Texels::F32(_));
    let flags = [texture.space == TexelSpace::Srgb, texture.alpha_varies, is_float];
    let flags = flags.iter().rev().fold(0, |bits, &flag| bits << 1 | u32::from(flag));
    let head = [texture.size[0], texture.size[1], flags];
    let texels: &[u8] = match &texture.texels {
        Texels::U8(t) => bytemuck::cast_slice(t),
        Texels::F32(t) => bytemuck::cast_slice(t),
    };
    let head = head.map(u32::to_le_bytes);
    store.put(KIND, key, &[head.as_flattened(), texels]);
}

/// The texture that was put; None where the store has none, or one of another form.
pub(super) fn get(store: &Store, key: Key) -> Option<Texture> {
    store.get(KIND, key, taken)
}

fn taken(payload: &mut Payload) -> Option<Texture> {
    let [width, height, flags] = payload.values::<[u32; 3]>(1)?[0].map(u32::from_le);
    if width == 0 || height == 0 || flags > 7 {
        return None;
    }
    let mut texture = Texture {
        size: [width, height],
        space: if flags & 1 != 0 { TexelSpace::Srgb } else { TexelSpace::Linear },
        alpha_varies: flags & 2 != 0,
        texels: Texels::U8(Vec::new()),
    };
    let count: usize = (0..texture.levels())
        .map(|level| texture.level_size(level).map(|s| s as usize))
        .try_fold(0_usize, |sum, [w, h]| sum.checked_add(w.checked_mul(h)?))?;
    texture.texels =
        if flags & 4 != 0 { Texels::F32(payload.values(count)?) } else { Texels::U8(payload.values(count)?) };
    (payload.left() == 0).then_some(texture)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_come_back_as_they_were() {
        let t = tempfile::tempdir().unwrap();
        let store = Store::new(t.path(), 1 << 20);
        let u8s = Texture {
            size: [2, 1],
            space: TexelSpace::Srgb,
            alpha_varies: true,
            texels: Texels::U8(vec![[1, 2, 3, 4], [5, 6, 7, 8], [9, 9, 9, 9]]),
        };
        let floats = Texture {
            size: [1, 1],
            space: TexelSpace::Linear,
            alpha_varies: false,
            texels: Texels::F32(vec![[0.5, -0.0, 1e30, 1.0]]),
        };
        for texture in [u8s, floats] {
            for texture_use in [TextureUse::Color, TextureUse::Data] {
                let key = key(b"file", texture_use);
                put(&store, key, &texture);
                assert_eq!(get(&store, key).unwrap(), texture);
            }
        }
        // too few texels for its size
        let short = Texture {
            size: [4, 4],
            space: TexelSpace::Linear,
            alpha_varies: false,
            texels: Texels::U8(vec![[0; 4]; 3]),
        };
        put(&store, Key(7), &short);
        assert_eq!(get(&store, Key(7)), None);
        assert!(key(b"a", TextureUse::Color) != key(b"a", TextureUse::Data));
    }
}
