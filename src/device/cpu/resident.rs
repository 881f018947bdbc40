//! What the CPU device holds: the parts of the frame that was applied last, shared with whoever read them, and trees.

use crate::accel::{Quality, TracedObject, TracedScene, Tree};
use crate::clock::Stopwatch;
use crate::device::{DeviceError, DeviceInfo, UpdateCost};
use crate::plan::{Residency, Step, UpdatePlan, tree_name};
use crate::scene::{Frame, Geometry, PartHash};
use rayon::ThreadPool;
use std::collections::HashMap;
use std::sync::Arc;

/// What a tree is taken to need for each triangle before it is built; real scenes take 70 to 90.
const TREE_BYTES_PER_TRIANGLE: u64 = 100;

/// Parts and trees.
#[derive(Debug, Default)]
pub(super) struct Resident {
    residency: Residency,
    trees: HashMap<PartHash, Arc<Tree>>,
    /// Keeps the parts in memory.
    parts: Vec<Arc<Geometry>>,
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
        let needed_bytes = plan.needed_bytes(&self.residency, TREE_BYTES_PER_TRIANGLE);
        refuse_beyond(device, needed_bytes)?;
        self.parts = frame.objects.iter().map(|o| Arc::clone(&o.geometry)).collect();
        let mut uploaded_bytes = 0;
        let mut update_ms = 0.0;
        let start = Stopwatch::start();
        for step in &plan.steps {
            match *step {
                Step::Free { name } => {
                    self.trees.remove(&name);
                    self.residency.free(name);
                }
                Step::Keep { .. } => self.residency.keep(),
                Step::Upload { part, bytes } => {
                    uploaded_bytes += bytes;
                    self.residency.hold(part, bytes);
                }
                Step::Build { tree: name, object, .. } => {
                    let Some(object) = frame.objects.get(object) else { continue };
                    let start = Stopwatch::start();
                    let geometry = &object.geometry;
                    let tree = pool.install(|| {
                        Tree::build(&geometry.positions.0, &geometry.triangles.0, Quality::default())
                    });
                    // many small objects may need more than the estimate
                    refuse_beyond(device, self.residency.bytes() + tree.bytes())?;
                    self.residency.hold(name, tree.bytes());
                    self.trees.insert(name, Arc::new(tree));
                    update_ms += start.ms();
                }
            }
        }
        Ok(UpdateCost { uploaded_bytes, upload_ms: Some(start.ms() - update_ms), update_ms: Some(update_ms) })
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
