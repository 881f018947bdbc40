//! What a device must do before it can trace a frame, as a value that can be printed, tested and replayed. Pure.

mod policy;
mod residency;

pub use policy::{Costs, Update};
pub use residency::{Held, Residency, TREE_BYTES_PER_TRIANGLE, TreeState, User};

use crate::scene::{Frame, Geometry, PartHash, PartHasher};
use policy::{Choice, candidate, choose};
use std::collections::{BTreeMap, BTreeSet};

/// How a frame is to be made resident.
#[derive(Clone, Debug, PartialEq)]
pub struct Wishes {
    /// Forget everything first.
    pub cold: bool,
    /// Bytes that the device may hold.
    pub budget_bytes: u64,
    /// Objects that frames to come show again, by their places in this frame.
    pub used_again: Vec<usize>,
    /// What is to be done with trees over meshes that changed.
    pub update: Update,
    /// What things cost.
    pub costs: Costs,
    /// The run that the frame is of.
    pub run: u64,
    /// Other runs that the device traces frames of in turn with it: what they use is kept for them.
    pub others: BTreeSet<u64>,
}

impl Default for Wishes {
    /// Without a bound, nothing comes again and nobody else has the device.
    fn default() -> Self {
        Self {
            cold: false,
            budget_bytes: u64::MAX,
            used_again: Vec::new(),
            update: Update::default(),
            costs: Costs::default(),
            run: 0,
            others: BTreeSet::new(),
        }
    }
}

impl Wishes {
    /// Forget everything first.
    pub fn cold() -> Self {
        Self { cold: true, ..Self::default() }
    }
}

/// One step of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Give up a part or tree that nothing needs any more.
    Free {
        /// Its name.
        name: PartHash,
    },
    /// Give up a part or tree for want of space.
    Evict {
        /// Its name.
        name: PartHash,
    },
    /// It is there and serves.
    Keep {
        /// Its name.
        name: PartHash,
    },
    /// Hand the part to the device.
    Upload {
        /// Its name.
        part: PartHash,
        /// Its bytes.
        bytes: u64,
    },
    /// Fit a tree to an object's positions in place.
    Refit {
        /// The tree as it is held.
        from: PartHash,
        /// Its name afterwards.
        tree: PartHash,
        /// The object, by its place in the frame.
        object: usize,
        /// Triangles.
        triangles: u64,
        /// Where the surface-area cost over the last build's turns out greater, it is built anew.
        keep_up_to: f64,
    },
    /// Build the tree over an object's triangles.
    Build {
        /// The tree's name.
        tree: PartHash,
        /// The object, by its place in the frame.
        object: usize,
        /// Triangles.
        triangles: u64,
    },
}

/// What the plan amounts to, in the words of the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing of the frame was there.
    Load,
    /// No tree had to be touched.
    None,
    /// Trees are fitted to other positions, none is built.
    Refit,
    /// At least one tree is built anew.
    Rebuild,
}

impl Action {
    /// The word in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::None => "none",
            Self::Refit => "refit",
            Self::Rebuild => "rebuild",
        }
    }
}

/// What a device must do before it can trace a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct UpdatePlan {
    /// The steps in order: what is freed first, then parts, then trees.
    pub steps: Vec<Step>,
    /// What it amounts to.
    pub action: Action,
    /// Why, for the report.
    pub why: String,
    /// Bytes that the device will hold of parts after it; trees not counted.
    pub part_bytes: u64,
    /// What builds and refits are expected to take, ms.
    pub predicted_ms: f64,
    /// Whether everything was to be forgotten first.
    pub is_cold: bool,
    /// The run that the frame is of.
    pub run: u64,
    /// The others that have frames left.
    pub others: BTreeSet<u64>,
    /// Whether no tree that it needs was there, nor one of its run.
    pub is_start: bool,
    /// Parts and trees of the frame that frames to come use again.
    pub again: BTreeSet<PartHash>,
}

