//! What builds, refits and frames cost on a device, learned from every frame.

use crate::device::{UpdateCost, Work};
use crate::plan::Costs;

/// How much the latest measurement counts for.
const NEWEST: f64 = 0.3;
/// Up to this the surface-area cost counts as that of a tree that was just built.
const AS_BUILT: f64 = 1.02;

/// Means in which the newest measurements count most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Learned {
    costs: Costs,
    has_built: bool,
    has_refitted: bool,
}

impl Learned {
    pub(super) fn new() -> Self {
        Self { costs: Costs::default(), has_built: false, has_refitted: false }
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
        let known = self.costs.trace_ms > 0.0;
        if ratio <= AS_BUILT {
            learn(&mut self.costs.trace_ms, known, trace_ms);
        } else if known && ratio.is_finite() {
            // what the last build's trace says of this one's
            let sensitivity = (trace_ms / self.costs.trace_ms - 1.0) / (ratio - 1.0);
            learn(&mut self.costs.sensitivity, true, sensitivity.clamp(0.05, 2.0));
        }
    }
}

fn learn_rate(rate: &mut f64, is_known: &mut bool, work: Work) {
    // of fewer the calls themselves are what is measured
    const LEAST_TRIANGLES: u64 = 256;
    if work.triangles >= LEAST_TRIANGLES {
        learn(rate, *is_known, work.ms / work.triangles as f64);
        *is_known = true;
    }
}

fn learn(mean: &mut f64, is_known: bool, newest: f64) {
    *mean = if is_known { *mean + NEWEST * (newest - *mean) } else { newest };
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
        assert!(near(costs.trace_ms, 10.0) && near(costs.sensitivity, 0.7 - 0.3 * 0.3), "{costs:?}");
        assert_eq!(costs.frames_left, 7);
    }
}
