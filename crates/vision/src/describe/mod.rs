//! Descriptors of key points.

mod brief;
mod cells;
mod comparisons;
mod descriptor;
mod gradients;
mod halves;
mod orb;
mod sample;
mod sector;
mod sift;
mod surf;
mod zncc_patch;

pub use brief::Brief;
pub use descriptor::{Descriptor, Descriptors, Table};
pub use orb::Orb;
pub(crate) use sample::bilinear;
use seafix_component::{Registry, entry};
pub use sift::Sift;
pub use surf::Surf;
pub use zncc_patch::ZnccPatch;

/// The registry of descriptors.
pub static DESCRIPTORS: Registry<dyn Descriptor> =
    Registry::new("descriptor", &[entry!(Brief), entry!(Orb), entry!(Sift), entry!(Surf), entry!(ZnccPatch)]);
