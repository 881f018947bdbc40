//! Charts: lines over the frames of a sequence, or over what else is varied, in panels one above the other.

use super::drawing::{Area, COLORS, Canvas, Drawing, FONT};
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::element::PathElement;
use plotters::prelude::{
    BLACK, Cartesian2d, ChartBuilder, ChartContext, Circle, Color, IntoLogRange, LineSeries,
    SeriesLabelPosition, WHITE,
};
use std::error::Error;

/// Named points.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// Its name.
    pub(super) name: String,
    /// Its points, by x.
    pub(super) points: Vec<(f64, f64)>,
}

/// Lines over the same axes.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    /// What x is.
    pub(super) x: String,
    /// Whether x is logarithmic.
    pub(super) is_log_x: bool,
    /// What y is, with its unit.
    pub(super) y: String,
    /// Whether y is logarithmic.
    pub(super) is_log: bool,
    /// The lines.
    pub(super) lines: Vec<Line>,
}

/// Panels one above the other.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    /// Its file name without extension.
    pub(super) name: String,
    /// What stands above.
    pub(super) title: String,
    /// The panels.
    pub(super) panels: Vec<Panel>,
}

const SIZE: (u32, u32) = (900, 620);
/// Points that are marked each, at most.
const MARKED: usize = 24;
/// Widths of lines: where they lie on each other, those below look out.
const WIDTHS: [u32; 8] = [2, 6, 4, 2, 2, 3, 4, 2];

impl Drawing for Chart {
    fn name(&self) -> &str {
        &self.name
    }

    fn size(&self) -> (u32, u32) {
        SIZE
    }

    fn draw<C: Canvas>(&self, root: &Area<C>) -> Result<(), Box<dyn Error>> {
        let root = root.titled(&self.title, (FONT, 22))?;
        for (area, panel) in root.split_evenly((self.panels.len(), 1)).iter().zip(&self.panels) {
            panel.draw(area)?;
        }
        Ok(())
    }
}

impl Panel {
    fn draw<C: Canvas>(&self, area: &Area<C>) -> Result<(), Box<dyn Error>> {
        let points = || self.lines.iter().flat_map(|line| line.points.iter());
        let least = points().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let greatest = points().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
        // without points there is nothing to hold
        let [least, greatest] = if least.is_finite() { [least, greatest] } else { [1.0; 2] };
        let last = points().map(|p| p.0).fold(1.0, f64::max);
        // the names stand beside the lines: so much of the width is theirs
        let longest = self.lines.iter().map(|line| line.name.chars().count()).max().unwrap_or(0);
        let share = (50.0 + 7.5 * longest as f64) / f64::from(SIZE.0 - 88);
        let more = share.min(0.6) / (1.0 - share.min(0.6));
        let mut builder = ChartBuilder::on(area);
        builder.margin(12).x_label_area_size(36).y_label_area_size(64);
        let [low, high] = [least / 1.1, greatest * 1.1];
        let (log_y, y) =
            ((low.max(1e-9)..high).log_scale(), 0.0..if greatest > 0.0 { greatest * 1.1 } else { 1.0 });
        if self.is_log_x {
            let first = points().map(|p| p.0).fold(last, f64::min).max(1e-9);
            let x = (first..last.max(first * 2.0) * (last / first).max(2.0).powf(more)).log_scale();
            if self.is_log {
                self.lines_on(builder.build_cartesian_2d(x, log_y)?)
            } else {
                self.lines_on(builder.build_cartesian_2d(x, y)?)
            }
        } else {
            let x = 1.0..(last.max(2.0) - 1.0) * (1.0 + more) + 1.0;
            if self.is_log {
                self.lines_on(builder.build_cartesian_2d(x, log_y)?)
            } else {
                self.lines_on(builder.build_cartesian_2d(x, y)?)
            }
        }
    }

    fn lines_on<'a, C, X, Y>(
        &self,
        mut chart: ChartContext<'a, C, Cartesian2d<X, Y>>,
    ) -> Result<(), Box<dyn Error>>
    where
        C: Canvas + 'a,
        X: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        chart
            .configure_mesh()
            .light_line_style(WHITE.mix(0.0))
            .x_desc(&self.x)
            .x_label_formatter(&|&x| label(x))
            .y_label_formatter(&|&y| label(y))
            .y_desc(&self.y)
            .label_style((FONT, 13))
            .draw()?;
        let drawn = (1..self.lines.len()).chain(0..self.lines.len().min(1));
        for i in drawn {
            let style = COLORS[i % COLORS.len()].stroke_width(WIDTHS[i % WIDTHS.len()]);
            let points = || self.lines[i].points.iter().copied();
            if self.lines[i].points.len() <= MARKED {
                chart.draw_series(points().map(|point| Circle::new(point, 3, style.filled())))?;
            }
            chart
                .draw_series(LineSeries::new(points(), style))?
                .label(&self.lines[i].name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::MiddleRight)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .label_font((FONT, 13))
            .draw()?;
        Ok(())
    }
}

/// A round number, short.
fn label(x: f64) -> String {
    let size = x.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        format!("{x:e}")
    } else if size >= 10.0 {
        format!("{x:.0}")
    } else {
        // what sums of steps leave behind the third place is no part of it
        format!("{}", (x * 1e3).round() / 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_names_its_lines_and_axes() {
        let line = Line { name: "refit".to_string(), points: vec![(1.0, 1.0), (2.0, 400.0), (3.0, 20.0)] };
        let panel = |is_log| Panel {
            x: "frame".to_string(),
            is_log_x: is_log,
            y: "cost".to_string(),
            is_log,
            lines: vec![line.clone()],
        };
        let chart = Chart {
            name: "c".to_string(),
            title: "Twist".to_string(),
            panels: vec![panel(true), panel(false)],
        };
        let svg = chart.svg().unwrap();
        for word in ["Twist", "cost", "frame", "refit", "polyline"] {
            assert!(svg.contains(word), "{word}: {svg}");
        }
        let pixels = chart.pixels().unwrap();
        let count = |of: [u8; 3]| pixels.as_chunks::<3>().0.iter().filter(|p| **p == of).count();
        let (red, green, blue) = COLORS[0].rgb();
        // the line in both panels, the axes and letters, and white in most of it
        assert!(count([red, green, blue]) > 500, "{}", count([red, green, blue]));
        assert!(count([0; 3]) > 1000, "{}", count([0; 3]));
        assert!(count([255; 3]) > pixels.len() / 3 / 2);
        assert!(chart.png().unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));
        let empty = Chart { panels: vec![Panel { lines: Vec::new(), ..panel(true) }], ..chart };
        assert!(empty.svg().is_ok());
    }
}
