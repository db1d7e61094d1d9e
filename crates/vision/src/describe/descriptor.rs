//! Descriptors of key points.

use crate::{detect::Keypoint, image::Image, workspace::Workspace};

/// Descriptors of one kind and length, one for each key point.
///
/// Numbers are compared by their Euclidean distance, bits by their Hamming distance.
#[derive(Debug, Clone, PartialEq)]
pub enum Descriptors {
    /// Vectors of numbers.
    Numbers(Table<f32>),
    /// Bit strings in words of 64 bits.
    Bits(Table<u64>),
}

/// A table of rows of equal length.
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
    /// A table with rows of `length` values each.
    ///
    /// # Panics
    /// If the values do not fill complete rows.
    pub fn new(length: usize, values: Vec<T>) -> Self {
        assert!(length > 0 && values.len().is_multiple_of(length), "rows of {length} do not fill {}", values.len());
        Self { length, values }
    }

    /// Resizes the table to `rows` rows of `length` values and reuses its memory; the contents are unspecified.
    pub fn reset(&mut self, rows: usize, length: usize) -> &mut [T] {
        assert!(length > 0, "a row without values");
        self.length = length;
        self.values.resize(rows * length, T::default());
        &mut self.values
    }

    /// The length of a row.
    pub fn length(&self) -> usize {
        self.length
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.values.len() / self.length
    }

    /// Whether the table is empty.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The row `index`.
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
    /// Resizes to `count` vectors of `length` numbers and reuses the memory; the contents are unspecified.
    pub fn numbers_mut(&mut self, count: usize, length: usize) -> &mut [f32] {
        if let Self::Bits(_) = self {
            *self = Self::default();
        }
        match self {
            Self::Numbers(table) => table.reset(count, length),
            Self::Bits(_) => unreachable!("numbers were set above"),
        }
    }

    /// Resizes to `count` strings of `words` words and reuses the memory; the contents are unspecified.
    pub fn bits_mut(&mut self, count: usize, words: usize) -> &mut [u64] {
        if let Self::Numbers(_) = self {
            *self = Self::Bits(Table::default());
        }
        match self {
            Self::Bits(table) => table.reset(count, words),
            Self::Numbers(_) => unreachable!("bits were set above"),
        }
    }

    /// The number of descriptors.
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(table) => table.len(),
            Self::Bits(table) => table.len(),
        }
    }

    /// Whether there are no descriptors.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The vectors; `None` for bits.
    pub fn numbers(&self) -> Option<&Table<f32>> {
        match self {
            Self::Numbers(table) => Some(table),
            Self::Bits(_) => None,
        }
    }

    /// The bit strings; `None` for numbers.
    pub fn bits(&self) -> Option<&Table<u64>> {
        match self {
            Self::Bits(table) => Some(table),
            Self::Numbers(_) => None,
        }
    }
}

/// A descriptor: describes the surroundings of key points.
///
/// ```
/// use seafix_geometry::Pixel;
/// use seafix_vision::{Descriptor, Descriptors, Image, Keypoint, Workspace};
///
/// /// The grey level of the nearest pixel, for key points inside the image.
/// #[derive(Debug)]
/// struct Grey;
///
/// impl Descriptor for Grey {
///     fn describe_into(&self, image: &Image, keypoints: &[Keypoint], _: &mut Workspace, described: &mut Descriptors) {
///         let numbers = described.numbers_mut(keypoints.len(), 1);
///         for (number, keypoint) in numbers.iter_mut().zip(keypoints) {
///             *number = image.row(keypoint.at.v.round() as usize)[keypoint.at.u.round() as usize];
///         }
///     }
/// }
///
/// let image = Image::new(2, 1, vec![10.0, 20.0]).unwrap();
/// let keypoint = Keypoint { at: Pixel { u: 1.0, v: 0.0 }, response: 1.0, scale: 1.0 };
/// assert_eq!(Grey.describe(&image, &[keypoint]).numbers().unwrap().row(0), [20.0]);
/// ```
pub trait Descriptor: Send + Sync + std::fmt::Debug {
    /// Replaces `described` by one descriptor for each key point, in their order.
    fn describe_into(&self, image: &Image, keypoints: &[Keypoint], work: &mut Workspace, described: &mut Descriptors);

    /// The descriptors of the key points, in their order.
    fn describe(&self, image: &Image, keypoints: &[Keypoint]) -> Descriptors {
        let mut described = Descriptors::default();
        self.describe_into(image, keypoints, &mut Workspace::default(), &mut described);
        described
    }
}
