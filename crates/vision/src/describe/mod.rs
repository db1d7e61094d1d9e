//! Descriptors: what the surroundings of a key point look like.

mod brief;
mod cells;
mod comparisons;
mod gradients;
mod halves;
mod orb;
mod sample;
mod sector;
mod sift;
mod surf;
mod zncc_patch;

pub use brief::Brief;
pub use orb::Orb;
use seafix_component::{Registry, entry};
pub use sift::Sift;
pub use surf::Surf;
pub use zncc_patch::ZnccPatch;

use crate::{Image, Keypoint, Workspace};

/// One descriptor a key point, all of one kind and length: numbers, compared by their Euclidean
/// distance, or bits, compared by how many differ (Hamming).
#[derive(Debug, Clone, PartialEq)]
pub enum Descriptors {
    /// Vectors of so many numbers each.
    Numbers(Table<f32>),
    /// Strings of so many words of 64 bits each.
    Bits(Table<u64>),
}

/// Rows of equal length, one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Table<T> {
    length: usize,
    values: Vec<T>,
}

impl<T> Default for Table<T> {
    fn default() -> Self {
        Self { length: 1, values: Vec::new() }
    }
}

impl<T: Copy + Default> Table<T> {
    /// Rows of `length` values each.
    ///
    /// # Panics
    /// When the values do not fill whole rows.
    pub fn new(length: usize, values: Vec<T>) -> Self {
        assert!(length > 0 && values.len().is_multiple_of(length), "rows of {length} do not fill {}", values.len());
        Self { length, values }
    }

    /// Makes it `rows` rows of `length` values, keeping its memory; what they hold is not said.
    pub fn reset(&mut self, rows: usize, length: usize) -> &mut [T] {
        assert!(length > 0, "a row has a value");
        self.length = length;
        self.values.resize(rows * length, T::default());
        &mut self.values
    }

    /// Values in a row.
    pub fn length(&self) -> usize {
        self.length
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.values.len() / self.length
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Row `index`.
    pub fn row(&self, index: usize) -> &[T] {
        &self.values[index * self.length..][..self.length]
    }

    /// All values, row by row.
    pub fn values(&self) -> &[T] {
        &self.values
    }
}

impl Default for Descriptors {
    fn default() -> Self {
        Self::Numbers(Table::default())
    }
}

impl Descriptors {
    /// Makes them `count` vectors of `length` numbers, keeping the memory; what they hold is not said.
    pub fn numbers_mut(&mut self, count: usize, length: usize) -> &mut [f32] {
        if let Self::Bits(_) = self {
            *self = Self::default();
        }
        match self {
            Self::Numbers(table) => table.reset(count, length),
            Self::Bits(_) => unreachable!("made numbers above"),
        }
    }

    /// Makes them `count` strings of `words` words, keeping the memory; what they hold is not said.
    pub fn bits_mut(&mut self, count: usize, words: usize) -> &mut [u64] {
        if let Self::Numbers(_) = self {
            *self = Self::Bits(Table::default());
        }
        match self {
            Self::Bits(table) => table.reset(count, words),
            Self::Numbers(_) => unreachable!("made bits above"),
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(table) => table.len(),
            Self::Bits(table) => table.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The numbers; `None` where they are bits.
    pub fn numbers(&self) -> Option<&Table<f32>> {
        match self {
            Self::Numbers(table) => Some(table),
            Self::Bits(_) => None,
        }
    }

    /// The bits; `None` where they are numbers.
    pub fn bits(&self) -> Option<&Table<u64>> {
        match self {
            Self::Bits(table) => Some(table),
            Self::Numbers(_) => None,
        }
    }
}

/// Describes the surroundings of key points.
pub trait Descriptor: Send + Sync + std::fmt::Debug {
    /// Replaces `described` by one descriptor for each key point, in their order.
    fn describe_into(&self, image: &Image, keypoints: &[Keypoint], work: &mut Workspace, described: &mut Descriptors);

    /// One descriptor for each key point of one image, in their order.
    fn describe(&self, image: &Image, keypoints: &[Keypoint]) -> Descriptors {
        let mut described = Descriptors::default();
        self.describe_into(image, keypoints, &mut Workspace::default(), &mut described);
        described
    }
}

/// All descriptors.
pub static DESCRIPTORS: Registry<dyn Descriptor> =
    Registry::new("descriptor", &[entry!(Brief), entry!(Orb), entry!(Sift), entry!(Surf), entry!(ZnccPatch)]);
