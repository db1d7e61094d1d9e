//! The input of a search.

use std::borrow::Cow;

use nalgebra::Vector3;
use seafix_component::{Settings, in_range};
use seafix_geometry::{Camera, Covariance6, MeasuredLine, MeasuredPoint, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    anchors::anchors,
    candidates::Candidates,
    site::{edge::ModelEdge, model::ModelPoint},
};

/// The prior: the camera's pose before the fix, with its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// The prior pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// The uncertainty of the prior pose.
    pub bound: PriorBound,
}

/// The uncertainty of a prior: Gaussian, or a uniform box.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one prior a search, and it is passed by reference")]
pub enum PriorBound {
    /// Gaussian: the covariance of ξ in `T_true = T_prior · Exp(ξ)`.
    Gaussian(Covariance6<Object, Camera>),
    /// Uniform: each visible model point lies within this distance (m) of its prediction.
    ///
    /// The distance holds along each camera axis (the paper's shell).
    Box(f64),
}

/// The tolerance of structural coherence: the largest difference of two distances in model and cloud.
///
/// It is written in TOML as `tolerance = { sigmas = 3.0 }` or `tolerance = { fixed = 0.05 }`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Tolerance {
    /// The paper's Δ (m), equal for all pairs; for comparison with its results.
    Fixed(f64),
    /// A multiple k of the distance's standard deviation: Δ_ij = k·√(nᵀ(Σ_i + Σ_j)n + σ_i² + σ_j²), with the direction n
    /// of the distance in the cloud and the model's σ.
    Sigmas(f64),
}

impl Tolerance {
    /// Checks the range of the tolerance.
    ///
    /// # Errors
    ///
    /// A number that is not positive and finite, with the valid range.
    pub fn check(&self) -> Result<(), String> {
        let (name, value, range) = match *self {
            Self::Fixed(delta) => ("fixed", delta, "a positive number of metres"),
            Self::Sigmas(k) => ("sigmas", k, "a positive number of standard deviations"),
        };
        // A NaN is rejected as well.
        let positive = value > 0.0 && value.is_finite();
        in_range(positive, name, value, range).map_err(|message| format!("tolerance: {message}"))
    }
}

/// A correspondence: a model point and a cloud point identified with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Correspondence {
    /// The index of the model point.
    pub model: usize,
    /// The index of the cloud point.
    pub cloud: usize,
}

/// The edges of a problem: those of the model, the measured lines, and the candidates; empty without edges.
#[derive(Debug, Clone, Copy, Default)]
pub struct Edges<'a> {
    /// The edges of the target; their ends index the problem's model points.
    pub model: &'a [ModelEdge],
    /// The measured lines.
    pub lines: &'a [MeasuredLine],
    /// For each model edge, the lines that may correspond to it, ascending; empty for an edge out of view.
    pub candidates: &'a [Vec<usize>],
}

impl Edges<'_> {
    /// The number of model edges with a candidate.
    pub fn with_candidates(&self) -> usize {
        self.candidates.iter().filter(|list| !list.is_empty()).count()
    }
}

/// The input of one search: model, cloud, candidates, tolerance, prior and edges.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// The feature points of the target.
    pub model: &'a [ModelPoint],
    /// The measured points.
    pub cloud: &'a [MeasuredPoint],
    /// The candidates: for each model point, the cloud points that may correspond to it.
    pub candidates: &'a Candidates,
    /// The tolerance of the distances.
    pub tolerance: Tolerance,
    /// The prior, if one is known; it bounds the complete pose as well as the candidates.
    pub prior: Option<&'a Prior>,
    /// The edges.
    pub edges: Edges<'a>,
}

impl Problem<'_> {
    /// The places that stand for the object where two of its poses are compared: see [`anchors`].
    pub(crate) fn anchors(&self) -> Cow<'_, [ModelPoint]> {
        anchors(self.model, self.edges.model)
    }

    /// The tolerance (m) of the distances of two pairs in model and cloud.
    pub fn delta(&self, a: Correspondence, b: Correspondence) -> f64 {
        match self.tolerance {
            Tolerance::Fixed(delta) => delta,
            Tolerance::Sigmas(k) => {
                let (p, q) = (&self.cloud[a.cloud].position, &self.cloud[b.cloud].position);
                let step: Vector3<f64> = q.at - p.at;
                let n = if step.norm() > 0.0 { step.normalize() } else { Vector3::z() };
                let cloud = n.dot(&((p.covariance + q.covariance) * n));
                let model = self.model[a.model].sigma.powi(2) + self.model[b.model].sigma.powi(2);
                k * (cloud + model).sqrt()
            }
        }
    }

    /// The contribution (m) of one pair to Δ; Δ of two pairs is at most the sum of both, by √(x² + y²) ≤ x + y.
    pub(crate) fn fraction_of_delta(&self, pair: Correspondence) -> f64 {
        match self.tolerance {
            Tolerance::Fixed(delta) => 0.5 * delta,
            Tolerance::Sigmas(k) => {
                // The Frobenius norm bounds the variance in every direction.
                let measured = self.cloud[pair.cloud].position.covariance.norm().sqrt();
                k * (measured + self.model[pair.model].sigma)
            }
        }
    }

    /// Structural coherence of `a` and `b`: different model points, different cloud points, and a difference of their
    /// distances in model and cloud of at most Δ (closed).
    pub fn coherent(&self, a: Correspondence, b: Correspondence) -> bool {
        a.model != b.model && a.cloud != b.cloud && self.agrees(a, b, self.measured(a.cloud, b.cloud))
    }

    /// The number of standard deviations of the tolerance; three for a fixed one.
    pub(crate) fn sigmas(&self) -> f64 {
        match self.tolerance {
            Tolerance::Sigmas(sigmas) => sigmas,
            Tolerance::Fixed(_) => 3.0,
        }
    }

    /// The distance test of structural coherence, for different points with a known measured distance (m).
    pub(crate) fn agrees(&self, a: Correspondence, b: Correspondence, measured: f64) -> bool {
        let model = self.model[a.model].at.distance(&self.model[b.model].at);
        (model - measured).abs() <= self.delta(a, b)
    }

    /// The distance between two cloud points (m).
    pub(crate) fn measured(&self, a: usize, b: usize) -> f64 {
        self.cloud[a].position.at.distance(&self.cloud[b].position.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_is_positive() {
        assert!(Tolerance::Fixed(0.05).check().is_ok() && Tolerance::Sigmas(3.0).check().is_ok());
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Tolerance::Fixed(bad).check().is_err() && Tolerance::Sigmas(bad).check().is_err(), "{bad}");
        }
        let message = Tolerance::Fixed(-1.0).check().unwrap_err();
        assert_eq!(message, "tolerance: fixed = -1; give a positive number of metres");
    }
}
