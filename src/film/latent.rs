//! A film that may lie on its device until it is asked for.

use super::Film;
use std::fmt;
use std::ops::Deref;
use std::sync::{Mutex, OnceLock, PoisonError};

type Develop = Box<dyn FnOnce() -> Film + Send>;

/// A film, or what takes it from where its device left it: then the thread that wants it does that, and the device's thread
/// goes on with the next frame.
pub struct LatentFilm {
    film: OnceLock<Film>,
    develop: Mutex<Option<Develop>>,
}

impl LatentFilm {
    /// One that is taken from its device when it is asked for.
    pub fn new(develop: impl FnOnce() -> Film + Send + 'static) -> Self {
        Self { film: OnceLock::new(), develop: Mutex::new(Some(Box::new(develop))) }
    }

    /// Whether it is there already.
    pub fn is_developed(&self) -> bool {
        self.film.get().is_some()
    }

    /// The film; whoever asks first takes it from its device, others wait meanwhile.
    pub fn film(&self) -> &Film {
        self.film.get_or_init(|| {
            let develop = self.develop.lock().unwrap_or_else(PoisonError::into_inner).take();
            // it is there, or else what makes it: only a panic there leaves neither, and that panic has been told of
            develop.map_or_else(|| panic!("the film could not be taken from its device"), |develop| develop())
        })
    }

    /// The film itself.
    pub fn into_film(self) -> Film {
        self.film();
        // it was asked for
        self.film.into_inner().expect("the film is there")
    }
}

impl From<Film> for LatentFilm {
    fn from(film: Film) -> Self {
        Self { film: OnceLock::from(film), develop: Mutex::new(None) }
    }
}

impl Deref for LatentFilm {
    type Target = Film;

    fn deref(&self) -> &Film {
        self.film()
    }
}

impl fmt::Debug for LatentFilm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LatentFilm").field("film", &self.film.get()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::AovSet;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn a_film_is_taken_once_and_only_when_it_is_asked_for() {
        let times = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&times);
        let film = Film::new([2, 1], false, AovSet::default());
        let latent = {
            let film = film.clone();
            LatentFilm::new(move || {
                counted.fetch_add(1, Ordering::Relaxed);
                film
            })
        };
        assert!(!latent.is_developed());
        assert_eq!(times.load(Ordering::Relaxed), 0);
        assert_eq!(*latent, film);
        assert!(latent.is_developed());
        assert_eq!(latent.into_film(), film);
        assert_eq!(times.load(Ordering::Relaxed), 1);
        assert!(LatentFilm::from(film).is_developed());
    }
}
