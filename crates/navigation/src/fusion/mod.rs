//! What becomes of the navigated pose when a fix comes.

mod fuse;
mod intersect;
mod join;
mod replace;

use seafix_component::{Registry, entry};

use crate::ObjectPose;

pub use fuse::Fuse;
pub use intersect::Intersect;
pub(crate) use join::gate;
pub use replace::Replace;

/// A fix that contradicts what was known.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("normalised innovation squared {nis:.1}; at most {limit:.1}")]
pub struct Contradiction {
    /// The normalised innovation squared, six degrees of freedom.
    pub nis: f64,
    /// What it may be.
    pub limit: f64,
}

/// Joins what was known with a fix of the same object.
pub trait Fusion: Send + Sync + std::fmt::Debug {
    /// The pose after a fix, `known` being the pose before it, relative to the same object.
    ///
    /// # Errors
    /// [`Contradiction`] when the fix is not to be believed.
    fn take(&self, known: &ObjectPose, fix: &ObjectPose) -> Result<ObjectPose, Contradiction>;

    /// Whether the pose passes to another object: `there` is what would be known relative to it, `here` what is known
    /// relative to the object of the last fix. The object ahead is the one that counts, but a glimpse of it at the edge of
    /// the image is a fix far worse than the pose carried here.
    fn passes(&self, here: &ObjectPose, there: &ObjectPose) -> bool {
        /// So many times less certain is far worse.
        const POOR: f64 = 2.0;
        there.covariance.position_sigma() <= POOR * here.covariance.position_sigma()
    }
}

/// All fusions.
pub static FUSIONS: Registry<dyn Fusion> = Registry::new("fusion", &[entry!(Fuse), entry!(Intersect), entry!(Replace)]);
