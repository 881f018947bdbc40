//! What a ray is inside of: a stack of media.

/// Media that a ray is within at most; deeper ones are ignored.
pub const MEDIA_MAX: usize = 8;

/// The materials that a ray has entered and not left, the latest last, by their places in
/// [`super::world::World::materials`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Media {
    materials: [u32; MEDIA_MAX],
    depth: usize,
}

impl Media {
    /// The latest.
    pub fn top(&self) -> Option<u32> {
        self.materials[..self.depth].last().copied()
    }

    /// Enters a material; false where that is too deep and ignored.
    pub fn enter(&mut self, material: u32) -> bool {
        let is_room = self.depth < MEDIA_MAX;
        if is_room {
            self.materials[self.depth] = material;
            self.depth += 1;
        }
        is_room
    }

    /// Leaves a material: its latest entry is removed, where there is one.
    pub fn leave(&mut self, material: u32) {
        if let Some(place) = self.materials[..self.depth].iter().rposition(|&m| m == material) {
            self.materials.copy_within(place + 1..self.depth, place);
            self.depth -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_entry_is_left_wherever_it_stands() {
        let mut media = Media::default();
        assert_eq!(media.top(), None);
        for material in [3, 5, 3, 7] {
            assert!(media.enter(material));
        }
        media.leave(3);
        assert_eq!((media.top(), media.depth), (Some(7), 3));
        media.leave(7);
        assert_eq!(media.top(), Some(5));
        media.leave(9);
        media.leave(5);
        assert_eq!(media.top(), Some(3));
    }

    #[test]
    fn a_ninth_is_ignored() {
        let mut media = Media::default();
        assert!((0..8).all(|material| media.enter(material)));
        assert!(!media.enter(8));
        assert_eq!(media.top(), Some(7));
    }
}
