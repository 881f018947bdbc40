//! Compiled kernels in the store: a driver takes tenths of seconds, and some seconds, for what it need not compile twice.

use super::adapter::Gpu;
use crate::scene::PartHasher;
use crate::store::{Key, Payload, Store};
use std::sync::Arc;

/// Another name for each way in which kernels are kept.
const STORED: &str = "kernels-1";

/// What a driver has compiled, for this adapter and driver.
#[derive(Debug)]
pub(super) struct Compiled {
    cache: wgpu::PipelineCache,
    store: Arc<Store>,
    key: Key,
    /// The hash of what the store has.
    stored: Option<u128>,
}

impl Compiled {
    /// From the store; None where there is no store, or the adapter keeps nothing.
    pub(super) fn new(gpu: &Gpu, store: Option<&Arc<Store>>) -> Option<Self> {
        let store = Arc::clone(store.filter(|_| gpu.features.contains(wgpu::Features::PIPELINE_CACHE))?);
        let info = gpu.device.adapter_info();
        let mut hasher = PartHasher::new("kernels");
        hasher.bytes(wgpu::util::pipeline_cache_key(&info)?.as_bytes());
        hasher.bytes(info.driver_info.as_bytes());
        hasher.bytes(env!("CARGO_PKG_VERSION").as_bytes());
        let key = Key(hasher.finish().0);
        let data: Option<Vec<u8>> = store.get(STORED, key, Payload::rest);
        // SAFETY: the bytes are those that a cache of the same adapter and driver gave: they are in the key, an entry is checked
        // by the store, and wgpu and the driver check their own heads; with `fallback` what does not fit is left out.
        let cache = unsafe {
            gpu.device.create_pipeline_cache(&wgpu::PipelineCacheDescriptor {
                label: Some("kernels"),
                data: data.as_deref(),
                fallback: true,
            })
        };
        Some(Self { cache, store, key, stored: data.as_deref().map(hash) })
    }

    pub(super) fn cache(&self) -> &wgpu::PipelineCache {
        &self.cache
    }

    /// Puts what has been compiled into the store, where that is not there.
    pub(super) fn keep(&mut self) {
        let Some(data) = self.cache.get_data() else { return };
        let hash = hash(&data);
        if self.stored != Some(hash) {
            self.store.put(STORED, self.key, &[&data]);
            self.stored = Some(hash);
        }
    }
}

fn hash(data: &[u8]) -> u128 {
    let mut hasher = PartHasher::new("kernels");
    hasher.bytes(data);
    hasher.finish().0
}
