//! What a reader of calibrations is given and what it finds.

use crate::dataset::RigNumbers;

/// What a calibration file may leave open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Given {
    /// Width and height of the images (px), where the file does not state them.
    pub size: Option<[u32; 2]>,
    /// The unit of the file's lengths (m).
    pub unit: f64,
}

impl Default for Given {
    fn default() -> Self {
        Self { size: None, unit: 1.0 }
    }
}

/// The content of a calibration, before it is checked.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) numbers: RigNumbers,
    pub(super) format: &'static str,
    pub(super) notes: Vec<String>,
}

impl Found {
    pub(super) fn new(format: &'static str, numbers: RigNumbers) -> Self {
        Self { numbers, format, notes: Vec::new() }
    }
}
