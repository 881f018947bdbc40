//! What a device must do before it can trace a frame, as a value that can be printed, tested and replayed. Pure.

use crate::scene::{Frame, Geometry, PartHash, PartHasher};
use std::collections::{BTreeMap, BTreeSet};

/// What a device holds: parts and trees with their bytes, and the counts of the report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residency {
    /// Bytes by name; trees stand under [`tree_name`].
    pub held: BTreeMap<PartHash, u64>,
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

    /// Gives up a part or tree.
    pub fn free(&mut self, name: PartHash) {
        self.held.remove(&name);
    }
}

/// One step of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// At least one tree is built anew.
    Rebuild,
}

impl Action {
    /// The word in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::None => "none",
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
}

impl UpdatePlan {
    /// Whether something that the frame needs was resident already.
    pub fn is_warm(&self) -> bool {
        self.steps.iter().any(|s| matches!(s, Step::Keep { .. }))
    }

    /// Bytes that will be held after it, trees that are to be built estimated at so many bytes a triangle.
    pub fn needed_bytes(&self, residency: &Residency, tree_bytes_per_triangle: u64) -> u64 {
        let of_step = |step: &Step| match step {
            Step::Free { .. } => 0,
            Step::Keep { name } => residency.held.get(name).copied().unwrap_or(0),
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

/// Plans a frame: what is resident is kept, what is missing is uploaded or built, what the frame does not use is
/// freed. With `cold` everything is forgotten first.
pub fn plan_frame(frame: &Frame, residency: &Residency, cold: bool) -> UpdatePlan {
    let mut needed: BTreeMap<PartHash, u64> = BTreeMap::new();
    let mut trees: BTreeMap<PartHash, (usize, u64)> = BTreeMap::new();
    for (i, object) in frame.objects.iter().enumerate() {
        needed.extend(object.geometry.parts());
        trees.entry(tree_name(&object.geometry)).or_insert((i, object.geometry.triangles.0.len() as u64));
    }
    let used: BTreeSet<PartHash> = needed.keys().chain(trees.keys()).copied().collect();
    let is_held = |name: &PartHash| !cold && residency.held.contains_key(name);

    let mut steps: Vec<Step> = residency
        .held
        .keys()
        .filter(|n| cold || !used.contains(n))
        .map(|&name| Step::Free { name })
        .collect();
    for (&part, &bytes) in &needed {
        steps.push(if is_held(&part) { Step::Keep { name: part } } else { Step::Upload { part, bytes } });
    }
    for (&tree, &(object, triangles)) in &trees {
        steps.push(if is_held(&tree) {
            Step::Keep { name: tree }
        } else {
            Step::Build { tree, object, triangles }
        });
    }

    let kept = steps.iter().filter(|s| matches!(s, Step::Keep { .. })).count();
    let built = steps.iter().filter(|s| matches!(s, Step::Build { .. })).count();
    let (action, why) = if cold {
        (Action::Load, "everything is forgotten between frames (--cold)".to_string())
    } else if kept == 0 {
        (Action::Load, "nothing of it was resident".to_string())
    } else if built == 0 {
        (Action::None, format!("{} of {} trees resident", trees.len(), trees.len()))
    } else {
        (Action::Rebuild, format!("{built} of {} trees changed", trees.len()))
    };
    UpdatePlan { steps, action, why, part_bytes: needed.values().sum() }
}
