//! Films of frames that are traced and lie in the buffers that their kernels wrote, until somebody wants them.

use super::film::{Layout, take_out};
use crate::device::Output;
use crate::film::{Film, LatentFilm};
use crate::scene::{AovSet, Shot};
use rayon::ThreadPool;
use std::sync::{Arc, Mutex, PoisonError, Weak};

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

/// A film in its buffer, which the host sees.
#[derive(Debug)]
pub(super) struct Exposed {
    pub(super) view: wgpu::BufferView,
    pub(super) film: FilmBuffers,
    pub(super) layout: Layout,
    pub(super) shot: Shot,
    pub(super) output: Output,
    pub(super) pool: Arc<ThreadPool>,
}

/// A film on its way to whoever wants it.
enum Held {
    Exposed(Box<Exposed>),
    Taken(Box<Film>),
}

/// Buffers that are free for films, and the films that lie in others.
#[derive(Clone, Debug, Default)]
pub(super) struct Free {
    buffers: Arc<Mutex<Vec<FilmBuffers>>>,
    exposed: Arc<Mutex<Vec<Weak<Mutex<Held>>>>>,
}

impl Free {
    /// Buffers of so many bytes; smaller ones are dropped.
    pub(super) fn take(&self, bytes: u64) -> Option<FilmBuffers> {
        let mut buffers = self.buffers.lock().unwrap_or_else(PoisonError::into_inner);
        std::iter::from_fn(|| buffers.pop()).find(|film| film.film.size() >= bytes)
    }

    /// A film that is taken from its buffer when it is asked for.
    pub(super) fn latent(&self, exposed: Exposed) -> LatentFilm {
        let held = Arc::new(Mutex::new(Held::Exposed(Box::new(exposed))));
        let mut all = self.exposed.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|held| held.strong_count() > 0);
        all.push(Arc::downgrade(&held));
        let free = self.clone();
        // whoever asks does so once
        LatentFilm::new(move || free.film_of(&mut held.lock().unwrap_or_else(PoisonError::into_inner)))
    }

    /// Takes all films from their buffers, before these are destroyed.
    pub(super) fn rescue(&self) {
        for held in self.exposed.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
            let Some(held) = held.upgrade() else { continue };
            let mut held = held.lock().unwrap_or_else(PoisonError::into_inner);
            *held = Held::Taken(Box::new(self.film_of(&mut held)));
        }
    }

    /// The film; its buffers are free again.
    fn film_of(&self, held: &mut Held) -> Film {
        match std::mem::replace(held, Held::Taken(Box::new(Film::new([0, 0], false, AovSet::default())))) {
            Held::Taken(film) => *film,
            Held::Exposed(exposed) => {
                let Exposed { view, film: buffers, layout, shot, output, pool } = *exposed;
                let film = take_out(&view, &layout, &shot, output, &pool);
                drop(view);
                buffers.read_by_host().unmap();
                self.buffers.lock().unwrap_or_else(PoisonError::into_inner).push(buffers);
                film
            }
        }
    }
}
