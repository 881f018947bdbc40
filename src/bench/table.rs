//! Tables of figures: for the terminal and as JSON.

use super::times::Spread;
use serde::Serialize;
use std::fmt;

/// One figure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// Of repeated measurements.
    Measured(Spread),
    /// A number.
    Number(f64),
    /// Not measured: there is nothing to measure, or the peer is absent.
    Absent,
}

impl Cell {
    /// The number that a reader compares.
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Measured(spread) => Some(spread.median),
            Self::Number(x) => Some(*x),
            Self::Absent => None,
        }
    }

    /// How many times this is in the other; absent where either is.
    #[must_use]
    pub fn times_in(&self, other: Self) -> Self {
        match (self.value(), other.value()) {
            (Some(a), Some(b)) if a > 0.0 => Self::Number(b / a),
            _ => Self::Absent,
        }
    }
}

impl From<Spread> for Cell {
    fn from(spread: Spread) -> Self {
        Self::Measured(spread)
    }
}

impl From<f64> for Cell {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(cell: Option<T>) -> Self {
        cell.map_or(Self::Absent, Into::into)
    }
}

impl fmt::Display for Cell {
    /// Three digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(x) = self.value() else { return f.pad("-") };
        let decimals = if x == 0.0 { 0 } else { (2 - x.abs().log10().floor() as i32).clamp(0, 6) };
        f.pad(&format!("{x:.*}", decimals as usize))
    }
}

/// Rows of figures.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// A word, unique in its workload.
    pub name: &'static str,
    /// What the figures are, for people.
    pub about: String,
    /// The columns, with their units.
    pub columns: Vec<String>,
    /// The rows by name.
    pub rows: Vec<(String, Vec<Cell>)>,
}

impl Table {
    /// Without rows yet.
    pub fn new(name: &'static str, about: impl Into<String>, columns: &[&str]) -> Self {
        let columns = columns.iter().map(ToString::to_string).collect();
        Self { name, about: about.into(), columns, rows: Vec::new() }
    }

    /// Adds a row; it has as many cells as there are columns.
    pub fn row<const N: usize>(&mut self, name: impl Into<String>, cells: [Cell; N]) {
        self.rows.push((name.into(), cells.to_vec()));
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = self.rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = self.columns.iter().map(|c| c.chars().count().max(7)).collect();
        writeln!(f, "{}", self.about)?;
        write!(f, "{:names$}", "")?;
        for (column, width) in self.columns.iter().zip(&widths) {
            write!(f, "  {column:>width$}")?;
        }
        writeln!(f)?;
        for (name, cells) in &self.rows {
            write!(f, "{name:names$}")?;
            for (cell, width) in cells.iter().zip(&widths) {
                write!(f, "  {cell:>width$}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_three_digits_and_stand_in_columns() {
        let mut table = Table::new("t", "About.", &["read, ms", "peer, ms", "ratio"]);
        let (read, peer) = (Cell::Number(0.51234), Cell::Number(12.0));
        table.row("one", [read, peer, read.times_in(peer)]);
        table.row("another", [Cell::Number(1234.5), Cell::Absent, read.times_in(Cell::Absent)]);
        let text = "About.\n         read, ms  peer, ms    ratio\none         0.512      12.0     23.4\nanother      1234         -        -\n";
        assert_eq!(table.to_string(), text);
    }
}
