//! Disjoint rows of a film, so that threads fill it without locks.

use crate::film::{Film, Srgb8};

/// Where colour goes.
#[derive(Debug)]
pub enum Color<'a> {
    /// As [`Film::rgb`].
    Linear(&'a mut [[f32; 3]]),
    /// As [`Film::codes`].
    Codes {
        /// Three codes a pixel.
        all: &'a mut [[u8; 3]],
        /// What makes them of light,
        curve: &'static Srgb8,
        /// after this factor.
        gain: f32,
    },
}

impl Color<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Linear(rgb) => rgb.len(),
            Self::Codes { all, .. } => all.len(),
        }
    }

    /// Puts linear light at a place.
    #[inline]
    pub fn put(&mut self, place: usize, rgb: [f32; 3]) {
        match self {
            Self::Linear(all) => all[place] = rgb,
            Self::Codes { all, curve, gain } => {
                let [r, g, b] = rgb;
                all[place] = [curve.code(r * *gain), curve.code(g * *gain), curve.code(b * *gain)];
            }
        }
    }
}

/// Some whole rows of a film with its auxiliary pictures.
#[derive(Debug)]
pub struct FilmBand<'a> {
    /// Its first row in the film.
    pub first_row: u32,
    /// How many rows.
    pub rows: u32,
    /// Pixels a row.
    pub width: u32,
    /// Its colour.
    pub color: Color<'a>,
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

/// Cuts a film into bands of `rows` rows (1 or more); the last may have fewer. Colour is multiplied by `gain` where it is
/// stored as codes.
pub fn bands(film: &mut Film, rows: u32, gain: f32) -> Vec<FilmBand<'_>> {
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
    let colors: Vec<Color> = match &mut film.codes {
        Some(codes) => {
            let curve = Srgb8::table();
            let codes = codes.as_chunks_mut().0.chunks_mut(pixels);
            codes.map(|all| Color::Codes { all, curve, gain }).collect()
        }
        None => film.rgb.chunks_mut(pixels).map(Color::Linear).collect(),
    };
    (0..)
        .zip(colors)
        .map(|(i, color)| FilmBand {
            first_row: i * rows,
            rows: color.len() as u32 / width,
            width,
            color,
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
