//! Simulated and recorded sequences of stereo pairs or clouds.
//!
//! A [`Source`](source::Source) gives the frames of an experiment: a data set's folder, a ROS 2 recording, a log, a
//! simulated dive or drawn problems. A [`Trajectory`](trajectory::Trajectory) is read from a TUM, KITTI or EuRoC file,
//! whose format is recognised by its content, and written in any of them.
//!
//! ```
//! use seafix_data::trajectory::{Format, Trajectory};
//!
//! # fn main() -> Result<(), seafix_component::Fault> {
//! let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample/truth.tum");
//! let truth = Trajectory::read(file.as_ref())?; // world_from_camera, stamps in ns
//! let kitti = truth.print(Format::Kitti); // twelve numbers a pose, no stamp
//! assert_eq!(kitti.lines().count(), truth.poses.len());
//! # Ok(())
//! # }
//! ```

mod contradictions;
pub mod dataset;
pub mod fixes;
mod formats;
pub mod log_conversion;
mod model;
mod ports;
mod ros;
mod sensor_buffer;
mod sequence;
pub mod source;
mod stereo_pairs;
pub mod trajectory;

pub use contradictions::trajectory_fault;
pub use stereo_pairs::StereoPairs;

pub use model::{
    CalibrationSigma, DiveEdge, DiveMark, DiveModel, DivePoint, HandModel, HandPoint, Mark, ModelByHand, ModelFromDive,
    Picture, Proposal, Proposer, SimulatedOperator,
};
