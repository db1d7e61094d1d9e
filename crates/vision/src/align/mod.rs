//! Refinements of matched pixels.

mod covariance;
mod direct;
mod follow;
pub(crate) mod inverse_compositional;
mod lanes;
mod local;
mod refinement;
mod spline;
mod unrefined;
pub(crate) mod warp;
pub(crate) mod window;
mod zncc_parabola;

use seafix_component::{Choice, Component, Registry, entry};
use serde::Deserializer;

pub use direct::Direct;
pub use follow::Expected;
pub(crate) use inverse_compositional::Aligner;
pub use refinement::{Refinement, Unaligned};
pub use unrefined::Unrefined;
pub use warp::Warp;
pub use window::Weight;
pub use zncc_parabola::ZnccParabola;

/// The registry of refinements.
pub static REFINEMENTS: Registry<dyn Refinement> =
    Registry::new("refinement", &[entry!(Direct), entry!(Unrefined), entry!(ZnccParabola)]);

/// Deserialises the choice of a refinement; settings without a name are those of `direct`.
///
/// # Errors
/// A value that is neither a name nor a table.
pub fn read_refinement<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Choice, D::Error> {
    Choice::deserialize_or(deserializer, Direct::NAME)
}
