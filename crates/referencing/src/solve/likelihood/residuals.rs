//! The likelihood of the residuals, by which sets are accepted and alternatives ranked.

use seafix_geometry::{Camera, Object, Transform};

use crate::{
    observations::Observations,
    solve::likelihood::{
        descent::{linearize, minimize},
        mixed::Mixed,
        point_terms::Measured,
    },
};

/// The maximum-likelihood pose of a set of pairs, with its cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Likelihood {
    /// The maximum-likelihood pose.
    pub(crate) pose: Transform<Object, Camera>,
    /// Σ rᵀ S⁻¹ r at the pose: χ² with 3k − 6 degrees of freedom for correct pairs.
    pub(crate) cost: f64,
}

/// The maximum of the likelihood of the residuals near a pose.
///
/// With r_k = Rᵀ(P_k − t) − C_k in camera axes and S_k = Σ_measured + σ_model² I, it minimises Σ r_kᵀ S_k⁻¹ r_k. The
/// cost at the maximum is χ² with 3k − 6 degrees of freedom for every solver that gave `start`, so it can be tested. An
/// edge adds four degrees of freedom: its offsets, in both images if it has pixels.
pub(crate) fn maximum(data: &Observations<'_>, start: &Transform<Object, Camera>) -> Likelihood {
    if !data.edges.is_empty() {
        let found = Mixed::of(data, None, data.rig).and_then(|mixed| mixed.minimum(start));
        return found.map_or(Likelihood { pose: *start, cost: f64::INFINITY }, |(pose, all)| Likelihood {
            pose,
            cost: all.cost,
        });
    }
    let measured = Measured::of(&data.points);
    let term = |k: usize, at: &_| Some(measured.term(k, at));
    let pose = minimize(&data.points, start, &term).unwrap_or(*start);
    let cost = linearize(&data.points, &pose, &term).map_or(f64::INFINITY, |all| all.cost);
    Likelihood { pose, cost }
}
