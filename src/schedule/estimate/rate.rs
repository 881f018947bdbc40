//! What was measured against what was expected: a median, and the spread around it.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// The latest measurements count; as many as a median needs not to move with any one of them.
const KEPT: usize = 15;

/// Logarithms of measured over expected, the latest last.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Rate(VecDeque<f64>);

impl Rate {
    /// Takes another one; what is no positive number tells nothing.
    pub(super) fn learn(&mut self, log_ratio: f64) {
        if log_ratio.is_finite() {
            self.0.push_back(log_ratio);
            if self.0.len() > KEPT {
                self.0.pop_front();
            }
        }
    }

    /// Their median; None of none.
    pub(super) fn median(&self) -> Option<f64> {
        let mut sorted: Vec<f64> = self.0.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.len() / 2;
        match sorted.len() {
            0 => None,
            n if n.is_multiple_of(2) => Some(0.5 * (sorted[middle - 1] + sorted[middle])),
            _ => Some(sorted[middle]),
        }
    }

    /// How far from the median the next one is expected to be: the mean distance of those that were, beside one that
    /// is assumed.
    pub(super) fn spread(&self, assumed: f64) -> f64 {
        let median = self.median().unwrap_or(0.0);
        let distances: f64 = self.0.iter().map(|x| (x - median).abs()).sum();
        (assumed + distances) / (self.0.len() + 1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_measurement_that_was_disturbed_moves_nothing() {
        let mut rate = Rate::default();
        assert_eq!((rate.median(), rate.spread(0.7)), (None, 0.7));
        for x in [0.1, 0.2, 0.3, 9.0, 0.2] {
            rate.learn(x);
        }
        assert_eq!(rate.median(), Some(0.2));
        rate.learn(f64::NAN);
        rate.learn(f64::NEG_INFINITY);
        assert_eq!(rate.median(), Some(0.2));
        // of an even number the mean of the middle two; (0.6 + 0.1 + 0.1) / 3
        let mut rate = Rate::default();
        rate.learn(0.1);
        rate.learn(0.3);
        assert!((rate.median().unwrap() - 0.2).abs() < 1e-12 && (rate.spread(0.6) - 0.8 / 3.0).abs() < 1e-12);
        // what is long past is forgotten
        (0..KEPT).for_each(|_| rate.learn(-1.0));
        assert_eq!(rate.median(), Some(-1.0));
    }
}
