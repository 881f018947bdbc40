//! What a GPU holds: parts and trees at places of its heaps.

use super::adapter::Gpu;
use super::heap::{Heap, Heaps};
use super::parts::{move_nodes, texels, triangle_slots, vertices, words};
use super::records::{ABSENT, RefitTree};
use crate::accel::{PackedTree, Quality, TRIANGLE_BYTES};
use crate::clock::Stopwatch;
use crate::device::{DeviceError, DeviceInfo, UpdateCost};
use crate::plan::{Residency, Step, TreeState, UpdatePlan, tree_name};
use crate::scene::{Frame, Geometry, Part, PartHash, Triangles};
use rayon::ThreadPool;
use std::collections::{HashMap, HashSet};
use std::ops::Range;

/// Nodes that one workgroup fits height after height, at most.
const TOP_NODES: u32 = 64;
/// A GPU traces so fast that a tree is worth more than the least work; no splits: a tree is refitted.
const QUALITY: Quality = Quality::Medium;

/// Where a part is.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Place {
    Words(Range<u32>),
    Texels(Range<u32>),
    /// Kernels do not read it.
    Host,
}

/// A tree at its places.
#[derive(Debug)]
pub(super) struct GpuTree {
    /// Stays where its name changes.
    mark: u64,
    /// In the first one's place stands the box of all; then comes the root.
    nodes: Range<u32>,
    triangles: Range<u32>,
    vertices: Range<u32>,
    /// Nodes by height, then the starts of heights and an end.
    lists: Range<u32>,
    heights: Vec<Range<u32>>,
    /// For each place of a leaf the triangle's number.
    order: Vec<u32>,
    /// The triangles that its vertices are those of.
    corners: PartHash,
}

impl GpuTree {
    /// Levels of its nodes.
    pub(super) fn levels(&self) -> usize {
        self.heights.len()
    }

    /// Its root in the nodes, and the first of its triangles.
    pub(super) fn root(&self) -> (u32, u32) {
        if self.heights.is_empty() { (ABSENT, 0) } else { (self.nodes.start + 1, self.triangles.start) }
    }
}

/// Which tree is fitted, and whether it was just built.
#[derive(Clone, Copy, Debug)]
pub(super) struct FitOf {
    mark: u64,
    is_new: bool,
}

/// Surface-area costs of a frame's trees over those of their last builds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Costs {
    triangles: f64,
    /// The sum of what each has, times its triangles.
    sum: f64,
}

impl Costs {
    fn add(&mut self, state: &TreeState) {
        self.triangles += state.triangles as f64;
        self.sum += state.triangles as f64 * state.ratio();
    }

    /// The mean by triangles; None without trees.
    pub(super) fn mean(self) -> Option<f64> {
        (self.triangles > 0.0).then(|| self.sum / self.triangles)
    }
}

/// A tree that is to be fitted before the next frame is traced.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// The tree.
    pub(super) of: FitOf,
    pub(super) record: RefitTree,
    pub(super) nodes: u32,
    /// Heights that are dispatches of their own.
    pub(super) below_top: Vec<Range<u32>>,
}

/// What is sent is handed over in pieces of about so many bytes.
const STAGED_BYTES: u64 = 256 << 20;

/// Parts and trees.
#[derive(Debug)]
pub(super) struct Resident {
    pub(super) residency: Residency,
    pub(super) heaps: Heaps,
    parts: HashMap<PartHash, Place>,
    trees: HashMap<PartHash, GpuTree>,
    /// Fits that were not submitted yet.
    pub(super) fits: Vec<Fit>,
    /// The mark of the next tree.
    next_mark: u64,
}

/// What an update needs beside what is held.
pub(super) struct Means<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) pool: &'a ThreadPool,
    pub(super) info: &'a DeviceInfo,
}

impl Means<'_> {
    fn out_of_memory(&self, needed_bytes: u64, budget_bytes: u64) -> DeviceError {
        DeviceError::OutOfMemory { device: self.info.name.clone(), needed_bytes, budget_bytes }
    }
}

impl Resident {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, DeviceError> {
        Ok(Self {
            residency: Residency::default(),
            heaps: Heaps::new(gpu)?,
            parts: HashMap::new(),
            trees: HashMap::new(),
            fits: Vec::new(),
            next_mark: 0,
        })
    }

