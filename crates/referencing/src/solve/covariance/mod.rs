//! The covariance of an answer that is not the maximum of a likelihood, or not linear in the noise.

pub(crate) mod association;
pub(crate) mod numerical;
pub(crate) mod resampled;
pub(crate) mod sandwich;
mod sigma_directions;
