//! Pixels in memory of their own, or in that of the device that wrote them.

use bytemuck::Pod;
use std::fmt;
use std::ops::{Deref, DerefMut};

/// A picture's pixels, rows from the top. They may lie where their device wrote them, and are then copied only when they are
/// changed or cloned; their memory is the device's again when they are dropped.
pub struct Pixels<T>(Place<T>);

enum Place<T> {
    Own(Vec<T>),
    Lent(Box<dyn AsRef<[u8]> + Send + Sync>),
}

impl<T: Pod> Pixels<T> {
    /// Pixels in somebody else's memory, whose bytes must be whole pixels and aligned.
    pub fn lent(bytes: impl AsRef<[u8]> + Send + Sync + 'static) -> Self {
        Self(Place::Lent(Box::new(bytes)))
    }
}

impl<T> From<Vec<T>> for Pixels<T> {
    fn from(pixels: Vec<T>) -> Self {
        Self(Place::Own(pixels))
    }
}

impl<T> Default for Pixels<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T: Pod> Deref for Pixels<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.0 {
            Place::Own(pixels) => pixels,
            Place::Lent(bytes) => bytemuck::cast_slice((**bytes).as_ref()),
        }
    }
}

impl<T: Pod> DerefMut for Pixels<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        if let Place::Lent(_) = self.0 {
            *self = self.clone();
        }
        match &mut self.0 {
            Place::Own(pixels) => pixels,
            Place::Lent(_) => unreachable!("a clone has memory of its own"),
        }
    }
}

impl<T: Pod> Clone for Pixels<T> {
    fn clone(&self) -> Self {
        self.to_vec().into()
    }
}

impl<T: Pod + PartialEq> PartialEq for Pixels<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: Pod + fmt::Debug> fmt::Debug for Pixels<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// Two pixels, and whether they were given back.
    struct Two([f32; 2], Arc<AtomicBool>);

    impl AsRef<[u8]> for Two {
        fn as_ref(&self) -> &[u8] {
            bytemuck::cast_slice(&self.0)
        }
    }

    impl Drop for Two {
        fn drop(&mut self) {
            self.1.store(true, Ordering::Relaxed);
        }
    }

    #[test]
    fn lent_pixels_are_given_back_once_they_are_changed_or_dropped() {
        for is_changed in [false, true] {
            let is_back = Arc::new(AtomicBool::new(false));
            let mut pixels = Pixels::<f32>::lent(Two([1.0, 2.0], Arc::clone(&is_back)));
            assert_eq!(*pixels, [1.0, 2.0]);
            assert_eq!(pixels.clone(), Pixels::from(vec![1.0, 2.0]));
            assert!(!is_back.load(Ordering::Relaxed));
            if is_changed {
                pixels[0] = 3.0;
                assert_eq!(*pixels, [3.0, 2.0]);
            } else {
                drop(pixels);
            }
            assert!(is_back.load(Ordering::Relaxed));
        }
    }
}
