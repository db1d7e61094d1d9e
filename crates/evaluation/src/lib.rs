//! Errors of poses and trajectories, bounds, and statistics: pure functions of estimates and ground truth.
//!
//! - One fix: [`residual_rms`], [`transfer_rms`], [`position_error`], [`attitude_error`], [`nees`]; its lower bound by
//!   [`cramer_rao`].
//! - Object pose benchmarks: ADD, ADI, MSSD and MSPD by [`mean_distance`], [`mean_nearest_distance`],
//!   [`symmetric_distance`], [`symmetric_projection_distance`].
//! - Object models: aligned differences, scale and χ² by [`compare_models`].
//! - Trajectories: APE, RPE and drift in [`trajectory`].
//! - Statistics: quantiles, confidence intervals ([`Bootstrap`], [`clopper_pearson`]) and tests ([`signed_rank`],
//!   [`mcnemar`]).
//!
//! No function depends on the algorithm that made an estimate.
//!
//! ```
//! use seafix_evaluation::{attitude_error, position_error, transfer_rms};
//! use seafix_geometry::{Camera, Object, Point, Transform};
//!
//! let truth = Transform::<Object, Camera>::identity();
//! let estimate = Transform::<Object, Camera>::exp(&[0.0, 0.0, 0.0, 0.03, 0.0, 0.04].into());
//! let model = [Point::new(0.0, 0.0, 0.0), Point::new(1.0, 0.0, 0.0)];
//!
//! assert!((position_error(&estimate, &truth) - 0.05).abs() < 1e-12);
//! assert!(attitude_error(&estimate, &truth) < 1e-12);
//! assert!((transfer_rms(&estimate, &truth, &model).unwrap() - 0.05).abs() < 1e-12);
//! ```

mod bound;
mod fix;
mod model;
mod solved;
mod statistics;
mod surface;
pub mod trajectory;

pub use bound::{Seen, cramer_rao, nonlinearity, transfer_bound};
pub use fix::{alert_limit, attitude_error, lever_arm_error, nees, position_error, residual_rms, transfer_rms};
pub use model::{ModelDifference, compare_models};
pub use solved::Solved;
pub use statistics::{
    Bootstrap, Difference, SignedRank, block_length, clopper_pearson, clustered, holm, mcnemar, median, of_blocks,
    quantile, recall_area, signed_rank,
};
pub use surface::{mean_distance, mean_nearest_distance, symmetric_distance, symmetric_projection_distance};
