//! Position and attitude of an underwater vehicle relative to a known structure, from stereo images.

mod error;
mod event;
mod explore;
mod images;
mod joint;
mod localizer;
mod navigation;
mod odometry_session;
mod pipeline;
mod random;
mod sensor_frame;
mod session;
mod stages;
mod times;

pub use error::Error;
pub use event::NavigationEvent;
pub use explore::{Explorer, Keyframes};
pub use images::StereoImages;
pub use localizer::{Localizer, PosePrior, TargetOutcome};
pub use navigation::{Helm, Navigation};
pub use odometry_session::{OdometryResult, OdometrySession, stereo_pair};
pub use pipeline::{Pipeline, PipelineError, build, faults, misfit, resolve};
pub use seafix_io::Rig;
pub use seafix_referencing::{Outcome, Site};
pub use sensor_frame::{Eyes, Sight, Told, WorldPrior};
pub use session::{Motion, MotionFilter, THE_WAY_IS_UNKNOWN, Underway, Voyage, places};
pub use stages::{Attempt, Cloud, Sighting, Sought, Stages, View};
pub use times::{FrameTimes, TargetTimes};
