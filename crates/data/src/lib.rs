//! Simulated and recorded sequences of stereo pairs or clouds.

pub mod dataset;
pub mod log_conversion;
mod model;
mod ros;
pub mod source;
pub mod trajectory;

pub use model::{HandModel, HandPoint, Mark, ModelByHand};