impl UpdatePlan {
    /// Whether something that the frame needs was resident already.
    pub fn is_warm(&self) -> bool {
        self.steps.iter().any(|s| matches!(s, Step::Keep { .. } | Step::Refit { .. }))
    }

    /// How many trees are built, and how many refitted.
    pub fn trees(&self) -> [usize; 2] {
        let count = |of: fn(&Step) -> bool| self.steps.iter().filter(|s| of(s)).count();
        [count(|s| matches!(s, Step::Build { .. })), count(|s| matches!(s, Step::Refit { .. }))]
    }

    /// Bytes that the frame itself needs, trees that are to be built estimated.
    pub fn needed_bytes(&self, residency: &Residency) -> u64 {
        needed_bytes(&self.steps, residency)
    }
}

/// The name of the tree over a geometry: it is a function of positions and triangles alone.
pub fn tree_name(geometry: &Geometry) -> PartHash {
    let mut h = PartHasher::new("tree");
    h.part(geometry.positions.hash());
    h.part(geometry.triangles.hash());
    h.finish()
}

/// Plans a frame: what is resident is kept, trees over meshes that only moved are refitted where that is expected to take
/// less time, what is missing is uploaded or built. What the frame does not use is freed, but for what frames to come use
/// again and nothing overwrites, and what other runs use: that is kept while there is space.
pub fn plan_frame(frame: &Frame, residency: &Residency, wishes: &Wishes) -> UpdatePlan {
    let Wishes { cold, update, costs, .. } = wishes;
    let mut needed: BTreeMap<PartHash, u64> = BTreeMap::new();
    let mut trees: BTreeMap<PartHash, usize> = BTreeMap::new();
    for (i, object) in frame.objects.iter().enumerate() {
        needed.extend(object.geometry.parts());
        trees.entry(tree_name(&object.geometry)).or_insert(i);
    }
    let used: BTreeSet<PartHash> = needed.keys().chain(trees.keys()).copied().collect();
    let is_held = |name: &PartHash| !cold && residency.held.contains_key(name);
    let is_others = |held: &Held| held.users.iter().any(|user| wishes.others.contains(&user.run));
    let is_own = |name: &PartHash| residency.held.get(name).is_some_and(|held| held.is_of(wishes.run));

    // trees that are fitted to other positions, and those in whose place another is built
    let (mut taken, mut overwritten) = (BTreeSet::new(), BTreeSet::new());
    let mut tree_steps = Vec::new();
    let mut why = Vec::new();
    let mut predicted_ms = 0.0;
    for (&tree, &object) in &trees {
        let geometry = &frame.objects[object].geometry;
        let triangles = geometry.triangles.0.len() as u64;
        if is_held(&tree) {
            tree_steps.push(Step::Keep { name: tree });
            continue;
        }
        let is_free = |name: &PartHash| {
            let is_lent = !is_own(name) && residency.held.get(name).is_some_and(is_others);
            !cold && !is_lent && !used.contains(name) && !taken.contains(name) && !overwritten.contains(name)
        };
        let step = match candidate(residency, geometry.faces.hash(), triangles, is_free) {
            None => Step::Build { tree, object, triangles },
            Some(from) => {
                let state = &residency.trees[&from];
                let (choice, terms) = choose(state, triangles, *update, costs);
                why.push(terms);
                overwritten.extend(&state.parts);
                match choice {
                    Choice::Rebuild => {
                        overwritten.insert(from);
                        Step::Build { tree, object, triangles }
                    }
                    Choice::Refit { keep_up_to } => {
                        taken.insert(from);
                        Step::Refit { from, tree, object, triangles, keep_up_to }
                    }
                }
            }
        };
        let is_refit = matches!(step, Step::Refit { .. });
        predicted_ms += triangles as f64 * if is_refit { costs.refit_ms } else { costs.build_ms };
        tree_steps.push(step);
    }

    let unused = |name: &PartHash| *cold || !used.contains(name) && !taken.contains(name);
    let comes_again = |held: &Held| held.users.iter().any(|user| user.run == wishes.run && user.again);
    let is_kept = |name: &PartHash, held: &Held| {
        !cold && (is_others(held) || comes_again(held) && !overwritten.contains(name))
    };
    let (kept, freed): (Vec<_>, Vec<_>) =
        residency.held.iter().filter(|(name, _)| unused(name)).partition(|(name, held)| is_kept(name, held));
    let mut steps = Vec::new();
    for (&part, &bytes) in &needed {
        steps.push(if is_held(&part) { Step::Keep { name: part } } else { Step::Upload { part, bytes } });
    }
    steps.extend(tree_steps);
    let frees = freed.into_iter().map(|(&name, _)| Step::Free { name });
    let evicted = to_evict(kept, needed_bytes(&steps, residency), wishes.budget_bytes);
    steps.splice(0..0, frees.chain(evicted.into_iter().map(|name| Step::Evict { name })));

    let again = wishes.used_again.iter().filter_map(|&i| frame.objects.get(i)).flat_map(|object| {
        let parts = object.geometry.parts().into_iter().map(|(name, _)| name);
        parts.chain([tree_name(&object.geometry)])
    });
    let again = again.collect();

    let count = |of: fn(&Step) -> bool| steps.iter().filter(|s| of(s)).count();
    let kept = count(|s| matches!(s, Step::Keep { .. } | Step::Refit { .. }));
    let built = count(|s| matches!(s, Step::Build { .. }));
    let refitted = count(|s| matches!(s, Step::Refit { .. }));
    let is_own_kept = steps.iter().any(|s| matches!(s, Step::Keep { name } if is_own(name)));
    let has_tree = trees.keys().any(is_held) || refitted > 0;
    let (action, what) = if *cold {
        (Action::Load, "everything is forgotten first".to_string())
    } else if !is_own_kept && !has_tree && why.is_empty() {
        let what =
            if kept == 0 { "nothing of it was resident" } else { "only what other runs use was resident" };
        (Action::Load, what.to_string())
    } else if built > 0 {
        (Action::Rebuild, format!("{built} of {} trees built", trees.len()))
    } else if refitted > 0 {
        (Action::Refit, format!("{refitted} of {} trees refitted", trees.len()))
    } else {
        (Action::None, format!("{} of {} trees resident", trees.len(), trees.len()))
    };
    why.insert(0, what);
    UpdatePlan {
        steps,
        action,
        why: why.join("; "),
        part_bytes: needed.values().sum(),
        predicted_ms,
        is_cold: *cold,
        run: wishes.run,
        others: wishes.others.clone(),
        is_start: *cold || !has_tree && !residency.holds_trees_of(wishes.run),
        again,
    }
}

