//! Filters of images.

mod clahe;
mod guided;
mod illumination;
mod mean;
mod median;

pub use clahe::Clahe;
pub use guided::Guided;
pub use illumination::{Illumination, Operation};
pub use median::Median;
use seafix_component::{Registry, entry};

use crate::{Image, Workspace};

/// A filter: prepares an image, for example by shading correction or noise reduction.
///
/// An image within 0 to 255 stays within that range. A finite image gives a finite one.
pub trait Filter: Send + Sync + std::fmt::Debug {
    /// Filters the image in place.
    fn apply(&self, image: &mut Image, work: &mut Workspace);

    /// A filtered copy of the image.
    fn filtered(&self, image: &Image) -> Image {
        let mut copy = image.clone();
        self.apply(&mut copy, &mut Workspace::default());
        copy
    }
}

/// All filters.
pub static FILTERS: Registry<dyn Filter> =
    Registry::new("filter", &[entry!(Clahe), entry!(Guided), entry!(Illumination), entry!(Median)]);
