//! What builds, refits and frames cost on a device, learned from every frame.

use crate::device::{UpdateCost, Work};
use crate::plan::Costs;

/// How much a measurement counts for that took longer than those before. What disturbs a measurement makes it longer, so
/// one that took less time is believed at once.
const SLOWER: f64 = 0.1;
/// How much the latest trace counts for.
const NEWEST: f64 = 0.3;
/// How much what was learned of the sensitivity counts for after another frame.
const KEPT: f64 = 0.9;
/// How much the assumed sensitivity counts for: as much as one frame whose surface-area cost has risen by a half.
const ASSUMED: f64 = 0.25;
/// Up to this the surface-area cost counts as that of a tree that was just built.
const AS_BUILT: f64 = 1.02;

/// Means in which the newest measurements count most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Learned {
    costs: Costs,
    has_built: bool,
    has_refitted: bool,
    /// Sums over frames of (rise of the cost) · (rise of the trace's time) and (rise of the cost)², whose ratio is the
    /// line through the origin that fits best: small rises, which are mostly noise, count little.
    fit: [f64; 2],
}

impl Learned {
    pub(super) fn new() -> Self {
        let costs = Costs::default();
        let fit = [ASSUMED * costs.sensitivity, ASSUMED];
        Self { costs, has_built: false, has_refitted: false, fit }
    }

    /// The costs, with so many frames still to come.
    pub(super) fn costs(&self, frames_left: u64) -> Costs {
        Costs { frames_left, ..self.costs }
    }

    /// Learns from a frame that was traced.
    pub(super) fn frame(&mut self, update: &UpdateCost, trace_ms: f64) {
        learn_rate(&mut self.costs.build_ms, &mut self.has_built, update.built);
        learn_rate(&mut self.costs.refit_ms, &mut self.has_refitted, update.refitted);
        let Some(ratio) = update.cost_ratio else { return };
        let mean = self.costs.trace_ms;
        if ratio <= AS_BUILT {
            self.costs.trace_ms = if mean > 0.0 { mean + NEWEST * (trace_ms - mean) } else { trace_ms };
        } else if mean > 0.0 && ratio.is_finite() {
            let (rise, slower) = (ratio - 1.0, trace_ms / mean - 1.0);
            // a tree that is ruined tells no more than one whose cost has doubled
            let weight = 1.0 / rise.max(1.0);
            self.fit[0] = KEPT * self.fit[0] + weight * rise * slower;
            self.fit[1] = KEPT * self.fit[1] + weight * rise * rise;
            self.costs.sensitivity = (self.fit[0] / self.fit[1]).clamp(0.05, 2.0);
        }
    }
}

fn learn_rate(rate: &mut f64, is_known: &mut bool, work: Work) {
    // of fewer the calls themselves are what is measured
    const LEAST_TRIANGLES: u64 = 256;
    if work.triangles >= LEAST_TRIANGLES {
        let newest = work.ms / work.triangles as f64;
        *rate = if *is_known && newest > *rate { *rate + SLOWER * (newest - *rate) } else { newest };
        *is_known = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_follow_what_was_measured() {
        let mut learned = Learned::new();
        let built = Work { triangles: 1000, ms: 2.0 };
        learned.frame(&UpdateCost { built, cost_ratio: Some(1.0), ..UpdateCost::default() }, 10.0);
        let refitted = Work { triangles: 1000, ms: 0.5 };
        // the cost has risen by a half, the trace takes a fifth longer: 0.4; 0.7 was assumed
        learned.frame(&UpdateCost { refitted, cost_ratio: Some(1.5), ..UpdateCost::default() }, 12.0);
        let costs = learned.costs(7);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(costs.build_ms, 2e-3) && near(costs.refit_ms, 5e-4), "{costs:?}");
        // (0.9 · 0.25 · 0.7 + 0.5 · 0.2) / (0.9 · 0.25 + 0.5 · 0.5)
        assert!(near(costs.trace_ms, 10.0) && near(costs.sensitivity, 0.2575 / 0.475), "{costs:?}");
        assert_eq!(costs.frames_left, 7);
        // a refit that was held up counts for a tenth, a faster one wholly
        let again = |learned: &mut Learned, ms: f64| {
            let refitted = Work { triangles: 1000, ms };
            learned.frame(&UpdateCost { refitted, ..UpdateCost::default() }, 10.0);
            learned.costs(0).refit_ms
        };
        assert!(near(again(&mut learned, 10.5), 1.5e-3));
        assert!(near(again(&mut learned, 0.4), 4e-4));
    }
}