/// What a tree takes at most beyond that, be it of one triangle.
const TREE_BYTES: u64 = 320;

fn needed_bytes(steps: &[Step], residency: &Residency) -> u64 {
    let held_bytes = |name: &PartHash| residency.held.get(name).map_or(0, |held| held.bytes);
    let of_step = |step: &Step| match step {
        Step::Free { .. } | Step::Evict { .. } => 0,
        Step::Keep { name } | Step::Refit { from: name, .. } => held_bytes(name),
        Step::Upload { bytes, .. } => *bytes,
        Step::Build { triangles, .. } => TREE_BYTES + triangles * TREE_BYTES_PER_TRIANGLE,
    };
    steps.iter().map(of_step).sum()
}

/// Which of what is kept beside a frame must go so that all is within a budget: the least recently used first.
fn to_evict(kept: Vec<(&PartHash, &Held)>, needed_bytes: u64, budget_bytes: u64) -> Vec<PartHash> {
    let mut bytes = needed_bytes + kept.iter().map(|(_, held)| held.bytes).sum::<u64>();
    let mut by_age = kept;
    by_age.sort_by_key(|(name, held)| (held.last_used, **name));
    let mut evicted = Vec::new();
    for (name, held) in by_age {
        if bytes <= budget_bytes {
            break;
        }
        bytes -= held.bytes;
        evicted.push(*name);
    }
    evicted
}

#[cfg(test)]
mod tests;
