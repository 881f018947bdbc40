//! Trees that are fitted together, and the dispatches that do it.

use super::records::{NODES_IN_GROUP, RefitLevel, RefitTree};
use super::resident::{Fit, FitOf};

/// What is to be fitted before a frame is traced.
#[derive(Debug)]
pub(super) struct Fits {
    pub(super) trees: Vec<RefitTree>,
    /// The dispatches in order, height after height; the last fits the tops.
    pub(super) levels: Vec<RefitLevel>,
    /// Which they are.
    pub(super) of: Vec<FitOf>,
    /// Nodes of all trees.
    pub(super) nodes: u64,
}

impl Fits {
    pub(super) fn new(fits: &[Fit]) -> Self {
        let mut nodes = 0;
        let mut trees = Vec::with_capacity(fits.len());
        for fit in fits {
            trees.push(RefitTree { first_box: nodes, ..fit.record });
            nodes += fit.nodes;
        }
        let heights = fits.iter().map(|f| f.below_top.len()).max().unwrap_or(0);
        let mut levels = Vec::new();
        for height in 0..heights {
            for (tree, fit) in (0..).zip(fits) {
                if let Some(range) = fit.below_top.get(height) {
                    let count = range.end - range.start;
                    levels.push(RefitLevel { tree, first: range.start, count, trees: 1 });
                }
            }
        }
        if !fits.is_empty() {
            levels.push(RefitLevel { tree: 0, first: 0, count: 0, trees: fits.len() as u32 });
        }
        Self { trees, levels, of: fits.iter().map(|f| f.of).collect(), nodes: u64::from(nodes) }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.trees.is_empty()
    }
}

/// Workgroups of a dispatch, at most so many in one direction.
pub(super) fn groups(level: &RefitLevel, most: u32) -> [u32; 2] {
    let groups = if is_top(level) { level.trees } else { level.count.div_ceil(NODES_IN_GROUP) };
    let columns = groups.min(most);
    [columns, groups.div_ceil(columns)]
}

/// Whether a dispatch fits tops of trees.
pub(super) fn is_top(level: &RefitLevel) -> bool {
    level.count == 0
}
