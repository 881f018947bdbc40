//! What a device holds, and what of it was used when.

use super::{Step, UpdatePlan};
use crate::scene::{Geometry, PartHash};
use std::collections::BTreeMap;

/// What a tree is taken to need for each triangle before it is built; real scenes take 90 to 110.
pub const TREE_BYTES_PER_TRIANGLE: u64 = 120;

/// What is known of a tree that a device holds.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeState {
    /// The faces that it stands over.
    pub faces: PartHash,
    /// All parts of the object that it stands for: where the tree is overwritten by a refit or a build, they are too.
    pub parts: Vec<PartHash>,
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
        let parts = geometry.parts().into_iter().map(|(name, _)| name).collect();
        Self { faces: geometry.faces.hash(), parts, triangles, built_cost: cost, cost, excess: 0.0 }
    }

    /// The same after a refit to a geometry that has this cost.
    #[must_use]
    pub fn refitted(mut self, geometry: &Geometry, cost: f64) -> Self {
        self.parts = geometry.parts().into_iter().map(|(name, _)| name).collect();
        self.cost = cost;
        self.excess = (self.excess + self.ratio() - 1.0).max(0.0);
        self
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

/// A part or tree that is held.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held {
    /// Its bytes.
    pub bytes: u64,
    /// The turn, counted in frames, in which it was used last.
    pub last_used: u64,
    /// The runs whose last frame used it or whose frames to come will.
    pub users: Vec<User>,
}

/// A run that uses what is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct User {
    /// Its number.
    pub run: u64,
    /// Whether a frame of it that is known to come will.
    pub again: bool,
}

impl Held {
    /// Whether a run uses it.
    pub fn is_of(&self, run: u64) -> bool {
        self.users.iter().any(|user| user.run == run)
    }

    fn used_by(&mut self, run: u64, turn: u64) {
        self.last_used = turn;
        if !self.is_of(run) {
            self.users.push(User { run, again: false });
        }
    }
}

/// What a device holds: parts and trees, and the counts of the report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residency {
    /// By name; trees stand under [`super::tree_name`].
    pub held: BTreeMap<PartHash, Held>,
    /// What is known of the trees among them.
    pub trees: BTreeMap<PartHash, TreeState>,
    /// Frames that were made resident.
    pub turn: u64,
    /// The run whose turn it is.
    run: u64,
    /// Bytes held now.
    bytes: u64,
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
        self.bytes
    }

    /// The turn of a frame begins: what its plan keeps is not idle from now on.
    pub fn begin(&mut self, plan: &UpdatePlan) {
        self.turn += 1;
        self.run = plan.run;
        for step in &plan.steps {
            if let Step::Keep { name } | Step::Refit { from: name, .. } = step
                && let Some(held) = self.held.get_mut(name)
            {
                held.last_used = self.turn;
            }
        }
    }

    /// A part or tree was there when a frame needed it.
    pub fn keep(&mut self, name: PartHash) {
        self.hits += 1;
        if let Some(held) = self.held.get_mut(&name) {
            held.used_by(self.run, self.turn);
        }
    }

    /// A part or tree was not there and is now held.
    pub fn hold(&mut self, name: PartHash, bytes: u64) {
        self.misses += 1;
        let users = vec![User { run: self.run, again: false }];
        let held = Held { bytes, last_used: self.turn, users };
        let before = self.held.insert(name, held);
        self.bytes = self.bytes + bytes - before.map_or(0, |held| held.bytes);
        self.peak_bytes = self.peak_bytes.max(self.bytes);
    }

    /// A tree was built.
    pub fn hold_tree(&mut self, name: PartHash, bytes: u64, state: TreeState) {
        self.hold(name, bytes);
        self.trees.insert(name, state);
    }

    /// A tree was fitted to a geometry's positions and has another name now; it counts as there.
    pub fn refit(&mut self, from: PartHash, to: PartHash, geometry: &Geometry, cost: f64) {
        self.hits += 1;
        if let (Some(held), Some(state)) = (self.held.remove(&from), self.trees.remove(&from)) {
            let users = vec![User { run: self.run, again: false }];
            let before = self.held.insert(to, Held { last_used: self.turn, users, ..held });
            self.bytes -= before.map_or(0, |held| held.bytes);
            self.trees.insert(to, state.refitted(geometry, cost));
        }
    }

    /// Gives up a part or tree.
    pub fn free(&mut self, name: PartHash) {
        self.bytes -= self.held.remove(&name).map_or(0, |held| held.bytes);
        self.trees.remove(&name);
    }

    /// Gives up a part or tree that a frame to come will use.
    pub fn evict(&mut self, name: PartHash) {
        self.evictions += 1;
        self.free(name);
    }

    /// The frame's turn ends: which of what it uses its run will use again, and what it does not need any more.
    pub fn end(&mut self, plan: &UpdatePlan) {
        for (name, held) in &mut self.held {
            let is_used = held.last_used == self.turn;
            held.users.retain_mut(|user| {
                if user.run != plan.run {
                    return plan.others.contains(&user.run);
                }
                if is_used {
                    user.again = plan.again.contains(name);
                }
                is_used || user.again
            });
        }
    }

    /// The surface-area cost of the trees that this turn's frame uses over that of their last builds, mean by triangles;
    /// None without trees.
    pub fn cost_ratio(&self) -> Option<f64> {
        let used = || self.trees.iter().filter(|(name, _)| self.is_used(name)).map(|(_, state)| state);
        let triangles: u64 = used().map(|s| s.triangles).sum();
        let sum: f64 = used().map(|s| s.triangles as f64 * s.ratio()).sum();
        (triangles > 0).then(|| sum / triangles as f64)
    }

    /// Whether this turn's frame uses it.
    pub fn is_used(&self, name: &PartHash) -> bool {
        self.held.get(name).is_some_and(|held| held.last_used == self.turn)
    }

    /// Whether a run would find a tree of its own.
    pub fn holds_trees_of(&self, run: u64) -> bool {
        self.trees.keys().any(|name| self.held.get(name).is_some_and(|held| held.is_of(run)))
    }

    /// What this turn's frame does not use, the least recently used first.
    pub fn idle(&self) -> Vec<PartHash> {
        let idle = self.held.iter().filter(|(_, held)| held.last_used < self.turn);
        let mut idle: Vec<_> = idle.map(|(name, held)| (held.last_used, *name)).collect();
        idle.sort_unstable();
        idle.into_iter().map(|(_, name)| name).collect()
    }
}
