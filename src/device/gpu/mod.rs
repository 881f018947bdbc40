//! GPUs: the scene lives in their memory, frames are updates.

mod adapter;
mod arena;
mod cache;
mod cuts;
mod exposed;
mod film;
mod fits;
mod frame;
mod heap;
mod parts;
mod pipelines;
pub mod records;
mod resident;
mod scene;
pub mod shaders;

pub use adapter::{Adapter, adapters};

use super::{Device, DeviceError, DeviceInfo, DeviceKind, Output, Spans, Stop, Traced, UpdateCost};
use crate::accel::{Aabb, PackedNode};
use crate::clock::Stopwatch;
use crate::plan::{Residency, UpdatePlan};
use crate::scene::{Background, Frame, Geometry, PartHash, Shot, Texture};
use crate::store::Store;
use adapter::Gpu;
use fits::Fits;
use frame::{Begun, Buffers, Ground, SLOTS};
use pipelines::Pipelines;
use rayon::{ThreadPool, ThreadPoolBuilder};
use resident::{Costs, Means, Resident};
use scene::Records;
use std::collections::{HashMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;

/// A GPU that renders.
#[derive(Debug)]
pub struct GpuDevice {
    info: DeviceInfo,
    adapter: Adapter,
    /// Has compiled kernels.
    store: Option<Arc<Store>>,
    /// Builds trees.
    pool: Arc<ThreadPool>,
    /// None once it was lost, until it is opened again.
    open: Option<Open>,
    /// Whether there was no room for something; what is cold begins with buffers of the least size then.
    is_full: bool,
    /// What a lost one holds.
    nothing: Residency,
}

/// A device that is open, and all that is on it.
#[derive(Debug)]
struct Open {
    gpu: Gpu,
    pipelines: Pipelines,
    resident: Resident,
    buffers: Buffers,
    background: Option<(PartHash, Range<u32>)>,
    /// The boxes of positions that were asked for in this frame or the one before.
    boxes: HashMap<PartHash, Aabb>,
    /// Frames under way, the first begun first; the costs of those trees that are not fitted for it, and when that was.
    under_way: VecDeque<(Begun, Costs, Stopwatch)>,
}

impl GpuDevice {
    /// Opens an adapter; trees are built by so many threads (0: one for each core). It may hold so many bytes.
    ///
    /// # Errors
    /// [`DeviceError::Lost`] where the adapter lacks something, cannot be opened, or there are no threads.
    pub fn new(adapter: &Adapter, threads: usize, budget_bytes: u64) -> Result<Self, DeviceError> {
        Self::with_store(adapter, threads, budget_bytes, None)
    }

    /// The same, with compiled kernels kept in a store.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_store(
        adapter: &Adapter,
        threads: usize,
        budget_bytes: u64,
        store: Option<Arc<Store>>,
    ) -> Result<Self, DeviceError> {
        let no_threads =
            |e: rayon::ThreadPoolBuildError| DeviceError::Lost { device: adapter.name(), why: e.to_string() };
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("gpu-build-{i}"))
            .build()
            .map(Arc::new)
            .map_err(no_threads)?;
        let info = DeviceInfo {
            name: adapter.name(),
            kind: DeviceKind::Gpu,
            description: adapter.description(),
            threads: pool.current_num_threads(),
            budget_bytes,
        };
        let mut device = Self {
            info,
            adapter: adapter.clone(),
            store,
            pool,
            open: None,
            is_full: false,
            nothing: Residency::default(),
        };
        device.opened()?;
        Ok(device)
    }

    /// Loses the device as a driver might, for tests.
    pub fn lose(&self) {
        if let Some(open) = &self.open {
            open.gpu.device.destroy();
        }
    }

    fn opened(&mut self) -> Result<&mut Open, DeviceError> {
        if self.open.is_none() {
            let gpu = self.adapter.open(self.info.budget_bytes)?;
            let pipelines = Pipelines::new(&gpu, self.store.as_ref());
            let resident = Resident::new(&gpu)?;
            gpu.check()?;
            let (buffers, boxes) = (Buffers::default(), HashMap::new());
            self.open = Some(Open {
                gpu,
                pipelines,
                resident,
                buffers,
                background: None,
                boxes,
                under_way: VecDeque::new(),
            });
        }
        match &mut self.open {
            Some(open) => Ok(open),
            None => {
                Err(DeviceError::Lost { device: self.info.name.clone(), why: "it is not open".to_string() })
            }
        }
    }

    /// Forgets a device that is lost: what it held is gone.
    fn settled<T>(&mut self, done: Result<T, DeviceError>) -> Result<T, DeviceError> {
        self.is_full |=
            matches!(done, Err(DeviceError::MemoryFull { .. } | DeviceError::BufferTooLarge { .. }));
        if matches!(done, Err(DeviceError::Lost { .. })) {
            match self.open.take() {
                // it is left as it is: to close it would wait for it
                Some(open) if open.gpu.hangs() => std::mem::forget(open),
                open => drop(open),
            }
        }
        done
    }

    fn apply_here(&mut self, plan: &UpdatePlan, frame: &Frame) -> Result<UpdateCost, DeviceError> {
        if plan.is_cold
            && std::mem::take(&mut self.is_full)
            && self.open.as_ref().is_some_and(|open| open.under_way.is_empty())
        {
            // its buffers would stay as large as they have become
            self.open = None;
        }
        self.opened()?;
        let Self { open: Some(open), pool, info, .. } = self else { return Ok(UpdateCost::default()) };
        // what was to be fitted stands where parts may now be overwritten
        open.fit_now()?;
        let means = Means { gpu: &open.gpu, pool, info };
        let resident = &mut open.resident;
        let mut apply = || resident.apply(plan, frame, &means);
        // a change of threads for each takes as long as building a small one
        let cost = if plan.trees()[0] > 1 { pool.install(apply) } else { apply() }?;
        open.gpu.check()?;
        Ok(cost)
    }

    fn begin_here(
        &mut self,
        frame: &Frame,
        shot: &Shot,
        output: Output,
        stop: &Stop,
    ) -> Result<(), DeviceError> {
        let start = Stopwatch::start();
        self.opened()?;
        let Self { open: Some(open), pool, info, .. } = self else { return Err(DeviceError::Stopped) };
        if stop.asked() {
            return Err(DeviceError::Stopped);
        }
        assert!(open.under_way.len() < SLOTS, "a frame must be finished before another is begun");
        let background = match &shot.background {
            Background::Color(_) => None,
            Background::Picture { texture, .. } => Some(open.background(texture.hash(), texture)?),
        };
        let before = std::mem::take(&mut open.boxes);
        let mut boxes = HashMap::new();
        let box_of = |geometry: &Geometry| {
            let name = geometry.positions.hash();
            let make = || parts::world_box(&geometry.positions.0, pool);
            *boxes.entry(name).or_insert_with(|| before.get(&name).copied().unwrap_or_else(make))
        };
        let not_resident = |object| DeviceError::NotResident { device: info.name.clone(), object };
        // what else is wanted of the film needs floats
        let output = if shot.alpha || !shot.aovs.is_empty() { Output::Linear } else { output };
        let mut records =
            Records::new(frame, shot, output, &open.resident, background, box_of).map_err(not_resident)?;
        open.boxes = boxes;
        let top = open.place_top(&mut records)?;
        let waiting = std::mem::take(&mut open.resident.fits);
        let begun = open.ground().begin(&Fits::new(&waiting), &records, shot, output, stop);
        // the queue keeps the order: what is written there next comes after this frame
        open.resident.heaps.nodes.give(top);
        if matches!(begun, Err(DeviceError::BufferTooLarge { .. } | DeviceError::MemoryFull { .. })) {
            // nothing was handed over
            open.resident.fits = waiting;
        }
        let begun = begun?;
        let costs = open.resident.kept_costs(&begun.fits);
        open.under_way.push_back((begun, costs, start));
        Ok(())
    }

    fn finish_here(&mut self) -> Result<Traced, DeviceError> {
        let lost = || DeviceError::Lost {
            device: self.info.name.clone(),
            why: "what was under way is gone".to_string(),
        };
        let Some(open) = &mut self.open else { return Err(lost()) };
        let Some((begun, mut costs, start)) = open.under_way.pop_front() else { return Err(lost()) };
        let (fits, samples) = (begun.fits.clone(), begun.samples());
        let (film, facts) = open.ground().finish(begun, &self.pool)?;
        open.resident.fitted(&fits, &facts.costs, &mut costs);
        let span = |first: usize| {
            let [from, to] = [facts.instants[first], facts.instants[first + 1]];
            let ms = |ticks: u64| ticks as f64 * f64::from(open.gpu.queue.get_timestamp_period()) * 1e-6;
            (from > 0 && to >= from).then(|| [ms(from), ms(to)])
        };
        let spans = Spans { update: if fits.is_empty() { None } else { span(0) }, trace: span(2) };
        let length = |[from, to]: [f64; 2]| to - from;
        let trace_ms = spans.trace.map_or_else(|| start.ms(), length);
        open.buffers.pace.learn(samples, trace_ms);
        let (update_ms, cost_ratio) = (spans.update.map(length), costs.mean());
        Ok(Traced { film, rays: facts.rays, trace_ms, update_ms, cost_ratio, spans })
    }
}

