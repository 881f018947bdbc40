//! Disjoint rows of a film, so that threads fill it without locks.

use crate::film::Film;

/// Some whole rows of a film with its auxiliary pictures.
#[derive(Debug)]
pub struct FilmBand<'a> {
    /// Its first row in the film.
    pub first_row: u32,
    /// How many rows.
    pub rows: u32,
    /// Pixels a row.
    pub width: u32,
    /// As [`Film::rgb`].
    pub rgb: &'a mut [[f32; 3]],
    /// As [`Film::alpha`].
    pub alpha: Option<&'a mut [f32]>,
    /// As [`crate::film::Aovs::depth`].
    pub depth: Option<&'a mut [f32]>,
    /// As [`crate::film::Aovs::normal`].
    pub normal: Option<&'a mut [[f32; 3]]>,
    /// As [`crate::film::Aovs::position`].
    pub position: Option<&'a mut [[f32; 3]]>,
    /// As [`crate::film::Aovs::albedo`].
    pub albedo: Option<&'a mut [[f32; 3]]>,
    /// As [`crate::film::Aovs::id`].
    pub id: Option<&'a mut [[u32; 2]]>,
    /// As [`crate::film::Aovs::material`].
    pub material: Option<&'a mut [u32]>,
    /// As [`crate::film::Aovs::uv`].
    pub uv: Option<&'a mut [[f32; 2]]>,
    /// As [`crate::film::Aovs::coverage`].
    pub coverage: Option<&'a mut [f32]>,
}

impl FilmBand<'_> {
    /// A pixel's place in its slices, from its column and its row in the band.
    pub fn place(&self, [x, row]: [u32; 2]) -> usize {
        row as usize * self.width as usize + x as usize
    }

    /// Whether an auxiliary picture of the ray through the pixel's centre is wanted.
    pub fn wants_center(&self) -> bool {
        self.depth.is_some()
            || self.normal.is_some()
            || self.position.is_some()
            || self.id.is_some()
            || self.material.is_some()
            || self.uv.is_some()
    }
}

/// Cuts a film into bands of `rows` rows (1 or more); the last may have fewer.
pub fn bands(film: &mut Film, rows: u32) -> Vec<FilmBand<'_>> {
    let width = film.size[0];
    let pixels = width as usize * rows as usize;
    let aovs = &mut film.aovs;
    let mut alpha = film.alpha.as_mut().map(|p| p.chunks_mut(pixels));
    let mut depth = aovs.depth.as_mut().map(|p| p.chunks_mut(pixels));
    let mut normal = aovs.normal.as_mut().map(|p| p.chunks_mut(pixels));
    let mut position = aovs.position.as_mut().map(|p| p.chunks_mut(pixels));
    let mut albedo = aovs.albedo.as_mut().map(|p| p.chunks_mut(pixels));
    let mut id = aovs.id.as_mut().map(|p| p.chunks_mut(pixels));
    let mut material = aovs.material.as_mut().map(|p| p.chunks_mut(pixels));
    let mut uv = aovs.uv.as_mut().map(|p| p.chunks_mut(pixels));
    let mut coverage = aovs.coverage.as_mut().map(|p| p.chunks_mut(pixels));
    film.rgb
        .chunks_mut(pixels)
        .enumerate()
        .map(|(i, rgb)| FilmBand {
            first_row: i as u32 * rows,
            rows: rgb.len() as u32 / width,
            width,
            rgb,
            alpha: alpha.as_mut().and_then(Iterator::next),
            depth: depth.as_mut().and_then(Iterator::next),
            normal: normal.as_mut().and_then(Iterator::next),
            position: position.as_mut().and_then(Iterator::next),
            albedo: albedo.as_mut().and_then(Iterator::next),
            id: id.as_mut().and_then(Iterator::next),
            material: material.as_mut().and_then(Iterator::next),
            uv: uv.as_mut().and_then(Iterator::next),
            coverage: coverage.as_mut().and_then(Iterator::next),
        })
        .collect()
}
