//! Adapters: what there is, what each lacks, and devices of them. The one place that knows what kernels need.

use crate::device::DeviceError;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Storage buffers that the kernels bind at once.
const STORAGE_BUFFERS: u32 = 16;
/// Threads of the largest workgroup, and bytes that they share.
pub(super) const GROUP_THREADS: u32 = 256;
const GROUP_BYTES: u32 = 28 * GROUP_THREADS;
/// What is better: twice as many.
const TOP_THREADS: u32 = 512;
/// The least storage binding that is worth it.
const BINDING_BYTES: u64 = 64 << 20;
/// Without knowledge of an adapter's memory, this much of it is used.
const UNKNOWN_MEMORY_BYTES: u64 = 1 << 30;
/// What is submitted takes about 10 ms; on a machine whose cores are all taken a program that acts as a GPU took seconds.
const PATIENCE: Duration = Duration::from_mins(1);

/// A GPU, or a program that acts as one.
#[derive(Clone, Debug)]
pub struct Adapter {
    /// Its place among the adapters: `gpu:N`.
    pub number: usize,
    handle: wgpu::Adapter,
    info: wgpu::AdapterInfo,
    memory_bytes: Option<u64>,
    /// Features that are there but not used.
    unused: wgpu::Features,
    patience: Duration,
}

/// The adapters of this machine, those that are hardware first.
pub fn adapters() -> Vec<Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        flags: flags(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    // a stable sort: among equals the driver's order
    found.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    let adapter = |(number, adapter): (usize, wgpu::Adapter)| Adapter {
        number,
        info: adapter.get_info(),
        memory_bytes: memory_bytes(&adapter),
        handle: adapter,
        unused: wgpu::Features::empty(),
        patience: PATIENCE,
    };
    found.into_iter().enumerate().map(adapter).collect()
}

/// Validation layers where `WGPU_VALIDATION` asks for them; else none, in debug builds neither: a test of warm frames is
/// not one of drivers.
fn flags() -> wgpu::InstanceFlags {
    wgpu::InstanceFlags::empty().with_env()
}

fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Vulkan's flag of a heap that is the device's own.
const DEVICE_LOCAL: u32 = 1;

/// Bytes of an adapter's own memory, where its back end tells.
fn memory_bytes(adapter: &wgpu::Adapter) -> Option<u64> {
    // SAFETY: the handle is only asked about, while the adapter lives.
    let vulkan = unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }?;
    let instance = vulkan.shared_instance().raw_instance();
    // SAFETY: the physical device is the instance's, which lives as long as the adapter.
    let memory = unsafe { instance.get_physical_device_memory_properties(vulkan.raw_physical_device()) };
    let heaps = memory.memory_heaps.iter().take(memory.memory_heap_count as usize);
    heaps.filter(|heap| heap.flags.as_raw() & DEVICE_LOCAL != 0).map(|heap| heap.size).max()
}

impl Adapter {
    /// Its name on the command line and in reports.
    pub fn name(&self) -> String {
        format!("gpu:{}", self.number)
    }

    /// Whether it is a program: used only when it is named.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Its model, back end and driver.
    pub fn description(&self) -> String {
        let wgpu::AdapterInfo { name, backend, driver, driver_info, .. } = &self.info;
        let kind = if self.is_software() { ", software" } else { "" };
        format!("{name}, {backend:?}{kind}, driver {driver} {driver_info}").trim_end().to_string()
    }

    /// Bytes of its own memory, where it tells.
    pub fn memory_bytes(&self) -> Option<u64> {
        self.memory_bytes
    }

    /// Bytes that a device of it may hold where nothing else is said: four fifths of its memory.
    pub fn default_budget_bytes(&self) -> u64 {
        self.memory_bytes.map_or(UNKNOWN_MEMORY_BYTES, |bytes| bytes / 5 * 4)
    }

