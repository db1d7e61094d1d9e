//! Seeded dives over a virtual production system: rendered images or noisy points, with truth.
//!
//! A [`Dive`] is the settings; [`Dive::plan`] draws the site and its survey from a seed; each
//! [`DiveFrame`] of the [`PlannedDive`] is a view of one object, with a stamp and a rough pose. It
//! [renders](DiveFrame::render) a stereo pair or gives [points](DiveFrame::points); its
//! [truth](DiveFrame::truth) is kept apart.
//!
//! Everything is a function of the seed, the number of the dive, the number of the frame and the
//! purpose ([`Stream`]): the same bytes in any order and on any number of threads.
//!
//! - World: north, east, down. The cameras look down; right in the image is starboard, its lower
//!   edge is aft.
//! - The centre of the first pixel is (0, 0).
//! - Surfaces are flat and drawn exactly: one sample for a pixel that no edge crosses, 34 for the
//!   others; textures are closed forms that fade out below two pixels.
//! - Light is fixed, water is clear: no attenuation, no lamps, no shadows.
//!
//! # How well the images can be measured
//!
//! Every run measures the noise of the disparity σ_d at its identified feature points and states it in
//! its report. It is smaller than what the paper's figures imply (0.2–0.35 px, with real textures): the
//! water is clear and the paint is sharp. Corners of boxes are worse than painted ones, since the bed
//! behind them moves. [`PointNoise`] is set to the paper's range instead (σ_d = √2·0.2 px).

mod bed;
mod blueprint;
mod dive;
mod draw;
pub mod families;
pub mod field;
mod layout;
mod mission;
mod noise;
pub mod optics;
mod paint;
mod points;
mod raster;
mod render;
mod scene;
mod sensor;
pub mod sensors;
mod stream;
mod survey;
pub mod vehicle;

pub use blueprint::{Blueprint, BoxPlan, ChequerPlan, ObjectPlan, PanelPlan, PipePlan, PointPlan};
pub use dive::{BadDive, Dive, DiveFrame, FrameTruth, PlannedDive, RoughPose, VirtualRig, VisiblePoint};
pub use draw::{Exposure, Imager};
pub use layout::{Layout, Placed, Shape};
pub use mission::{
    CALIBRATION_RANGE, CalibrationError, FocalIn, Instant, InstantTruth, Mission, PlannedMission, PriorKind, RigPlan,
};
pub use points::PointNoise;
pub use sensor::Sensor;
pub use stream::{Purpose, Stream};
