//! The samples of a decoded image.

use std::path::Path;

use seafix_component::Fault;

/// The samples of an image, as stored in its file.
#[derive(Debug)]
pub(super) struct Samples {
    /// The samples row by row, with the channels of a pixel together.
    pub(super) values: Vec<u16>,
    /// The number of channels: 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha.
    pub(super) channels: usize,
    /// Whether a sample has 16 bits rather than 8.
    pub(super) deep: bool,
    /// The value of white, if the file states it.
    pub(super) white: Option<u16>,
}

/// The remedy for a file of no known format.
pub(super) const READ: &str = "give PNG, JPEG, TIFF or PNM, grey or colour, 8 or 16 bits";

/// The fault of a file that is no image.
pub(super) fn damaged(path: &Path, cause: String) -> Fault {
    Fault::new("an image that cannot be decoded", path).value(cause).remedy(READ)
}
