//! What a search is given.

use nalgebra::Vector3;
use seafix_component::in_range;
use seafix_geometry::{Camera, Covariance6, MeasuredPoint, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{Candidates, ModelPoint};

/// The rough pose known before the fix, and how far it may be off.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// The rough pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// How far it may be off.
    pub bound: PriorBound,
}

/// How far a prior may be off.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one prior a search, and it is passed by reference")]
pub enum PriorBound {
    /// Gaussian: the covariance of ξ in `T_true = T_prior · Exp(ξ)`.
    Gaussian(Covariance6<Object, Camera>),
    /// Each visible model point lies within this distance (m) of its prediction along each camera
    /// axis: the paper's shell.
    Box(f64),
}

/// When two pairs (model point, cloud point) are coherent: their distances in model and cloud agree.
///
/// In TOML `tolerance = { sigmas = 3.0 }` or `tolerance = { fixed = 0.05 }`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tolerance {
    /// The paper's Δ (m), one for all pairs.
    Fixed(f64),
    /// Δ_ij = k·√(nᵀ(Σ_i + Σ_j)n + σ_i² + σ_j²): k standard deviations of this very distance, n its
    /// direction in the cloud, σ the model's own.
    Sigmas(f64),
}

impl Tolerance {
    /// What is wrong with the setting, if something is.
    ///
    /// # Errors
    /// A number that is not positive and finite.
    pub fn check(&self) -> Result<(), String> {
        let (name, value, range) = match *self {
            Self::Fixed(delta) => ("fixed", delta, "a positive number of metres"),
            Self::Sigmas(k) => ("sigmas", k, "a positive number of standard deviations"),
        };
        // Written so that a NaN is refused too.
        let positive = value > 0.0 && value.is_finite();
        in_range(positive, name, value, range).map_err(|message| format!("tolerance: {message}"))
    }
}

/// A model point and the cloud point believed to be it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Correspondence {
    /// Index of the model point.
    pub model: usize,
    /// Index of the cloud point.
    pub cloud: usize,
}

/// One search: a model, a cloud, and which cloud points may be which model points.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// The feature points of the target.
    pub model: &'a [ModelPoint],
    /// The points that were measured.
    pub cloud: &'a [MeasuredPoint],
    /// For each model point, the cloud points that may be it.
    pub candidates: &'a Candidates,
    /// When two distances agree.
    pub tolerance: Tolerance,
    /// The rough pose, where one is known: it bounds the pose as a whole, not only the candidates.
    pub prior: Option<&'a Prior>,
}

impl Problem<'_> {
    /// The largest difference of the distances of `a` and `b` in model and cloud that still counts
    /// as agreement (m).
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

    /// The share of Δ that is due to one pair (m): that of two is no more than the sum of both, by √(x² + y²) ≤ x + y.
    pub(crate) fn fraction_of_delta(&self, pair: Correspondence) -> f64 {
        match self.tolerance {
            Tolerance::Fixed(delta) => 0.5 * delta,
            Tolerance::Sigmas(k) => {
                // No direction has more variance than the Frobenius norm, whatever the matrix.
                let measured = self.cloud[pair.cloud].position.covariance.norm().sqrt();
                k * (measured + self.model[pair.model].sigma)
            }
        }
    }

    /// Whether `a` and `b` are structurally coherent: two different model points, two different
    /// cloud points, and | |P_a P_b| − |C_a C_b| | ≤ Δ (closed).
    pub fn coherent(&self, a: Correspondence, b: Correspondence) -> bool {
        a.model != b.model && a.cloud != b.cloud && self.agrees(a, b, self.measured(a.cloud, b.cloud))
    }

    /// The same of different model points and different cloud points that are known to be so far apart (m).
    pub(crate) fn agrees(&self, a: Correspondence, b: Correspondence, measured: f64) -> bool {
        let model = self.model[a.model].at.distance(&self.model[b.model].at);
        (model - measured).abs() <= self.delta(a, b)
    }

    /// How far two cloud points are apart (m).
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
