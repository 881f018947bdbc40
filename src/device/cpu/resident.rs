//! What the CPU device holds: parts, shared with whoever read them, and trees.

use crate::accel::{Quality, TracedObject, TracedScene, Tree};
use crate::clock::Stopwatch;
use crate::device::{DeviceError, DeviceInfo, UpdateCost};
use crate::plan::{Action, Residency, Step, TreeState, UpdatePlan, tree_name};
use crate::scene::{Frame, Geometry, PartHash, SharedPart};
use crate::store::{Key, Payload, Store};
use rayon::ThreadPool;
use std::collections::HashMap;
use std::sync::Arc;

/// Parts and trees.
#[derive(Debug, Default)]
pub(super) struct Resident {
    residency: Residency,
    trees: HashMap<PartHash, Arc<Tree>>,
    /// The parts, shared with whoever read them.
    parts: HashMap<PartHash, SharedPart>,
    /// Has shapes of trees.
    pub(super) store: Option<Arc<Store>>,
}

impl Resident {
    pub(super) fn residency(&self) -> &Residency {
        &self.residency
    }

    /// Applies a plan that was made for this frame and for what is held; trees are built in the pool. Refuses before
    /// anything is changed where what is needed does not fit the budget.
    pub(super) fn apply(
        &mut self,
        plan: &UpdatePlan,
        frame: &Frame,
        pool: &ThreadPool,
        device: &DeviceInfo,
    ) -> Result<UpdateCost, DeviceError> {
        let needed_bytes = plan.needed_bytes(&self.residency);
        refuse_beyond(device, needed_bytes)?;
        let mut of_frame: HashMap<_, _> =
            frame.objects.iter().flat_map(|o| o.geometry.shared_parts()).collect();
        self.residency.begin(plan);
        let mut cost = UpdateCost::default();
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
                    self.parts.extend(of_frame.remove_entry(&part));
                    self.residency.hold(part, bytes);
                }
                Step::Refit { from, tree: name, object, keep_up_to, .. } => {
                    let Some(object) = frame.objects.get(object) else { continue };
                    let geometry = &object.geometry;
                    let refitted = Stopwatch::start();
                    let tree = self.trees.remove(&from);
                    let state = self.residency.trees.get(&from);
                    let has_corners = state.is_some_and(|s| s.parts.contains(&geometry.triangles.hash()));
                    let is_good = tree.is_some_and(|mut tree| {
                        // no trace is under way, so that nobody else holds it and nothing is copied
                        let in_place = Arc::make_mut(&mut tree);
                        pool.install(|| {
                            if !has_corners {
                                in_place.reindex(&geometry.triangles.0);
                            }
                            in_place.refit(&geometry.positions.0);
                        });
                        self.residency.refit(from, name, geometry, in_place.cost());
                        self.trees.insert(name, tree);
                        self.residency.trees.get(&name).is_some_and(|s| s.ratio() <= keep_up_to)
                    });
                    let triangles = geometry.triangles.0.len() as u64;
                    cost.refitted.add(triangles, refitted.ms());
                    if !is_good {
                        self.trees.remove(&name);
                        self.residency.free(name);
                        self.build(name, geometry, None, pool, device, &mut cost)?;
                    }
                }
                Step::Build { tree: name, object, .. } => {
                    let Some(object) = frame.objects.get(object) else { continue };
                    // those of later frames come in any number, and are hardly asked for again
                    let store = self.store.clone().filter(|_| plan.action == Action::Load && !plan.is_cold);
                    self.build(name, &object.geometry, store.as_deref(), pool, device, &mut cost)?;
                }
            }
        }
        self.residency.end(plan);
        let update_ms = cost.built.ms + cost.restored.ms + cost.refitted.ms;
        cost.upload_ms = Some(start.ms() - update_ms);
        cost.update_ms = Some(update_ms);
        cost.cost_ratio = self.residency.cost_ratio();
        Ok(cost)
    }

    fn build(
        &mut self,
        name: PartHash,
        geometry: &Geometry,
        store: Option<&Store>,
        pool: &ThreadPool,
        device: &DeviceInfo,
        cost: &mut UpdateCost,
    ) -> Result<(), DeviceError> {
        let start = Stopwatch::start();
        let (tree, is_built) = pool.install(|| stored_or_built(name, geometry, store));
        // many small objects may need more than the estimate
        let needed_bytes = |residency: &Residency| residency.bytes() + tree.bytes();
        if needed_bytes(&self.residency) > device.budget_bytes {
            for idle in self.residency.idle() {
                self.forget(idle);
                self.residency.evict(idle);
                if needed_bytes(&self.residency) <= device.budget_bytes {
                    break;
                }
            }
        }
        refuse_beyond(device, needed_bytes(&self.residency))?;
        let state = TreeState::built(geometry, tree.cost());
        self.residency.hold_tree(name, tree.bytes(), state);
        self.trees.insert(name, Arc::new(tree));
        let work = if is_built { &mut cost.built } else { &mut cost.restored };
        work.add(geometry.triangles.0.len() as u64, start.ms());
        Ok(())
    }

    fn forget(&mut self, name: PartHash) {
        self.parts.remove(&name);
        self.trees.remove(&name);
    }

    /// The scene of a frame that is resident; else the first object whose tree is not there.
    pub(super) fn scene(&self, frame: &Frame) -> Result<TracedScene, usize> {
        let objects = frame.objects.iter().enumerate().map(|(i, object)| {
            let tree = self.trees.get(&tree_name(&object.geometry)).ok_or(i)?;
            Ok(TracedObject::new(Arc::clone(tree), object.transform.as_ref()))
        });
        Ok(TracedScene::new(objects.collect::<Result<_, usize>>()?))
    }
}

/// Below so many triangles a tree is built faster than its shape is read.
const LEAST_STORED: usize = 2048;
/// Another name for each way in which trees are built or kept.
const STORED: &str = "tree-2";

/// A tree, and whether it was built.
fn stored_or_built(name: PartHash, geometry: &Geometry, store: Option<&Store>) -> (Tree, bool) {
    let (positions, triangles) = (&geometry.positions.0, &geometry.triangles.0);
    let build = || Tree::build(positions, triangles, Quality::default());
    let Some(store) = store.filter(|_| triangles.len() >= LEAST_STORED) else { return (build(), true) };
    let stored = store.get(STORED, Key(name.0), Payload::rest);
    if let Some(tree) = stored.and_then(|words| Tree::from_shape(&words, positions, triangles)) {
        return (tree, false);
    }
    let tree = build();
    store.put(STORED, Key(name.0), &[bytemuck::cast_slice(&tree.shape())]);
    (tree, true)
}

fn refuse_beyond(device: &DeviceInfo, needed_bytes: u64) -> Result<(), DeviceError> {
    if needed_bytes <= device.budget_bytes {
        return Ok(());
    }
    Err(DeviceError::OutOfMemory {
        device: device.name.clone(),
        needed_bytes,
        budget_bytes: device.budget_bytes,
    })
}