impl Open {
    fn ground(&mut self) -> Ground<'_> {
        Ground {
            gpu: &self.gpu,
            pipelines: &mut self.pipelines,
            heaps: &self.resident.heaps,
            buffers: &mut self.buffers,
        }
    }

    fn fit_now(&mut self) -> Result<(), DeviceError> {
        let fits = Fits::new(&std::mem::take(&mut self.resident.fits));
        self.ground().fit_only(&fits)
    }

    /// Where the texels of a background picture begin; it is sent where it is another than before.
    fn background(&mut self, name: PartHash, texture: &Texture) -> Result<u32, DeviceError> {
        if let Some((held, place)) = &self.background
            && *held == name
        {
            return Ok(place.start);
        }
        let heaps = &mut self.resident.heaps;
        if let Some((_, place)) = self.background.take() {
            heaps.texels.give(place);
        }
        let bytes = parts::texels(texture);
        let place = heaps.take(&self.gpu, |heaps| &mut heaps.texels, bytes.len() as u64 / 4)?;
        heaps.texels.write(&self.gpu, place.start, bytes);
        self.background = Some((name, place.clone()));
        Ok(place.start)
    }

    /// Puts the level above a frame's objects among the nodes.
    fn place_top(&mut self, records: &mut Records) -> Result<Range<u32>, DeviceError> {
        if records.top.is_empty() {
            return Ok(0..0);
        }
        let heaps = &mut self.resident.heaps;
        let place = heaps.take(&self.gpu, |heaps| &mut heaps.nodes, records.top.len() as u64)?;
        let moved: Vec<PackedNode> = records
            .top
            .iter()
            .map(|node| PackedNode { child_base: node.child_base + place.start, ..*node })
            .collect();
        heaps.nodes.write(&self.gpu, place.start, bytemuck::cast_slice(&moved));
        records.shot.top_node = place.start;
        Ok(place)
    }
}

impl Device for GpuDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn residency(&self) -> &Residency {
        self.open.as_ref().map_or(&self.nothing, |open| &open.resident.residency)
    }

    fn apply(&mut self, plan: &UpdatePlan, frame: &Frame) -> Result<UpdateCost, DeviceError> {
        let done = self.apply_here(plan, frame);
        self.settled(done)
    }

    fn most_under_way(&self) -> usize {
        SLOTS
    }

    fn begin(&mut self, frame: &Frame, shot: &Shot, output: Output, stop: &Stop) -> Result<(), DeviceError> {
        let done = self.begin_here(frame, shot, output, stop);
        self.settled(done)
    }

    fn finish(&mut self) -> Result<Traced, DeviceError> {
        let done = self.finish_here();
        self.settled(done)
    }
}
