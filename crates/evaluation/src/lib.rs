//! Errors of poses and trajectories, rates of outcomes: pure functions of estimates and truth.
//!
//! Nothing here can see which algorithm made a number.

mod bound;
mod fix;
mod solved;
mod statistics;
mod surface;
pub mod trajectory;

pub use bound::{Seen, cramer_rao, nonlinearity, transfer_bound};
pub use fix::{alert_limit, attitude_error, lever_arm_error, nees, position_error, residual_rms, transfer_rms};
pub use solved::Solved;
pub use statistics::{
    Bootstrap, SignedRank, clopper_pearson, clustered, holm, mcnemar, median, of_blocks, quantile, recall_area,
    signed_rank,
};
pub use surface::{mean_distance, mean_nearest_distance, symmetric_distance};
