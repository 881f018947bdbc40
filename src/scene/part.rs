//! Parts: immutable, shared values named by a 128-bit hash of their content (XXH3).

use std::any::Any;
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;
use xxhash_rust::xxh3::Xxh3;

/// The name of a part: a hash of its kind and content. Names that files give to things never enter it.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PartHash(pub u128);

impl fmt::Display for PartHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl fmt::Debug for PartHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08x}…", (self.0 >> 96) as u32)
    }
}

/// Collects content for a [`PartHash`]. Every write has a fixed width or is preceded by its length.
#[derive(Clone)]
pub struct PartHasher(Xxh3);

impl PartHasher {
    /// Starts a hash of the given kind of content, so that equal bytes of different kinds differ.
    pub fn new(kind: &str) -> Self {
        let mut h = Self(Xxh3::new());
        h.bytes(kind.as_bytes());
        h
    }

    /// Adds bytes, preceded by their number.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    /// Adds an integer.
    pub fn u64(&mut self, x: u64) {
        self.0.update(&x.to_le_bytes());
    }

    /// Adds a float by its bits; −0 and 0 differ.
    pub fn f32(&mut self, x: f32) {
        self.0.update(&x.to_bits().to_le_bytes());
    }

    /// Adds a float by its bits; −0 and 0 differ.
    pub fn f64(&mut self, x: f64) {
        self.0.update(&x.to_bits().to_le_bytes());
    }

    /// Adds another part's name.
    pub fn part(&mut self, hash: PartHash) {
        self.0.update(&hash.0.to_le_bytes());
    }

    /// Adds plain values in memory order, preceded by their number of bytes.
    pub fn slice<T: bytemuck::NoUninit>(&mut self, values: &[T]) {
        self.bytes(bytemuck::cast_slice(values));
    }

    /// The name.
    pub fn finish(&self) -> PartHash {
        PartHash(self.0.digest128())
    }
}

/// What can be a part.
pub trait Content {
    /// The kind, a word that enters the hash.
    const KIND: &'static str;

    /// Adds the whole content.
    fn hash_into(&self, hasher: &mut PartHasher);

    /// Bytes that the content takes in memory.
    fn bytes(&self) -> u64;
}

struct Named<T> {
    hash: PartHash,
    value: T,
}

/// An immutable, shared value with the hash of its content for a name. Cloning shares.
pub struct Part<T>(Arc<Named<T>>);

impl<T: Content> Part<T> {
    /// Names a value by its content.
    pub fn new(value: T) -> Self {
        let mut h = PartHasher::new(T::KIND);
        value.hash_into(&mut h);
        Self(Arc::new(Named { hash: h.finish(), value }))
    }

    /// The name.
    pub fn hash(&self) -> PartHash {
        self.0.hash
    }

    /// Bytes that the content takes in memory.
    pub fn bytes(&self) -> u64 {
        self.0.value.bytes()
    }
}

/// A part of whatever content, for those who only keep it.
pub type SharedPart = Arc<dyn Any + Send + Sync>;

impl<T: Send + Sync + 'static> Part<T> {
    /// The part without its kind.
    pub fn shared(&self) -> SharedPart {
        self.0.clone()
    }
}

impl<T> Clone for Part<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Deref for Part<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0.value
    }
}

impl<T> PartialEq for Part<T> {
    fn eq(&self, other: &Self) -> bool {
        self.0.hash == other.0.hash
    }
}

impl<T: fmt::Debug> fmt::Debug for Part<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Part({:?}, {:?})", self.0.hash, self.0.value)
    }
}
