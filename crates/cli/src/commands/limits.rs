//! Limits of the size of an image.

use clap::Args;
use seafix_io::ImageLimits;

/// Limits of images, compared with the declared size before any allocation.
#[derive(Debug, Args)]
pub(crate) struct Limits {
    /// Maximum number of pixels of an image.
    #[arg(long, value_name = "PIXELS", default_value_t = ImageLimits::default().pixels)]
    max_pixels: u64,
    /// Maximum memory of an image decoder, and maximum size of an image file (bytes).
    #[arg(long, value_name = "BYTES", default_value_t = ImageLimits::default().bytes)]
    max_bytes: u64,
}

impl Limits {
    pub(crate) fn of_images(&self) -> ImageLimits {
        ImageLimits { pixels: self.max_pixels, bytes: self.max_bytes }
    }
}
