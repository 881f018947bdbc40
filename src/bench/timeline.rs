//! A few warm frames over time: what the host does for them and what the device does, one frame at a time and as many under
//! way as the device takes.

use super::drawing::{Area, Canvas, Drawing, FONT};
use super::frames::{SPHERE, failed, poses, sphere_shot};
use super::table::{Cell, Table};
use super::{Bench, BenchError};
use crate::clock::Stopwatch;
use crate::device::{Device, Output, Spans, Stop};
use crate::plan::{Update, Wishes, plan_frame};
use crate::scene::{Frame, Shot};
use plotters::prelude::{BLACK, Color, PathElement, RGBColor, Rectangle, Text, WHITE};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{IntoFont, TextStyle};
use std::collections::VecDeque;
use std::error::Error;

/// Frames before those that are shown, of which there are so many.
const BEFORE: usize = 200;
const SHOWN: usize = 6;
/// The picture.
const PICTURE: [u32; 2] = [1920, 1080];

/// What a frame is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Send,
    HandOver,
    Fit,
    Trace,
}

impl Stage {
    const ALL: [Self; 4] = [Self::Send, Self::HandOver, Self::Fit, Self::Trace];

    fn word(self) -> &'static str {
        match self {
            Self::Send => "diff, send positions",
            Self::HandOver => "record commands",
            Self::Fit => "fit the tree",
            Self::Trace => "trace",
        }
    }

    /// Okabe and Ito's palette, which people with any colour vision can tell apart.
    fn color(self) -> RGBColor {
        match self {
            Self::Send => RGBColor(230, 159, 0),
            Self::HandOver => RGBColor(204, 121, 167),
            Self::Fit => RGBColor(0, 158, 115),
            Self::Trace => RGBColor(0, 114, 178),
        }
    }

    fn is_on_device(self) -> bool {
        matches!(self, Self::Fit | Self::Trace)
    }
}

/// From when to when a frame was at something, ms.
#[derive(Clone, Copy, Debug)]
struct Bar {
    frame: usize,
    stage: Stage,
    from: f64,
    to: f64,
}

/// Frames over time.
#[derive(Clone, Debug)]
struct Lanes {
    title: String,
    bars: Vec<Bar>,
}

/// The chart.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    lanes: Vec<Lanes>,
}

/// How busy host and device are, and the chart; None where the device has no clock.
pub(super) fn timeline(
    bench: &Bench,
    device: &mut dyn Device,
) -> Result<Option<(Table, Timeline)>, BenchError> {
    let mut table = Table::new(
        "timeline",
        "The same warm frame at 1920x1080, one sample, 8 bits: ms from frame to frame, and the share of it that the host's one thread and the device work.",
        &["frame, ms", "host, %", "device, %"],
    );
    let poses = poses(SPHERE);
    let shot = sphere_shot(&poses[0], PICTURE, 1);
    let mut lanes = Vec::new();
    let most = device.most_under_way();
    let mut ways = vec![1, most];
    ways.dedup();
    for under_way in ways {
        let Some(bars) = bars(device, &poses, &shot, under_way, bench.rounds(BEFORE))? else {
            return Ok(None);
        };
        let title =
            if under_way == 1 { "one at a time".to_string() } else { format!("{under_way} under way") };
        let begin = |frame: usize| {
            bars.iter().filter(|b| b.frame == frame).map(|b| b.from).fold(f64::INFINITY, f64::min)
        };
        let whole = begin(SHOWN) - begin(0);
        let busy = |on_device: bool| {
            let within = bars.iter().filter(|b| b.frame < SHOWN && b.stage.is_on_device() == on_device);
            Cell::Number(100.0 * within.map(|b| b.to - b.from).sum::<f64>() / whole)
        };
        table.row(title.clone(), [Cell::Number(whole / SHOWN as f64), busy(false), busy(true)]);
        lanes.push(Lanes { title, bars });
    }
    Ok(Some((table, Timeline { lanes })))
}

/// The host's times of a frame, ms, and the device's by its own clock.
struct Frames {
    frame: usize,
    /// When sending began, commands were recorded, all was handed over.
    begun: [f64; 3],
    /// When the picture was there.
    there: f64,
    spans: Spans,
}

/// What frames are at, from 0 on for the first of those that are shown; one more than those, for where it begins.
fn bars(
    device: &mut dyn Device,
    frames: &[Frame],
    shot: &Shot,
    under_way: usize,
    before: usize,
) -> Result<Option<Vec<Bar>>, BenchError> {
    let clock = Stopwatch::start();
    let mut begun = VecDeque::new();
    let mut done = Vec::new();
    let mut finish = |device: &mut dyn Device, begun: &mut VecDeque<(usize, [f64; 3])>| {
        let Some((frame, begun)) = begun.pop_front() else { return Ok(()) };
        let traced = device.finish().map_err(failed)?;
        done.push(Frames { frame, begun, there: clock.ms(), spans: traced.spans });
        Ok::<_, BenchError>(())
    };
    for i in 0..=before + SHOWN {
        let frame = &frames[i % frames.len()];
        let start = clock.ms();
        let wishes = Wishes { update: Update::Refit, ..Wishes::default() };
        let plan = plan_frame(frame, device.residency(), &wishes);
        device.apply(&plan, frame).map_err(failed)?;
        let sent = clock.ms();
        device.begin(frame, shot, Output::Codes { exposure_stops: 0.0 }, &Stop::default()).map_err(failed)?;
        begun.push_back((i, [start, sent, clock.ms()]));
        while begun.len() >= under_way {
            finish(device, &mut begun)?;
        }
    }
    while !begun.is_empty() {
        finish(device, &mut begun)?;
    }
    done.retain(|f| f.frame >= before);
    let Some(first) = done.first().map(|f| f.begun[0]) else { return Ok(None) };
    // the device's clock is ahead of the host's by no more than what the fastest answer shows
    let ahead =
        done.iter().filter_map(|f| Some(f.spans.trace?[1] - f.there)).fold(f64::NEG_INFINITY, f64::max);
    if !ahead.is_finite() {
        return Ok(None);
    }
    let mut bars = Vec::new();
    for f in &done {
        let mut add = |stage: Stage, from: f64, to: f64| {
            bars.push(Bar { frame: f.frame - before, stage, from: from - first, to: to - first });
        };
        add(Stage::Send, f.begun[0], f.begun[1]);
        add(Stage::HandOver, f.begun[1], f.begun[2]);
        for (stage, span) in [(Stage::Fit, f.spans.update), (Stage::Trace, f.spans.trace)] {
            if let Some([from, to]) = span {
                add(stage, from - ahead, to - ahead);
            }
        }
    }
    Ok(Some(bars))
}

