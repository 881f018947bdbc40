//! What is drawn on white, as SVG and as PNG.

use crate::film::Film;
use crate::output::{Bits, Encoding, Format, encode};
use plotters::coord::Shift;
use plotters::prelude::{
    BitMapBackend, DrawingArea, DrawingBackend, IntoDrawingArea, RGBColor, SVGBackend, WHITE,
};
use plotters::style::{FontStyle, register_font};
use std::error::Error;

/// An SVG's letters are those of whoever shows it; a PNG's and the room for both are those of a font of our own.
pub(super) const FONT: &str = "sans-serif";
/// Okabe and Ito's palette, which people with any colour vision can tell apart.
pub(super) const COLORS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(213, 94, 0),
    RGBColor(240, 228, 66),
    RGBColor(0, 0, 0),
];

/// What can be drawn on.
pub(super) trait Canvas: DrawingBackend<ErrorType: 'static> {}

impl<B: DrawingBackend<ErrorType: 'static>> Canvas for B {}

/// Where something is drawn.
pub(super) type Area<C> = DrawingArea<C, Shift>;

/// Something that can be drawn.
pub(super) trait Drawing {
    /// Its file name without extension.
    fn name(&self) -> &str;

    /// Its width and height, pixels.
    fn size(&self) -> (u32, u32);

    /// Draws it.
    fn draw<C: Canvas>(&self, root: &Area<C>) -> Result<(), Box<dyn Error>>;

    /// It as SVG.
    fn svg(&self) -> Result<String, String> {
        let mut svg = String::new();
        on_white(self, SVGBackend::with_string(&mut svg, self.size()))?;
        Ok(svg)
    }

    /// Its pixels: RGB of 8 bits, rows from the top.
    fn pixels(&self) -> Result<Vec<u8>, String> {
        let (width, height) = self.size();
        let mut codes = vec![0; 3 * width as usize * height as usize];
        on_white(self, BitMapBackend::with_buffer(&mut codes, self.size()))?;
        Ok(codes)
    }

    /// It as PNG.
    fn png(&self) -> Result<Vec<u8>, String> {
        let (width, height) = self.size();
        let film = Film::of_codes([width, height], self.pixels()?.into());
        let encoding = Encoding { format: Format::Png, bits: Bits::Eight, exposure_stops: 0.0, quality: 92 };
        encode(&film, encoding).map_err(|e| e.to_string())
    }
}

fn on_white<C: Canvas>(drawing: &(impl Drawing + ?Sized), canvas: C) -> Result<(), String> {
    let drawn = || {
        let root = canvas.into_drawing_area();
        root.fill(&WHITE)?;
        drawing.draw(&root)?;
        root.present()?;
        Ok::<_, Box<dyn Error>>(())
    };
    // once more is no harm
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_| "the font is damaged".to_string())?;
    drawn().map_err(|e| e.to_string())
}
