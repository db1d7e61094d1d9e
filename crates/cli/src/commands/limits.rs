//! How large an image a command reads.

use clap::Args;
use seafix_io::ImageLimits;

/// Nothing of the declared size is made before it is compared with these.
#[derive(Debug, Args)]
pub(crate) struct Limits {
    /// The most pixels that an image may declare.
    #[arg(long, value_name = "PIXELS", default_value_t = ImageLimits::default().pixels)]
    max_pixels: u64,
    /// The most memory that an image's decoder may take, and the largest image file (bytes).
    #[arg(long, value_name = "BYTES", default_value_t = ImageLimits::default().bytes)]
    max_bytes: u64,
}

impl Limits {
    pub(crate) fn of_images(&self) -> ImageLimits {
        ImageLimits { pixels: self.max_pixels, bytes: self.max_bytes }
    }
}
