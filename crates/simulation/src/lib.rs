//! Seeded dives over subsea structures: rendered images or noisy points, with exact truth.
//!
//! A [`Mission`] is the settings of a dive: [site](scene), [water and lamps](optics), cameras, [vehicle],
//! [navigation sensors](sensors), what has changed since the survey, and what fails. [`Mission::plan`] builds the site and
//! lets the vehicle go its way; each [`Instant`] of the [`PlannedMission`] has a stamp and a rough pose, [renders](Instant::render)
//! a stereo pair or gives [points](Instant::points) of the same view; its [truth](Instant::truth) is kept apart.
//!
//! Everything is a function of the seed, the number of the dive, the number of the frame and the
//! purpose ([`Stream`]): the same bytes in any order and on any number of threads. A factor of magnitude 0 is, bit for bit,
//! a factor left out (`tests/it/factors.rs`, `tests/it/settings.rs`).
//!
//! - World: north, east, down. The cameras look down; right in the image is starboard, its lower
//!   edge is aft.
//! - The centre of the first pixel is (0, 0).
//!
//! # Two scenes
//!
//! [`Dive`], behind the sources `virtual-images` and `virtual-points`, is the older and simpler scene: the same seven objects
//! in even light and clear water, each frame a view of its own, no vehicle. Surfaces are flat and drawn exactly (one sample for
//! a pixel that no edge crosses, 34 for the others), so its images are easier than any sea's. It stays as the smallest case a
//! method must solve, and because stored reports and data sets rest on its bytes; what water, light, ports, motion or faults do
//! is asked of a [`Mission`].
//!
//! Every run measures the noise of the disparity σ_d at its identified feature points and states it in
//! its report. In that scene it is smaller than what the paper's figures imply (0.2–0.35 px, with real textures). Corners of
//! boxes are worse than painted ones, since the bed behind them moves. [`PointNoise`] is set to the paper's range instead
//! (σ_d = √2·0.2 px).

mod blueprint;
mod dive;
pub mod families;
mod layout;
mod mission;
mod noise;
mod normals;
pub mod optics;
mod paint;
mod points;
mod raster;
mod render;
mod sand;
pub mod scene;
mod seabed;
mod sensor;
pub mod sensors;
mod stream;
mod survey;
pub mod vehicle;
mod virtual_render;
mod virtual_scene;

pub use blueprint::{Blueprint, BoxPlan, ChequerPlan, ObjectPlan, PanelPlan, PipePlan, PointPlan};
pub use dive::{BadDive, Dive, DiveFrame, FrameTruth, PlannedDive, SimulatedPrior, VirtualRig, VisiblePoint};
pub use layout::{Layout, Placed, Shape};
pub use mission::{
    CALIBRATION_RANGE, CalibrationError, FocalIn, Instant, InstantTruth, Mission, PlannedMission, PriorKind, RigPlan,
};
pub use points::PointNoise;
pub use render::{Exposure, Imager};
pub use sensor::Sensor;
pub use stream::{Purpose, Stream};
