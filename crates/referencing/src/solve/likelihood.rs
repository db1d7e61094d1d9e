//! How likely the residuals are: the measure by which sets are believed and rivals ranked.

use seafix_geometry::{Camera, Object, Transform};

use super::{
    descent::{linearize, minimize},
    mahalanobis::Measured,
};
use crate::Observations;

/// The most likely pose of a set of pairs and how well it explains them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Likelihood {
    /// Where the likelihood is greatest.
    pub(crate) pose: Transform<Object, Camera>,
    /// Σ rᵀ S⁻¹ r there: χ² with 3k − 6 degrees of freedom for true pairs.
    pub(crate) cost: f64,
}

/// The maximum of the likelihood of the residuals, from a pose near it.
///
/// With r_k = Rᵀ(P_k − t) − C_k in camera axes and S_k = Σ_measured + σ_model² I, the least
/// Σ r_kᵀ S_k⁻¹ r_k. Whatever the weights of the solver that gave `start`, the cost at the maximum is
/// χ² with 3k − 6 degrees of freedom, so that it can be tested.
pub(crate) fn maximum(data: &Observations<'_>, start: &Transform<Object, Camera>) -> Likelihood {
    let measured = Measured::of(&data.points);
    let term = |k: usize, at: &_| Some(measured.term(k, at));
    let pose = minimize(&data.points, start, &term).unwrap_or(*start);
    let cost = linearize(&data.points, &pose, &term).map_or(f64::INFINITY, |all| all.cost);
    Likelihood { pose, cost }
}
