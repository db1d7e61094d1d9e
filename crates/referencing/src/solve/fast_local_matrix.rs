//! Fast local matrix: a linearised rotation and a closed 6×6 solve, repeated.

use nalgebra::{Matrix3, Vector3};
use seafix_component::{Component, Settings};
use seafix_geometry::{Camera, Covariance6, Object, Transform, triad};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        covariance::sandwich,
        degeneracy::{Degenerate, check, fraction, widest},
        likelihood::descent::{Term, minimize},
        solver::Solver,
    },
};

/// Least squares by a linearised rotation: min Σ ‖P_k − C_k H‖².
///
/// The method serves motions that are small after an initial alignment by the auxiliary frames of three widely spread
/// points. R ≈ I + \[φ\]× makes the sum a quadratic form of (φ, ρ), one 6×6 system gives its minimum, and the
/// exponential restores a rotation; this repeats until the steps vanish. If the points fit no motion (a mirror image),
/// steps shrink slowly and the iteration may end short of the minimum, so the solver does not claim least squares. It
/// is the project's own reading of the phrase "fast computation of the local matrix", whose source was not available.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct FastLocalMatrix {
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub(crate) min_ratio: f64,
}

impl Default for FastLocalMatrix {
    fn default() -> Self {
        Self { min_ratio: 1e-3 }
    }
}

impl Component for FastLocalMatrix {
    const NAME: &'static str = "fast-local-matrix";
    const SUMMARY: &'static str = "unweighted least squares by a linearised rotation, repeated";
    const SOURCE: &'static str = "ours, after a phrase in Bobkov, Kudryashov, Inzartsev 2021";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        fraction("min-ratio", self.min_ratio)
    }
}

impl Solver for FastLocalMatrix {
    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        let [a, b, c] = widest(data).map(|i| data.points[i]);
        let line = |thin: seafix_geometry::Collinear| Degenerate::Collinear { ratio: thin.sine, min: thin.min };
        let camera = triad::<Camera, Object>(&a.measured.at, &b.measured.at, &c.measured.at).map_err(line)?;
        let object = triad::<Object, Object>(&a.model, &b.model, &c.model).map_err(line)?;
        let unweighted = |k: usize, at: &Vector3<f64>| {
            Some(Term::of(Matrix3::identity() / (UNIT * UNIT), &(data.points[k].measured.at.coords - at)))
        };
        minimize(&data.points, &(object * camera.inverse()), &unweighted)
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        sandwich::or_resampled(data, at, |_| 1.0, |sampled| self.solve(sampled))
    }
}

/// Common standard deviation (m) of all points; it only defines the length of a small step.
const UNIT: f64 = 1e-4;
