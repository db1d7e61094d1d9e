//! Fusion of a new fix with the navigated pose.

mod fuse;
mod intersect;
mod join;
mod replace;
mod rule;

use seafix_component::{Registry, entry};

pub use fuse::Fuse;
pub use intersect::Intersect;
pub(crate) use join::gate;
pub use replace::Replace;
pub use rule::{Contradiction, Fusion};

/// All fusions.
pub static FUSIONS: Registry<dyn Fusion> = Registry::new("fusion", &[entry!(Fuse), entry!(Intersect), entry!(Replace)]);