    /// Bytes that a buffer of it may have in a kernel.
    pub fn binding_bytes(&self) -> u64 {
        let limits = self.handle.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// Threads that run in step.
    pub fn subgroup_sizes(&self) -> [u32; 2] {
        [self.info.subgroup_min_size, self.info.subgroup_max_size]
    }

    /// What of it is used beyond what every adapter has.
    pub fn features(&self) -> Vec<&'static str> {
        let names = [
            (wgpu::Features::MAPPABLE_PRIMARY_BUFFERS, "mapped buffers"),
            (wgpu::Features::TIMESTAMP_QUERY, "timestamps"),
            (wgpu::Features::PIPELINE_CACHE, "pipeline cache"),
        ];
        let features = self.used_features();
        names.into_iter().filter(|(feature, _)| features.contains(*feature)).map(|(_, name)| name).collect()
    }

    fn used_features(&self) -> wgpu::Features {
        let wanted = wgpu::Features::TIMESTAMP_QUERY
            | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS
            | wgpu::Features::MAPPABLE_PRIMARY_BUFFERS
            | wgpu::Features::PIPELINE_CACHE;
        self.handle.features() & wanted & !self.unused
    }

    /// The same as if it had nothing beyond what every adapter has, for tests.
    #[must_use]
    pub fn plain(mut self) -> Self {
        self.unused = wgpu::Features::all();
        self
    }

    /// The same, given up as hung after another time, for tests.
    #[must_use]
    pub fn patient(mut self, patience: Duration) -> Self {
        self.patience = patience;
        self
    }

    /// Why it cannot be used, where it cannot.
    pub fn lacks(&self) -> Option<String> {
        let limits = self.handle.limits();
        let least = [
            (
                "storage buffers in a kernel",
                u64::from(limits.max_storage_buffers_per_shader_stage),
                u64::from(STORAGE_BUFFERS),
            ),
            (
                "threads in a workgroup",
                u64::from(limits.max_compute_invocations_per_workgroup),
                u64::from(GROUP_THREADS),
            ),
            (
                "bytes that a workgroup shares",
                u64::from(limits.max_compute_workgroup_storage_size),
                u64::from(GROUP_BYTES),
            ),
            ("bytes in a storage buffer", self.binding_bytes(), BINDING_BYTES),
        ];
        let (what, has, needs) = least.into_iter().find(|(_, has, needs)| has < needs)?;
        Some(format!(
            "{}: {} has {has} {what}, {needs} are needed; another device must be used",
            self.name(),
            self.info.name
        ))
    }

    fn top_threads(&self) -> u32 {
        let limits = self.handle.limits();
        let bytes = GROUP_BYTES / GROUP_THREADS * TOP_THREADS;
        let fits = limits.max_compute_invocations_per_workgroup >= TOP_THREADS
            && limits.max_compute_workgroup_size_x >= TOP_THREADS
            && limits.max_compute_workgroup_storage_size >= bytes;
        if fits { TOP_THREADS } else { GROUP_THREADS }
    }

    /// Opens it; it may hold so many bytes of scenes.
    pub(super) fn open(&self, budget_bytes: u64) -> Result<Gpu, DeviceError> {
        let lost = |why: String| DeviceError::Lost { device: self.name(), why };
        if let Some(lacks) = self.lacks() {
            return Err(lost(lacks));
        }
        let request = self.handle.request_device(&wgpu::DeviceDescriptor {
            label: Some("rentix"),
            required_features: self.used_features(),
            required_limits: self.handle.limits(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        });
        let hangs = || {
            lost(format!("its driver hangs: it was not open after {PATIENCE:?}; name another by --device"))
        };
        let opened = within(PATIENCE, || pollster::block_on(request)).ok_or_else(hangs)?;
        let (device, queue) = opened.map_err(|e| lost(e.to_string()))?;
        let trouble = Arc::new(Mutex::new(None));
        let note = Arc::clone(&trouble);
        device.set_device_lost_callback(move |reason, why| tell(&note, format!("{reason:?}: {why}")));
        let note = Arc::clone(&trouble);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| tell(&note, error.to_string())));
        Ok(Gpu {
            name: self.name(),
            binding_bytes: self.binding_bytes(),
            budget_bytes,
            groups_most: self.handle.limits().max_compute_workgroups_per_dimension,
            features: self.used_features(),
            top_threads: self.top_threads(),
            device,
            queue,
            trouble,
            patience: self.patience,
            hangs: AtomicBool::new(false),
        })
    }
}