    /// Applies a plan that was made for this frame and for what is held. Refuses before anything is changed where what is
    /// needed does not fit the budget, or a buffer that the adapter allows.
    pub(super) fn apply(
        &mut self,
        plan: &UpdatePlan,
        frame: &Frame,
        means: &Means,
    ) -> Result<UpdateCost, DeviceError> {
        let needed_bytes = plan.needed_bytes(&self.residency);
        if needed_bytes > means.info.budget_bytes {
            return Err(means.out_of_memory(needed_bytes, means.info.budget_bytes));
        }
        refuse_beyond_bindings(frame, means)?;
        let mut of_frame: HashMap<PartHash, &Geometry> = HashMap::new();
        for object in &frame.objects {
            of_frame.extend(object.geometry.parts().into_iter().map(|(name, _)| (name, &*object.geometry)));
        }
        self.residency.begin(plan);
        let mut cost = UpdateCost::default();
        let mut staged_bytes = 0;
        let start = Stopwatch::start();
        for step in &plan.steps {
            match *step {
                Step::Free { name } => {
                    self.forget(name);
                    self.residency.free(name);
                }
                Step::Evict { name } => {
                    self.forget(name);
                    self.residency.evict(name);
                }
                Step::Keep { name } => self.residency.keep(name),
                Step::Upload { part, bytes } => {
                    cost.uploaded_bytes += bytes;
                    if let Some(geometry) = of_frame.get(&part) {
                        let place = self.upload(part, geometry, means)?;
                        self.parts.insert(part, place);
                    }
                    self.residency.hold(part, bytes);
                    staged_bytes += bytes;
                    if staged_bytes > STAGED_BYTES {
                        // else all would wait a second time in the host's memory
                        means.gpu.queue.submit([]);
                        staged_bytes = 0;
                    }
                }
                Step::Refit { from, tree: name, object, .. } => {
                    let Some(object) = frame.objects.get(object) else { continue };
                    let geometry = &object.geometry;
                    let refitted = Stopwatch::start();
                    let Some(mut tree) = self.trees.remove(&from) else { continue };
                    if tree.corners != geometry.triangles.hash() {
                        tree.corners = geometry.triangles.hash();
                        let vertices = vertices(&tree.order, &geometry.triangles, means.pool);
                        self.heaps.words.write(
                            means.gpu,
                            tree.vertices.start,
                            bytemuck::cast_slice(&vertices),
                        );
                    }
                    let cost_before = self.residency.trees.get(&from).map_or(0.0, |s| s.cost);
                    self.residency.refit(from, name, geometry, cost_before);
                    self.trees.insert(name, tree);
                    self.fit(name, geometry, false);
                    cost.refitted.add(geometry.triangles.0.len() as u64, refitted.ms());
                }
                Step::Build { tree: name, object, .. } => {
                    let Some(object) = frame.objects.get(object) else { continue };
                    let built = Stopwatch::start();
                    self.build(name, &object.geometry, means)?;
                    cost.built.add(object.geometry.triangles.0.len() as u64, built.ms());
                }
            }
        }
        self.residency.end(plan);
        let update_ms = cost.built.ms + cost.refitted.ms;
        cost.upload_ms = Some(start.ms() - update_ms);
        cost.update_ms = Some(update_ms);
        cost.cost_ratio = self.residency.cost_ratio();
        Ok(cost)
    }

    fn upload(&mut self, part: PartHash, geometry: &Geometry, means: &Means) -> Result<Place, DeviceError> {
        if let Some(texture) = geometry.textures().find(|t| t.hash() == part) {
            let bytes = texels(texture);
            let place = self.take(means, |heaps| &mut heaps.texels, bytes.len() as u64 / 4)?;
            self.heaps.texels.write(means.gpu, place.start, bytes);
            return Ok(Place::Texels(place));
        }
        let slots;
        let words = if part == geometry.material_runs.hash() {
            slots = triangle_slots(&geometry.material_runs.0);
            &slots
        } else {
            match words(part, geometry) {
                Some(words) => words,
                None => return Ok(Place::Host),
            }
        };
        let place = self.take(means, |heaps| &mut heaps.words, words.len() as u64)?;
        self.heaps.words.write(means.gpu, place.start, bytemuck::cast_slice(words));
        Ok(Place::Words(place))
    }

