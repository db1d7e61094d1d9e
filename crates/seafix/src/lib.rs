//! Position and attitude of an underwater vehicle relative to a known structure, from stereo images.
//!
//! A [`Localizer`] computes *fixes*. It triangulates a cloud of 3D points from a stereo pair, identifies in it the
//! feature points of an object of a [`Site`] by structural coherence (agreement of distances), and solves the rigid
//! transform `object_from_camera` (Bobkov, Kudryashov and Inzartsev, *J. Mar. Sci. Eng.* 2021, 9, 1038). A
//! [`NavigationSession`] moves the last fix from frame to frame by odometry and takes the next one when it is due.
//!
//! ```
//! use seafix::{Localizer, Outcome, PosePrior, Rig, Site, StereoImages, geometry::Transform};
//!
//! # fn main() -> Result<(), seafix::Error> {
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
//! # let path = |name: &str| format!("{folder}/{name}");
//! # let attitude = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(-0.31943, -0.10266, -0.03577, 0.94135));
//! # let world_from_camera = Transform::new(attitude, nalgebra::Vector3::new(-23.459, -5.727, 36.558));
//! let rig = Rig::from_file(path("dataset.toml"))?;
//! let site = Site::from_file(path("site.toml"))?;
//! let images = StereoImages::open(path("left000.png"), path("right000.png"), &rig)?;
//! let prior = PosePrior::isotropic(world_from_camera, 0.5_f64.to_radians(), 0.1); // rad, m
//!
//! let localizer = Localizer::new(&site, &rig)?;
//! for target in localizer.localize(&images, &prior)? {
//!     match target.outcome {
//!         Outcome::Fix(fix) => println!("{}: ± {:.1} mm", target.name, 1e3 * fix.position_sigma()),
//!         rejected => println!("{}: {rejected}", target.name),
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! A fix holds the pose, its covariance and its integrity. An image pair without a fix is no error: its [`Outcome`]
//! states the reason and the remedy.
//!
//! Every stage is a component chosen by name ([`Localizer::from_toml`]); search, solver, detector, descriptor and matcher
//! may be trait objects ([`Localizer::with_solver`]). This crate reads images, rigs and sites. It does not depend on logs, simulation or
//! ground truth.
//!
//! Units are metres, radians, nanoseconds and pixels. `a_from_b` maps column vectors: `p_a = a_from_b · p_b`.
//!
//! The terms are those of the field; `GLOSSARY.md` at the root of the repository defines each with its literature.

mod choices;
mod error;
mod event;
mod frame_result;
mod images;
mod in_view;
mod joint;
mod keyframe_mapper;
mod localizer;
mod navigation_stack;
mod odometry_session;
mod pipeline;
mod pipeline_error;
mod pipeline_settings;
mod places;
mod random;
mod sensor_frame;
mod session;
mod times;

pub use nalgebra;
pub use seafix_component as component;
pub use seafix_geometry as geometry;
pub use seafix_navigation as navigation;
pub use seafix_referencing as referencing;
pub use seafix_vision as vision;

pub use choices::REGISTRIES;
pub use error::Error;
pub use event::NavigationEvent;
pub use frame_result::{Cloud, FrameResult, SearchResult, TargetAttempt, View};
pub use images::StereoImages;
pub use keyframe_mapper::{KeyframeMapper, KeyframeSettings};
pub use localizer::{Localizer, TargetOutcome};
pub use navigation_stack::{Navigation, NavigationStack};
pub use odometry_session::{FrameOdometry, OdometryResult, stereo_pair};
pub use pipeline::Pipeline;
pub use pipeline_error::{PipelineError, build, invalid_setting};
pub use pipeline_settings::{Attempts, PipelineSettings, UseOfEdges, UseOfPoints};
pub use places::places;
pub use seafix_io::Rig;
pub use seafix_referencing::{Outcome, Site};
pub use sensor_frame::{FrameData, Hints, PosePrior, SensorFrame};
pub use session::{Motion, MotionOverride, NavigationSession, NavigationState};
pub use times::{FrameTimes, TargetTimes};
