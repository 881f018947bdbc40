//! How fast the machine is right now, by a work that has nothing to do with this program: what an earlier result is compared by.

use super::times::{Spread, time};
use rayon::prelude::*;

/// Numbers that each thread sorts.
const NUMBERS: u64 = 200_000;
const ROUNDS: usize = 5;

/// Milliseconds of sorting on so many threads at once: the least of some rounds, for threads that have slept are slow at first.
pub(super) fn pace_ms(threads: usize) -> f64 {
    let sort = |thread: usize| {
        let mut state = thread as u64;
        // a Weyl sequence, mixed (SplitMix64, Steele, Lea and Flood 2014)
        let mut next = |_| {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mixed = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB)
        };
        let mut numbers: Vec<u64> = (0..NUMBERS).map(&mut next).collect();
        numbers.sort_unstable();
        std::hint::black_box(numbers.last().copied());
    };
    let all = || (0..threads.max(1)).into_par_iter().with_max_len(1).for_each(sort);
    let rounds = (0..ROUNDS).map(|_| time(all)).collect();
    Spread::of(rounds).map_or(0.0, |spread| spread.least)
}