    /// A place in a heap; where there is none, what no frame needs now is given up, and it is tried once more.
    fn take(
        &mut self,
        means: &Means,
        heap: fn(&mut Heaps) -> &mut Heap,
        units: u64,
    ) -> Result<Range<u32>, DeviceError> {
        if let Ok(place) = self.heaps.take(means.gpu, heap, units) {
            return Ok(place);
        }
        for idle in self.residency.idle() {
            self.forget(idle);
            self.residency.evict(idle);
        }
        self.heaps.take(means.gpu, heap, units)
    }

    fn build(&mut self, name: PartHash, geometry: &Geometry, means: &Means) -> Result<(), DeviceError> {
        let (positions, triangles) = (&geometry.positions.0, &geometry.triangles);
        let packed = means.pool.install(|| PackedTree::build(positions, &triangles.0, QUALITY));
        let bytes = packed.device_bytes();
        // many small objects may need more than the estimate
        if self.residency.bytes() + bytes > means.info.budget_bytes {
            for idle in self.residency.idle() {
                self.forget(idle);
                self.residency.evict(idle);
                if self.residency.bytes() + bytes <= means.info.budget_bytes {
                    break;
                }
            }
        }
        let needed_bytes = self.residency.bytes() + bytes;
        if needed_bytes > means.info.budget_bytes {
            return Err(means.out_of_memory(needed_bytes, means.info.budget_bytes));
        }
        let cost = packed.cost;
        let tree = self.place(packed, triangles, means)?;
        self.residency.hold_tree(name, bytes, TreeState::built(geometry, cost));
        self.trees.insert(name, tree);
        self.fit(name, geometry, true);
        Ok(())
    }

    /// Puts a tree's shape into the heaps.
    fn place(
        &mut self,
        packed: PackedTree,
        triangles: &Part<Triangles>,
        means: &Means,
    ) -> Result<GpuTree, DeviceError> {
        let PackedTree { mut nodes, order, by_height, heights, .. } = packed;
        let mut lists = by_height;
        lists.extend(heights.iter().map(|h| h.start));
        lists.extend(heights.last().map(|h| h.end));
        self.next_mark += 1;
        let mut tree = GpuTree {
            mark: self.next_mark,
            nodes: 0..0,
            triangles: 0..0,
            vertices: 0..0,
            lists: 0..0,
            heights,
            order,
            corners: triangles.hash(),
        };
        if let Err(error) = self.take_places(&mut tree, nodes.len(), lists.len(), means) {
            self.give_places(tree);
            return Err(error);
        }
        let (gpu, root) = (means.gpu, tree.nodes.start + 1);
        move_nodes(&mut nodes, root, tree.triangles.start);
        self.heaps.nodes.write(gpu, root, bytemuck::cast_slice(&nodes));
        let vertices = vertices(&tree.order, triangles, means.pool);
        self.heaps.words.write(gpu, tree.vertices.start, bytemuck::cast_slice(&vertices));
        self.heaps.words.write(gpu, tree.lists.start, bytemuck::cast_slice(&lists));
        Ok(tree)
    }

    fn take_places(
        &mut self,
        tree: &mut GpuTree,
        nodes: usize,
        lists: usize,
        means: &Means,
    ) -> Result<(), DeviceError> {
        let triangles = tree.order.len() as u64;
        tree.nodes = self.take(means, |heaps| &mut heaps.nodes, 1 + nodes as u64)?;
        tree.triangles = self.take(means, |heaps| &mut heaps.triangles, triangles)?;
        tree.vertices = self.take(means, |heaps| &mut heaps.words, 4 * triangles)?;
        tree.lists = self.take(means, |heaps| &mut heaps.words, lists as u64)?;
        Ok(())
    }

    fn give_places(&mut self, tree: GpuTree) {
        self.heaps.nodes.give(tree.nodes);
        self.heaps.triangles.give(tree.triangles);
        self.heaps.words.give(tree.vertices);
        self.heaps.words.give(tree.lists);
    }

