//! How likely the residuals are: the measure by which sets are believed and rivals ranked.

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector6};
use seafix_geometry::{Camera, Object, Transform, so3::skew};

use crate::Observations;

/// The most likely pose of a set of pairs and how well it explains them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Likelihood {
    /// Where the likelihood is greatest.
    pub(crate) pose: Transform<Object, Camera>,
    /// Σ rᵀ S⁻¹ r there: χ² with 3k − 6 degrees of freedom for true pairs.
    pub(crate) cost: f64,
}

/// Coordinates are never better than this (m): exact data would otherwise have infinite weight.
const FLOOR: f64 = 1e-9;

/// The maximum of the likelihood of the residuals, from a pose near it.
///
/// With r_k = Rᵀ(P_k − t) − C_k in camera axes and S_k = Σ_measured + σ_model² I, Gauss–Newton on
/// Σ r_kᵀ S_k⁻¹ r_k. Whatever the weights of the solver that gave `start`, the cost at the maximum is
/// χ² with 3k − 6 degrees of freedom, so that it can be tested.
pub(crate) fn maximum(data: &Observations<'_>, start: &Transform<Object, Camera>) -> Likelihood {
    let weights: Vec<Matrix3<f64>> = data
        .points
        .iter()
        .map(|point| {
            let noise = point.noise() + Matrix3::identity() * (FLOOR * FLOOR);
            noise.try_inverse().unwrap_or_else(|| Matrix3::identity() / (noise.trace() / 3.0))
        })
        .collect();
    let (mut pose, mut best) = (*start, linearize(data, &weights, start));
    for _ in 0..15 {
        let Some(step) = best.normal.cholesky().map(|normal| normal.solve(&best.gradient)) else { break };
        let (next, old) = (pose.perturbed(&step).renormalized(), best.cost);
        let moved = linearize(data, &weights, &next);
        if !(moved.cost < old) {
            break;
        }
        (pose, best) = (next, moved);
        if old - best.cost <= 1e-9 * old {
            break;
        }
    }
    Likelihood { pose, cost: best.cost }
}

struct Linearized {
    normal: Matrix6<f64>,
    gradient: Vector6<f64>,
    cost: f64,
}

fn linearize(data: &Observations<'_>, weights: &[Matrix3<f64>], pose: &Transform<Object, Camera>) -> Linearized {
    let camera_from_object = pose.inverse();
    let (mut normal, mut gradient, mut cost) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
    for (point, weight) in data.points.iter().zip(weights) {
        let predicted = camera_from_object * point.model;
        let residual = point.measured.at - predicted;
        // Under T · Exp(ξ) the prediction is Exp(−ξ) p: ∂p/∂ξ = [ [p]×, −I ].
        let mut j = Matrix3x6::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&predicted.coords));
        j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
        normal += j.transpose() * weight * j;
        gradient += j.transpose() * weight * residual;
        cost += residual.dot(&(weight * residual));
    }
    Linearized { normal, gradient, cost }
}
