//! Films of frames that are traced and lie in the buffers that their kernels wrote, until nobody wants them any more.

use std::sync::{Arc, Mutex, PoisonError};

/// What one frame writes.
#[derive(Debug)]
pub(super) struct FilmBuffers {
    /// Where kernels write the film.
    pub(super) film: wgpu::Buffer,
    /// Where the host reads it; None where that is the same.
    pub(super) back: Option<wgpu::Buffer>,
}

impl FilmBuffers {
    /// The buffer that the host reads.
    pub(super) fn read_by_host(&self) -> &wgpu::Buffer {
        self.back.as_ref().unwrap_or(&self.film)
    }
}

/// Buffers that are free for films.
#[derive(Clone, Debug, Default)]
pub(super) struct Free(Arc<Mutex<Vec<FilmBuffers>>>);

impl Free {
    /// Buffers of so many bytes; smaller ones are dropped.
    pub(super) fn take(&self, bytes: u64) -> Option<FilmBuffers> {
        let mut buffers = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        std::iter::from_fn(|| buffers.pop()).find(|film| film.film.size() >= bytes)
    }

    fn give(&self, buffers: FilmBuffers) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffers);
    }
}

/// The bytes of a frame in its buffer, which the host sees. wgpu keeps the memory of what is mapped, though the device be
/// lost or closed. The buffer is free again once this is dropped.
#[derive(Debug)]
pub(super) struct Exposed {
    /// None when it is dropped.
    seen: Option<(wgpu::BufferView, FilmBuffers)>,
    free: Free,
}

impl Exposed {
    /// A buffer that is mapped, and the view of it.
    pub(super) fn new(view: wgpu::BufferView, buffers: FilmBuffers, free: &Free) -> Self {
        Self { seen: Some((view, buffers)), free: free.clone() }
    }
}

impl AsRef<[u8]> for Exposed {
    fn as_ref(&self) -> &[u8] {
        self.seen.as_ref().map_or(&[], |(view, _)| view)
    }
}

impl Drop for Exposed {
    fn drop(&mut self) {
        if let Some((view, buffers)) = self.seen.take() {
            drop(view);
            buffers.read_by_host().unmap();
            self.free.give(buffers);
        }
    }
}
