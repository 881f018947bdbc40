//! The cores of the host: trees that stay, tiles over threads.

mod resident;
mod trace;

use super::{Device, DeviceError, DeviceInfo, DeviceKind, Output, Stop, Traced, UpdateCost};
use crate::accel::Width;
use crate::plan::{Residency, UpdatePlan};
use crate::scene::{Frame, Shot};
use crate::store::Store;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use resident::Resident;
use std::sync::Arc;

/// The CPU device.
#[derive(Debug)]
pub struct CpuDevice {
    info: DeviceInfo,
    pool: ThreadPool,
    resident: Resident,
    width: Width,
    /// The frame that was begun: it is traced at once.
    traced: Option<Traced>,
}

impl CpuDevice {
    /// A device with a pool of its own, of so many threads (0: one for each core), that may hold so many bytes.
    ///
    /// # Errors
    /// Where the system gives no threads.
    pub fn new(threads: usize, budget_bytes: u64) -> Result<Self, ThreadPoolBuildError> {
        let pool =
            ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("trace-{i}")).build()?;
        let width = Width::detect();
        let threads = pool.current_num_threads();
        let info = DeviceInfo {
            name: "cpu".to_string(),
            kind: DeviceKind::Cpu,
            description: format!("{threads} threads, {width:?}"),
            threads,
            budget_bytes,
        };
        Ok(Self { info, pool, resident: Resident::default(), width, traced: None })
    }

    /// With another name than `cpu`, where it is one of several.
    #[must_use]
    pub fn named(mut self, name: String) -> Self {
        self.info.name = name;
        self
    }

    /// Takes the shapes of a run's first trees from a store, and puts them into it.
    #[must_use]
    pub fn with_store(mut self, store: Option<Arc<Store>>) -> Self {
        self.resident.store = store;
        self
    }

    /// Traces in another SIMD width; one that the machine lacks is not taken. The pictures are the same.
    #[must_use]
    pub fn with_width(mut self, width: Width) -> Self {
        if Width::available().contains(&width) {
            self.width = width;
        }
        self
    }
}

impl Device for CpuDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn residency(&self) -> &Residency {
        self.resident.residency()
    }

    fn apply(&mut self, plan: &UpdatePlan, frame: &Frame) -> Result<UpdateCost, DeviceError> {
        let Self { resident, pool, info, .. } = self;
        let mut apply = || resident.apply(plan, frame, pool, info);
        // a change of threads for each takes as long as building a small one
        if plan.trees().iter().sum::<usize>() > 1 { pool.install(apply) } else { apply() }
    }

    fn begin(&mut self, frame: &Frame, shot: &Shot, output: Output, stop: &Stop) -> Result<(), DeviceError> {
        let scene = self
            .resident
            .scene(frame)
            .map_err(|object| DeviceError::NotResident { device: self.info.name.clone(), object })?
            .with_width(self.width);
        self.traced = Some(self.pool.install(|| trace::trace(&scene, frame, shot, output, stop))?);
        Ok(())
    }

    fn finish(&mut self) -> Result<Traced, DeviceError> {
        let why = "no frame was begun".to_string();
        self.traced.take().ok_or_else(|| DeviceError::Lost { device: self.info.name.clone(), why })
    }
}
