//! Filters of images.

mod clahe;
mod guided;
mod illumination;
mod image_filter;
mod mean;
mod median;

pub use clahe::Clahe;
pub use guided::Guided;
pub use illumination::{Illumination, Operation};
pub use image_filter::Filter;
pub use median::Median;
use seafix_component::{Registry, entry};

/// The registry of filters.
pub static FILTERS: Registry<dyn Filter> =
    Registry::new("filter", &[entry!(Clahe), entry!(Guided), entry!(Illumination), entry!(Median)]);
