//! Re-referencing policies: when to try the next fix.

mod every_frame;
mod in_view;
mod interval;
mod protection_level;
mod situation;
mod travelled;

use seafix_component::{Registry, entry};

pub use every_frame::EveryFrame;
pub use in_view::InView;
pub use interval::Interval;
pub use protection_level::ProtectionLevel;
pub use situation::{Policy, Situation};
pub use travelled::Travelled;

/// All policies.
pub static POLICIES: Registry<dyn Policy> = Registry::new(
    "policy",
    &[entry!(EveryFrame), entry!(InView), entry!(Interval), entry!(ProtectionLevel), entry!(Travelled)],
);
