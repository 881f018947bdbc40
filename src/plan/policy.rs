//! Refit or rebuild: rent or buy. A refitted tree costs more to trace the more its boxes have grown; once what was lost
//! since the last build, and what would be lost in the frames to come, both exceed a build, it is built anew. So the
//! whole never takes more than about twice what it would with the frames known beforehand (the ski rental problem: Karlin
//! et al., "Competitive snoopy caching", 1988).

use super::{Residency, TreeState};
use crate::scene::PartHash;
use std::cmp::Reverse;

/// What is to be done with trees over meshes that changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Update {
    /// What is expected to take the least time.
    #[default]
    Auto,
    /// Refit wherever the faces are the same.
    Refit,
    /// Build anew.
    Rebuild,
}

/// What things cost on a device, as measured so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Building a tree, ms for each triangle.
    pub build_ms: f64,
    /// Refitting it, ms for each triangle.
    pub refit_ms: f64,
    /// Tracing a frame whose trees were just built, ms; 0 where that is not known.
    pub trace_ms: f64,
    /// By which share tracing takes longer where the surface-area cost has doubled.
    pub sensitivity: f64,
    /// Frames that are still to come after this one.
    pub frames_left: u64,
}

impl Default for Costs {
    /// A CPU of two cores before anything was measured.
    fn default() -> Self {
        Self { build_ms: 3e-4, refit_ms: 4e-5, trace_ms: 0.0, sensitivity: 0.7, frames_left: u64::MAX }
    }
}

/// What the policy says of one tree.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Choice {
    /// Refit, and keep that unless the surface-area cost over the last build's turns out greater than this.
    Refit { keep_up_to: f64 },
    /// Build anew.
    Rebuild,
}

/// Chooses for a tree of so many triangles; gives the terms in words, too.
pub(super) fn choose(state: &TreeState, triangles: u64, update: Update, costs: &Costs) -> (Choice, String) {
    match update {
        Update::Refit => return (Choice::Refit { keep_up_to: f64::INFINITY }, "--update refit".to_string()),
        Update::Rebuild => return (Choice::Rebuild, "--update rebuild".to_string()),
        Update::Auto => {}
    }
    let triangles = triangles as f64;
    let (build, refit) = (triangles * costs.build_ms, triangles * costs.refit_ms);
    let price = build - refit;
    if price <= 0.0 {
        return (Choice::Rebuild, format!("a build takes {build:.2} ms, a refit {refit:.2} ms"));
    }
    let loss_ms = |excess: f64| excess * costs.sensitivity * costs.trace_ms;
    let (lost, next) = (loss_ms(state.excess), loss_ms(state.ratio() - 1.0));
    let to_come = next * costs.frames_left.saturating_add(1) as f64;
    if lost + next > price && to_come > price {
        let why = format!(
            "lost {lost:.2} ms since the last build, {next:.2} ms a frame; a build costs {price:.2} ms more"
        );
        return (Choice::Rebuild, why);
    }
    // what one frame may lose before a build in its place would have been better
    let allowed = costs.sensitivity * costs.trace_ms;
    let keep_up_to = if allowed > 0.0 { 1.0 + build / allowed } else { f64::INFINITY };
    let why = format!(
        "lost {lost:.2} ms since the last build, {next:.2} ms a frame; a build would cost {price:.2} ms more"
    );
    (Choice::Refit { keep_up_to }, why)
}

/// The tree that may be refitted to a geometry: one over the same faces that the frame does not need as it is; of
/// several the one used last, and of those the first.
pub(super) fn candidate(
    residency: &Residency,
    faces: PartHash,
    triangles: u64,
    is_free: impl Fn(&PartHash) -> bool,
) -> Option<PartHash> {
    let fits = |s: &TreeState| s.faces == faces && s.triangles == triangles;
    let last_used = |name: &PartHash| residency.held.get(name).map_or(0, |held| held.last_used);
    let names = residency.trees.iter().filter(|(name, s)| fits(s) && is_free(name)).map(|(name, _)| *name);
    names.min_by_key(|name| (Reverse(last_used(name)), *name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PartHasher;

    /// 1000 triangles: a build takes 0.3 ms, a refit 0.04; a frame 1 ms, half more where the cost has doubled.
    const COSTS: Costs =
        Costs { build_ms: 3e-4, refit_ms: 4e-5, trace_ms: 1.0, sensitivity: 0.5, frames_left: 1000 };

    fn state(ratio: f64, excess: f64) -> TreeState {
        let faces = PartHasher::new("faces").finish();
        TreeState { faces, parts: Vec::new(), triangles: 1000, built_cost: 10.0, cost: 10.0 * ratio, excess }
    }

    fn refits(state: &TreeState, costs: &Costs) -> bool {
        matches!(choose(state, 1000, Update::Auto, costs).0, Choice::Refit { .. })
    }

    #[test]
    fn it_is_built_anew_when_what_was_lost_would_have_paid_for_it() {
        // each frame at a ratio of 1.2 loses 0.1 ms, a build costs 0.26 ms more: before the third frame 0.2 + 0.1
        let excess = |frames: u32| f64::from(frames) * 0.2;
        assert!(refits(&state(1.2, excess(1)), &COSTS));
        assert!(!refits(&state(1.2, excess(2)), &COSTS));
        // two frames are left: 0.2 ms at most would be saved
        assert!(refits(&state(1.2, excess(2)), &Costs { frames_left: 1, ..COSTS }));
        // no worse than built: never
        assert!(refits(&state(1.0, 0.0), &COSTS));
        // where a refit takes as long as a build there is nothing to gain
        assert!(!refits(&state(1.0, 0.0), &Costs { refit_ms: 3e-4, ..COSTS }));
    }

    #[test]
    fn one_frame_may_lose_a_build_at_most() {
        // 0.5 ms for each 1 of ratio: 0.3 ms are lost at 1.6
        let Choice::Refit { keep_up_to } = choose(&state(1.0, 0.0), 1000, Update::Auto, &COSTS).0 else {
            panic!("it is refitted")
        };
        assert!((keep_up_to - 1.6).abs() < 1e-12);
    }

    #[test]
    fn it_can_be_forced() {
        let (bad, good) = (state(50.0, 900.0), state(1.0, 0.0));
        assert_eq!(choose(&bad, 1000, Update::Refit, &COSTS).0, Choice::Refit { keep_up_to: f64::INFINITY });
        assert_eq!(choose(&good, 1000, Update::Rebuild, &COSTS).0, Choice::Rebuild);
    }
}