    /// Asks for a fit of a tree to a geometry's positions before the next frame is traced.
    fn fit(&mut self, name: PartHash, geometry: &Geometry, is_new: bool) {
        let (Some(tree), Some(positions)) = (self.trees.get(&name), self.words_of(geometry.positions.hash()))
        else {
            return;
        };
        if tree.heights.is_empty() {
            return;
        }
        // the nodes from this height on are few
        let last = tree.heights.last().map_or(0, |h| h.end);
        let top = tree.heights.iter().position(|h| last - h.start <= TOP_NODES).unwrap_or(tree.heights.len());
        let record = RefitTree {
            positions,
            vertices: tree.vertices.start / 4,
            by_height: tree.lists.start,
            heights: tree.lists.start + last,
            height_count: tree.heights.len() as u32,
            top_height: top as u32,
            first_node: tree.nodes.start + 1,
            first_triangle: tree.triangles.start,
            first_box: 0,
            pad_a: 0,
            pad_b: 0,
            pad_c: 0,
        };
        let below_top = tree.heights[..top].to_vec();
        self.fits.push(Fit { of: FitOf { mark: tree.mark, is_new }, record, nodes: last, below_top });
    }

    /// The costs of those trees of this turn's frame that are not fitted for it; none where no tree is.
    pub(super) fn kept_costs(&self, fits: &[FitOf]) -> Costs {
        if fits.is_empty() {
            return Costs::default();
        }
        let fitted: HashSet<u64> = fits.iter().map(|of| of.mark).collect();
        let kept = self
            .trees
            .iter()
            .filter(|(name, tree)| !fitted.contains(&tree.mark) && self.residency.is_used(name));
        let mut costs = Costs::default();
        for state in kept.filter_map(|(name, _)| self.residency.trees.get(name)) {
            costs.add(state);
        }
        costs
    }

    /// Learns what fits made of trees' surface-area costs, and adds them to those of their frame.
    pub(super) fn fitted(&mut self, fits: &[FitOf], costs: &[f32], of_frame: &mut Costs) {
        if fits.is_empty() {
            return;
        }
        let fitted: HashMap<u64, (bool, f32)> =
            fits.iter().zip(costs).map(|(of, &cost)| (of.mark, (of.is_new, cost))).collect();
        for (name, tree) in &self.trees {
            let Some(&(is_new, cost)) = fitted.get(&tree.mark) else { continue };
            let Some(state) = self.residency.trees.get_mut(name) else { continue };
            state.cost = f64::from(cost);
            if is_new {
                state.built_cost = state.cost;
            }
            of_frame.add(state);
        }
    }

    fn forget(&mut self, name: PartHash) {
        match self.parts.remove(&name) {
            Some(Place::Words(place)) => self.heaps.words.give(place),
            Some(Place::Texels(place)) => self.heaps.texels.give(place),
            Some(Place::Host) | None => {}
        }
        if let Some(tree) = self.trees.remove(&name) {
            self.give_places(tree);
        }
    }

    /// Where a part's words begin.
    pub(super) fn words_of(&self, part: PartHash) -> Option<u32> {
        match self.parts.get(&part)? {
            Place::Words(place) => Some(place.start),
            _ => None,
        }
    }

    /// Where a texture's texels begin.
    pub(super) fn texels_of(&self, part: PartHash) -> Option<u32> {
        match self.parts.get(&part)? {
            Place::Texels(place) => Some(place.start),
            _ => None,
        }
    }

    /// The tree over a geometry.
    pub(super) fn tree(&self, geometry: &Geometry) -> Option<&GpuTree> {
        self.trees.get(&tree_name(geometry))
    }
}

/// Refuses a frame of which one kind of data does not fit the largest buffer that the adapter allows.
fn refuse_beyond_bindings(frame: &Frame, means: &Means) -> Result<(), DeviceError> {
    let mut seen = HashSet::new();
    let (mut triangles, mut words_bytes, mut texels_bytes) = (0_u64, 0_u64, 0_u64);
    for object in &frame.objects {
        let geometry = &*object.geometry;
        for (name, bytes) in geometry.parts() {
            if seen.insert(name) {
                if words(name, geometry).is_some() {
                    words_bytes += bytes;
                } else if geometry.textures().any(|t| t.hash() == name) {
                    texels_bytes += bytes;
                }
            }
        }
        if seen.insert(tree_name(geometry)) {
            triangles += geometry.triangles.0.len() as u64;
        }
    }
    let gpu = means.gpu;
    gpu.allows("triangles", triangles * TRIANGLE_BYTES)?;
    // by triangle: its vertices and number, its slot, and a share of the lists of nodes
    gpu.allows("indices and attributes", words_bytes + triangles * 24)?;
    gpu.allows("textures", texels_bytes)
}