/// What comes of something, where it comes in time; else a thread is left that waits for it.
fn within<T: Send + 'static>(patience: Duration, does: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    let (give, take) = std::sync::mpsc::channel();
    std::thread::Builder::new().spawn(move || give.send(does())).ok()?;
    take.recv_timeout(patience).ok()
}

/// Keeps the first trouble: what follows follows from it.
fn tell(trouble: &Mutex<Option<String>>, why: String) {
    trouble.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(why);
}

/// A device of an adapter, and what became of it.
#[derive(Debug)]
pub(super) struct Gpu {
    pub(super) name: String,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    /// Bytes of a storage buffer at most.
    pub(super) binding_bytes: u64,
    /// Bytes of scenes that it may hold.
    pub(super) budget_bytes: u64,
    /// Workgroups in one direction at most.
    pub(super) groups_most: u32,
    pub(super) features: wgpu::Features,
    /// Threads of the workgroups that fit the tops of trees.
    pub(super) top_threads: u32,
    /// Set from callbacks: a device that is lost answers every call as if nothing were wrong.
    trouble: Arc<Mutex<Option<String>>>,
    /// What is submitted is done within it, or the device hangs.
    patience: Duration,
    hangs: AtomicBool,
}

impl Gpu {
    /// An error where the device is lost or refused something.
    pub(super) fn check(&self) -> Result<(), DeviceError> {
        // callbacks are called from here; how this went they say
        let _ = self.device.poll(wgpu::PollType::Poll);
        match &*self.trouble.lock().unwrap_or_else(PoisonError::into_inner) {
            None => Ok(()),
            Some(why) => Err(DeviceError::Lost { device: self.name.clone(), why: why.clone() }),
        }
    }

    /// Waits until all that was submitted is done.
    pub(super) fn wait(&self) -> Result<(), DeviceError> {
        self.wait_until(None)
    }

    /// Waits until a submission is done, and those before it.
    pub(super) fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<(), DeviceError> {
        self.wait_until(Some(submission))
    }

    fn wait_until(&self, submission_index: Option<wgpu::SubmissionIndex>) -> Result<(), DeviceError> {
        let waited =
            self.device.poll(wgpu::PollType::Wait { submission_index, timeout: Some(self.patience) });
        self.check()?;
        let why = match waited {
            Ok(_) => return Ok(()),
            Err(wgpu::PollError::Timeout) => {
                self.hangs.store(true, Ordering::Relaxed);
                format!(
                    "it hangs: nothing came of {:?} of waiting; end what else uses it, or name another by --device",
                    self.patience
                )
            }
            Err(error) => error.to_string(),
        };
        Err(DeviceError::Lost { device: self.name.clone(), why })
    }

    /// Whether it did not do in time what was submitted: then it cannot be closed either, for that would wait for it.
    pub(super) fn hangs(&self) -> bool {
        self.hangs.load(Ordering::Relaxed)
    }

    /// A buffer that kernels bind; `what` lies in it.
    pub(super) fn buffer(
        &self,
        what: &str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, DeviceError> {
        self.allows(what, size)?;
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size,
            usage,
            mapped_at_creation: false,
        });
        match pollster::block_on(scope.pop()) {
            None => Ok(buffer),
            Some(_) => Err(DeviceError::MemoryFull {
                device: self.name.clone(),
                what: what.to_string(),
                needed_bytes: size,
            }),
        }
    }

    /// An error where a buffer of so many bytes is larger than one may be.
    pub(super) fn allows(&self, what: &str, size: u64) -> Result<(), DeviceError> {
        if size <= self.binding_bytes { Ok(()) } else { Err(self.too_large(what, size, self.binding_bytes)) }
    }

    pub(super) fn too_large(&self, what: &str, needed_bytes: u64, most_bytes: u64) -> DeviceError {
        let (device, what) = (self.name.clone(), what.to_string());
        DeviceError::BufferTooLarge { device, what, needed_bytes, most_bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_hangs_is_left() {
        assert_eq!(within(PATIENCE, || 3), Some(3));
        let (end, never) = std::sync::mpsc::channel::<u32>();
        assert_eq!(within(Duration::from_millis(1), move || never.recv().unwrap_or(0)), None);
        drop(end);
    }
}
