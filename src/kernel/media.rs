//! The media that a refracted ray is in, the latest entered on top.

/// Media that are told apart at most; deeper entries are ignored.
pub const MEDIA_MAX: usize = 8;

/// A stack of media, empty outside of everything.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Media {
    /// Material and optical density, the first entered first.
    entries: [(u32, f32); MEDIA_MAX],
    count: usize,
}

impl Media {
    /// The optical density of the medium on top; 1 outside of everything.
    pub fn density(&self) -> f32 {
        self.count.checked_sub(1).map_or(1.0, |top| self.entries[top].1)
    }

    /// Enters a material.
    #[must_use]
    pub fn entered(mut self, material: u32, density: f32) -> Self {
        if let Some(entry) = self.entries.get_mut(self.count) {
            *entry = (material, density);
            self.count += 1;
        }
        self
    }

    /// Leaves the latest entry of a material; one that was never entered changes nothing.
    #[must_use]
    pub fn left(mut self, material: u32) -> Self {
        if let Some(i) = self.entries[..self.count].iter().rposition(|e| e.0 == material) {
            self.entries.copy_within(i + 1..self.count, i);
            self.count -= 1;
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_entry_of_a_material_is_left() {
        let m = Media::default();
        assert_eq!(m.density(), 1.0);
        // glass in water in glass: leaving the water first leaves the glasses, the inner on top
        let m = m.entered(1, 1.5).entered(2, 1.33).entered(1, 1.6);
        assert_eq!((m.density(), m.left(2).density(), m.left(1).density()), (1.6, 1.6, 1.33));
        assert_eq!(m.left(1).left(2).density(), 1.5);
        assert_eq!(m.left(7), m);
    }

    #[test]
    fn deeper_entries_are_ignored() {
        let full = (0..10).fold(Media::default(), |m, i| m.entered(i, 2.0 + i as f32));
        assert_eq!(full.density(), 9.0);
        assert_eq!(full.left(9).density(), 9.0);
    }
}
