//! Seeded simulation of dives over subsea structures: rendered images or noisy points, with exact truth.
//!
//! A [`Mission`] holds the settings of a dive: [site](scene), [water and lamps](optics), cameras, [vehicle],
//! [navigation sensors](sensors), changes since the survey, and device faults. [`Mission::plan`] builds the site and
//! simulates the vehicle's trajectory. Each [`Instant`] of the [`PlannedMission`] has a stamp and a prior pose; it
//! [renders](Instant::render) a stereo pair or measures [points](Instant::points) of the same view. Its
//! [truth](Instant::truth) is kept apart, for evaluation only.
//!
//! ```
//! use std::path::Path;
//!
//! use seafix_simulation::Mission;
//!
//! let mission = Mission { frames: 3, ..Mission::default() };
//! let planned = mission.plan(7, 0, Path::new(".")).expect("the default mission is valid");
//! let instant = planned.instant(0);
//! assert_eq!(planned.len(), 3);
//! assert!(instant.prior.is_some());
//! assert!(!instant.points().is_empty());
//! ```
//!
//! # Conventions
//!
//! - The world frame is north, east, down.
//! - The cameras look down: right in the image is starboard, the lower edge is aft.
//! - Pixel (0, 0) is the centre of the first pixel.
//! - Every random number is a function of seed, dive number, frame number and purpose ([`Stream`]), so the bytes do not
//!   depend on the order of the frames or on the number of threads.
//! - A factor of magnitude 0 gives the same bits as no factor (`tests/it/factors.rs`, `tests/it/settings.rs`).
//!
//! # Two scenes
//!
//! [`Dive`] (sources `virtual-images` and `virtual-points`) is the older and simpler scene: seven objects in even light
//! and clear water, independent views, no vehicle. Surfaces are flat and sampled exactly: once in a pixel that no edge
//! crosses, 34 times in the others. Its images are therefore easier than those of any sea. The scene remains as the
//! smallest case that a method must solve, and because stored reports and data sets depend on its bytes. Use a
//! [`Mission`] to study the effect of water, light, ports, motion or faults.
//!
//! Every run measures the disparity noise σ_d at its correctly identified feature points and reports it. The noise of
//! this scene is smaller than the paper's figures imply (0.2–0.35 px, with real textures). Corners of boxes are noisier
//! than painted corners, because the seabed behind them shifts between the views. The default of [`PointNoise`] lies in
//! the paper's range instead (σ_d = √2·0.2 px).

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
