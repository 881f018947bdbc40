//! Times of repeated work. What is compared runs in turn, so that a machine that slows down slows all of it.

use crate::clock::Stopwatch;
use serde::Serialize;

/// What repeated measurements came to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The middle one.
    pub median: f64,
    /// The least.
    pub least: f64,
    /// The greatest.
    pub greatest: f64,
}

impl Spread {
    /// Of some measurements; None without any.
    pub(super) fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let [least, greatest] = [*values.first()?, *values.last()?];
        Some(Self { median: values[values.len() / 2], least, greatest })
    }
}

/// How long a work takes, in milliseconds.
pub(super) fn time(work: impl FnOnce()) -> f64 {
    let clock = Stopwatch::start();
    work();
    clock.ms()
}

/// Runs each of some works once unmeasured, then all in turn so many times, at least once; gives milliseconds.
pub(super) fn in_turn<const N: usize>(rounds: usize, mut works: [&mut dyn FnMut(); N]) -> [Spread; N] {
    let mut ms = [const { Vec::new() }; N];
    for work in &mut works {
        work();
    }
    for _ in 0..rounds.max(1) {
        for (work, ms) in works.iter_mut().zip(&mut ms) {
            ms.push(time(work));
        }
    }
    ms.map(|ms| Spread::of(ms).unwrap_or(Spread { median: 0.0, least: 0.0, greatest: 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn works_run_in_turn_after_once_each() {
        let order = std::cell::RefCell::new(String::new());
        let [a, b] = in_turn(2, [&mut || order.borrow_mut().push('a'), &mut || order.borrow_mut().push('b')]);
        assert_eq!(*order.borrow(), "ababab");
        assert!(a.least <= a.median && b.median <= b.greatest);
    }

    #[test]
    fn the_middle_is_the_median() {
        let spread = Spread { median: 3.0, least: 1.0, greatest: 9.0 };
        assert_eq!(Spread::of(vec![9.0, 1.0, 3.0]), Some(spread));
        assert_eq!(Spread::of(Vec::new()), None);
    }
}
