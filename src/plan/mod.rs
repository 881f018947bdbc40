//! What a device must do before it can trace a frame, as a value that can be printed, tested and replayed. Pure.

mod policy;

pub use policy::{Costs, Update};

use crate::scene::{Frame, Geometry, PartHash, PartHasher};
use policy::{Choice, candidate, choose};
use std::collections::{BTreeMap, BTreeSet};

/// What is known of a tree that a device holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeState {
    /// The faces that it stands over.
    pub faces: PartHash,
    /// Triangles.
    pub triangles: u64,
    /// Surface-area cost when it was built.
    pub built_cost: f64,
    /// Surface-area cost now.
    pub cost: f64,
    /// Sum over the frames since the build of [`Self::ratio`] − 1.
    pub excess: f64,
}

impl TreeState {
    /// Of a tree that was just built.
    pub fn built(geometry: &Geometry, cost: f64) -> Self {
        let triangles = geometry.triangles.0.len() as u64;
        Self { faces: geometry.faces.hash(), triangles, built_cost: cost, cost, excess: 0.0 }
    }

    /// The same after a refit that has this cost.
    #[must_use]
    pub fn refitted(self, cost: f64) -> Self {
        let now = Self { cost, ..self };
        Self { excess: (self.excess + now.ratio() - 1.0).max(0.0), ..now }
    }

    /// The surface-area cost over that of the last build; 1 where there is none.
    pub fn ratio(&self) -> f64 {
        if self.cost <= 0.0 {
            1.0
        } else if self.built_cost <= 0.0 {
            f64::INFINITY
        } else {
            self.cost / self.built_cost
        }
    }
}

/// How a frame is to be made resident.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wishes {
    /// Forget everything first.
    pub cold: bool,
    /// What is to be done with trees over meshes that changed.
    pub update: Update,
    /// What things cost.
    pub costs: Costs,
}

impl Wishes {
    /// Forget everything first.
    pub fn cold() -> Self {
        Self { cold: true, ..Self::default() }
    }
}

/// What a device holds: parts and trees with their bytes, and the counts of the report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residency {
    /// Bytes by name; trees stand under [`tree_name`].
    pub held: BTreeMap<PartHash, u64>,
    /// What is known of the trees among them.
    pub trees: BTreeMap<PartHash, TreeState>,
    /// The most bytes ever held.
    pub peak_bytes: u64,
    /// Parts and trees that were there when a frame needed them.
    pub hits: u64,
    /// Those that were not.
    pub misses: u64,
    /// Those given up for want of space.
    pub evictions: u64,
}

impl Residency {
    /// Bytes held now.
    pub fn bytes(&self) -> u64 {
        self.held.values().sum()
    }

    /// A part or tree was there when a frame needed it.
    pub fn keep(&mut self) {
        self.hits += 1;
    }

    /// A part or tree was not there and is now held.
    pub fn hold(&mut self, name: PartHash, bytes: u64) {
        self.misses += 1;
        self.held.insert(name, bytes);
        self.peak_bytes = self.peak_bytes.max(self.bytes());
    }

    /// A tree was built.
    pub fn hold_tree(&mut self, name: PartHash, bytes: u64, state: TreeState) {
        self.hold(name, bytes);
        self.trees.insert(name, state);
    }

    /// A tree was fitted to other positions and has another name now; it counts as there.
    pub fn refit(&mut self, from: PartHash, to: PartHash, cost: f64) {
        self.hits += 1;
        if let (Some(bytes), Some(state)) = (self.held.remove(&from), self.trees.remove(&from)) {
            self.held.insert(to, bytes);
            self.trees.insert(to, state.refitted(cost));
        }
    }

    /// Gives up a part or tree.
    pub fn free(&mut self, name: PartHash) {
        self.held.remove(&name);
        self.trees.remove(&name);
    }
}

/// One step of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Give up a part or tree.
    Free {
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
}

impl UpdatePlan {
    /// Whether something that the frame needs was resident already.
    pub fn is_warm(&self) -> bool {
        self.steps.iter().any(|s| matches!(s, Step::Keep { .. } | Step::Refit { .. }))
    }

    /// Bytes that will be held after it, trees that are to be built estimated at so many bytes a triangle.
    pub fn needed_bytes(&self, residency: &Residency, tree_bytes_per_triangle: u64) -> u64 {
        let of_step = |step: &Step| match step {
            Step::Free { .. } => 0,
            Step::Keep { name } | Step::Refit { from: name, .. } => {
                residency.held.get(name).copied().unwrap_or(0)
            }
            Step::Upload { bytes, .. } => *bytes,
            Step::Build { triangles, .. } => triangles * tree_bytes_per_triangle,
        };
        self.steps.iter().map(of_step).sum()
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
/// less time, what is missing is uploaded or built, what the frame does not use is freed.
pub fn plan_frame(frame: &Frame, residency: &Residency, wishes: &Wishes) -> UpdatePlan {
    let Wishes { cold, update, costs } = wishes;
    let mut needed: BTreeMap<PartHash, u64> = BTreeMap::new();
    let mut trees: BTreeMap<PartHash, usize> = BTreeMap::new();
    for (i, object) in frame.objects.iter().enumerate() {
        needed.extend(object.geometry.parts());
        trees.entry(tree_name(&object.geometry)).or_insert(i);
    }
    let used: BTreeSet<PartHash> = needed.keys().chain(trees.keys()).copied().collect();
    let is_held = |name: &PartHash| !cold && residency.held.contains_key(name);

    let mut taken = BTreeSet::new();
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
        let is_free = |name: &PartHash| !cold && !used.contains(name) && !taken.contains(name);
        let step = match candidate(residency, geometry.faces.hash(), triangles, is_free) {
            None => Step::Build { tree, object, triangles },
            Some(from) => {
                let (choice, terms) = choose(&residency.trees[&from], triangles, *update, costs);
                why.push(terms);
                match choice {
                    Choice::Rebuild => Step::Build { tree, object, triangles },
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

    let unused = residency.held.keys().filter(|n| *cold || !used.contains(n) && !taken.contains(n));
    let mut steps: Vec<Step> = unused.map(|&name| Step::Free { name }).collect();
    for (&part, &bytes) in &needed {
        steps.push(if is_held(&part) { Step::Keep { name: part } } else { Step::Upload { part, bytes } });
    }
    steps.extend(tree_steps);

    let count = |of: fn(&Step) -> bool| steps.iter().filter(|s| of(s)).count();
    let kept = count(|s| matches!(s, Step::Keep { .. } | Step::Refit { .. }));
    let built = count(|s| matches!(s, Step::Build { .. }));
    let refitted = count(|s| matches!(s, Step::Refit { .. }));
    let (action, what) = if *cold {
        (Action::Load, "everything is forgotten between frames (--cold)".to_string())
    } else if kept == 0 && why.is_empty() {
        (Action::Load, "nothing of it was resident".to_string())
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
    }
}
