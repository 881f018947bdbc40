//! Charts of rows: for each a line on which its figures stand as dots, on a logarithmic axis that all share.

use super::drawing::{Area, COLORS, Canvas, Drawing, FONT};
use super::table::Table;
use plotters::prelude::{BLACK, Circle, Color, PathElement, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{IntoFont, TextStyle};
use std::error::Error;

const WIDTH: u32 = 900;
const ROW: i32 = 20;
const TOP: i32 = 62;
/// Width of a letter of the rows' names, at most.
const LETTER: i32 = 8;
const RIGHT: i32 = 880;

/// A chart of some columns of a table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dots<'a> {
    /// Its file name without extension.
    pub(super) name: &'a str,
    /// The table.
    pub(super) table: &'a Table,
    /// What stands above.
    pub(super) title: &'a str,
    /// The unit of all figures.
    pub(super) unit: &'a str,
    /// Columns by their place, and what they are called.
    pub(super) columns: &'a [(usize, &'a str)],
}

fn text(size: i32, h: HPos) -> TextStyle<'static> {
    TextStyle::from((FONT, size).into_font()).color(&BLACK).pos(Pos::new(h, VPos::Center))
}

impl Drawing for Dots<'_> {
    fn name(&self) -> &str {
        self.name
    }

    fn size(&self) -> (u32, u32) {
        (WIDTH, (TOP + ROW * self.table.rows.len() as i32 + 44) as u32)
    }

    fn draw<C: Canvas>(&self, root: &Area<C>) -> Result<(), Box<dyn Error>> {
        let Self { table, title, unit, columns, .. } = *self;
        let value = |row: usize, column: usize| table.rows[row].1[column].value().filter(|x| *x > 0.0);
        let all =
            || (0..table.rows.len()).flat_map(|row| columns.iter().filter_map(move |(c, _)| value(row, *c)));
        let first = all().fold(f64::INFINITY, f64::min).min(1e9).log10().floor();
        let last = all().fold(0.0, f64::max).max(1e-9).log10().ceil().max(first + 1.0);
        let longest = table.rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        let left = 16 + LETTER * longest as i32;
        let x =
            |value: f64| left + (f64::from(RIGHT - left) * (value.log10() - first) / (last - first)) as i32;
        let bottom = TOP + ROW * table.rows.len() as i32;

        root.draw(&Text::new(title.to_string(), (12, 16), text(20, HPos::Left)))?;
        let mut from = left;
        for (i, (_, name)) in columns.iter().enumerate() {
            root.draw(&Circle::new((from, 42), 5, COLORS[i % COLORS.len()].filled()))?;
            root.draw(&Text::new((*name).to_string(), (from + 10, 42), text(14, HPos::Left)))?;
            from += 34 + 8 * name.chars().count() as i32;
        }
        for power in first as i32..=last as i32 {
            let at = x(10.0_f64.powi(power));
            root.draw(&PathElement::new(vec![(at, TOP - 6), (at, bottom)], BLACK.mix(0.15)))?;
            let label = if power < 0 {
                format!("{:.*}", -power as usize, 10.0_f64.powi(power))
            } else {
                format!("{:.0}", 10.0_f64.powi(power))
            };
            root.draw(&Text::new(label, (at, bottom + 12), text(13, HPos::Center)))?;
        }
        root.draw(&Text::new(
            unit.to_string(),
            (i32::midpoint(left, RIGHT), bottom + 32),
            text(14, HPos::Center),
        ))?;
        for (row, (name, _)) in table.rows.iter().enumerate() {
            let y = TOP + ROW * row as i32 + ROW / 2;
            root.draw(&Text::new(name.clone(), (left - 8, y), text(13, HPos::Right)))?;
            root.draw(&PathElement::new(vec![(left, y), (RIGHT, y)], BLACK.mix(0.08)))?;
            for (i, (column, _)) in columns.iter().enumerate() {
                if let Some(value) = value(row, *column) {
                    root.draw(&Circle::new((x(value), y), 5, COLORS[i % COLORS.len()].filled()))?;
                }
            }
        }
        Ok(())
    }
}
