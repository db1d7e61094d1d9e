//! Descriptors: what the surroundings of a key point look like.

mod integral;
mod surf;

use seafix_component::{Registry, entry};
pub use surf::Surf;

use crate::{Image, Keypoint};

/// One vector a key point, all of one length.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Descriptors {
    length: usize,
    values: Vec<f32>,
}

impl Descriptors {
    /// Descriptors of `length` numbers each, one after the other.
    pub fn new(length: usize, values: Vec<f32>) -> Self {
        assert!(
            length > 0 && values.len().is_multiple_of(length),
            "descriptors of {length} do not fill {}",
            values.len()
        );
        Self { length, values }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.values.len().checked_div(self.length).unwrap_or(0)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The descriptor of key point `index`.
    pub fn get(&self, index: usize) -> &[f32] {
        &self.values[index * self.length..(index + 1) * self.length]
    }
}

/// Describes the surroundings of key points.
pub trait Descriptor: Send + Sync + std::fmt::Debug {
    /// One descriptor for each key point, in their order.
    fn describe(&self, image: &Image, keypoints: &[Keypoint]) -> Descriptors;
}

/// All descriptors.
pub static DESCRIPTORS: Registry<dyn Descriptor> = Registry::new("descriptor", &[entry!(Surf)]);