const SIZE: (u32, u32) = (1000, 420);
/// Where lanes begin and end, x.
const LEFT: i32 = 90;
const RIGHT: i32 = 980;
/// A lane's height.
const LANE: i32 = 44;

impl Drawing for Timeline {
    fn name(&self) -> &'static str {
        "timeline"
    }

    fn size(&self) -> (u32, u32) {
        SIZE
    }

    fn draw<C: Canvas>(&self, root: &Area<C>) -> Result<(), Box<dyn Error>> {
        // both have one scale: that of the frames that are shown of the slowest
        let shown = |b: &&Bar| b.frame < SHOWN;
        let most =
            self.lanes.iter().flat_map(|l| l.bars.iter().filter(shown)).map(|b| b.to).fold(0.1, f64::max);
        let x = |ms: f64| LEFT + (f64::from(RIGHT - LEFT) * ms / most).round() as i32;
        let style = text(14, HPos::Left, &BLACK);
        let mut from = LEFT;
        for stage in Stage::ALL {
            root.draw(&Rectangle::new([(from, 10), (from + 16, 26)], stage.color().filled()))?;
            root.draw(&Text::new(stage.word(), (from + 22, 18), style.clone()))?;
            from += 48 + 8 * stage.word().len() as i32;
        }
        for (i, lanes) in (0..).zip(&self.lanes) {
            lanes.draw(root, 50 + i * (2 * LANE + 70), &x)?;
        }
        let y = 50 + self.lanes.len() as i32 * (2 * LANE + 70) - 20;
        axis(root, y, most, &x)
    }
}

/// A scale below all lanes.
fn axis<C: Canvas>(root: &Area<C>, y: i32, most: f64, x: &impl Fn(f64) -> i32) -> Result<(), Box<dyn Error>> {
    root.draw(&PathElement::new(vec![(LEFT, y), (RIGHT, y)], BLACK))?;
    // five to ten marks, at 1, 2 or 5 of a power of ten
    let power = 10_f64.powf((most / 10.0).log10().ceil());
    let step = [0.2, 0.5, 1.0].into_iter().map(|s| s * power).find(|s| most / s <= 10.0).unwrap_or(power);
    for i in 0..=(most / step) as i32 {
        let ms = f64::from(i) * step;
        root.draw(&PathElement::new(vec![(x(ms), y), (x(ms), y + 5)], BLACK))?;
        root.draw(&Text::new(format!("{ms:.1}"), (x(ms), y + 14), text(13, HPos::Center, &BLACK)))?;
    }
    root.draw(&Text::new("ms", (LEFT - 30, y + 14), text(13, HPos::Left, &BLACK)))?;
    Ok(())
}

impl Lanes {
    fn draw<C: Canvas>(
        &self,
        root: &Area<C>,
        top: i32,
        x: &impl Fn(f64) -> i32,
    ) -> Result<(), Box<dyn Error>> {
        root.draw(&Text::new(self.title.clone(), (LEFT, top), text(15, HPos::Left, &BLACK)))?;
        for (on_device, name) in [(false, "host"), (true, "device")] {
            let y = top + 12 + if on_device { LANE } else { 0 };
            root.draw(&Text::new(name, (14, y + LANE / 2), text(14, HPos::Left, &BLACK)))?;
            let bars = self.bars.iter().filter(|b| b.stage.is_on_device() == on_device);
            for bar in bars.filter(|b| b.from >= 0.0 && x(b.to) <= RIGHT) {
                let corners = [(x(bar.from), y + 4), (x(bar.to).max(x(bar.from) + 1), y + LANE - 4)];
                root.draw(&Rectangle::new(corners, bar.stage.color().filled()))?;
                if corners[1].0 - corners[0].0 >= 12 {
                    let middle = (i32::midpoint(corners[0].0, corners[1].0), y + LANE / 2);
                    let number = (bar.frame + 1).to_string();
                    root.draw(&Text::new(number, middle, text(13, HPos::Center, &WHITE)))?;
                }
            }
        }
        Ok(())
    }
}

fn text(size: i32, h: HPos, color: &RGBColor) -> TextStyle<'_> {
    TextStyle::from((FONT, size).into_font()).color(color).pos(Pos::new(h, VPos::Center))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_timeline_names_what_frames_are_at() {
        let bars = Stage::ALL.map(|stage| Bar { frame: 0, stage, from: 0.0, to: 0.7 }).to_vec();
        let lanes = vec![Lanes { title: "one at a time".to_string(), bars }];
        let svg = Timeline { lanes }.svg().unwrap();
        for word in Stage::ALL.map(Stage::word).into_iter().chain(["host", "device", "ms", "one at a time"]) {
            assert!(svg.contains(word), "{word}: {svg}");
        }
    }
}
