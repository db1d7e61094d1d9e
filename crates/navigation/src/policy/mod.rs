//! When to take the next fix.

mod every_frame;
mod in_view;
mod interval;
mod protection_level;
mod travelled;

use seafix_component::{Registry, entry};

pub use every_frame::EveryFrame;
pub use in_view::InView;
pub use interval::Interval;
pub use protection_level::ProtectionLevel;
pub use travelled::Travelled;

/// What a policy decides by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Situation {
    /// Time since the last fix that was taken (s); infinite before the first.
    pub seconds: f64,
    /// Way since then (m); infinite before the first.
    pub metres: f64,
    /// Standard deviation of the camera's position along its worst axis (m); infinite before the first.
    pub sigma: f64,
    /// Whether the navigated or the rough pose puts an object in view.
    pub in_view: bool,
}

/// Decides when a fix is tried. A fix costs a search; without one the error grows.
pub trait Policy: Send + Sync + std::fmt::Debug {
    /// Whether to try now.
    fn due(&self, situation: &Situation) -> bool;
}

/// All policies.
pub static POLICIES: Registry<dyn Policy> = Registry::new(
    "policy",
    &[entry!(EveryFrame), entry!(InView), entry!(Interval), entry!(ProtectionLevel), entry!(Travelled)],
);
