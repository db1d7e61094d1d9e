//! Horn: unweighted least squares by unit quaternions.

use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion};
use seafix_component::{Component, Settings};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        covariance::sandwich,
        degeneracy::{Degenerate, centroid, check, fraction},
        solver::Solver,
    },
};

/// Horn's least squares min Σ ‖P_k − C_k H‖² by unit quaternions.
///
/// The quaternion is the eigenvector to the largest eigenvalue of the symmetric 4×4 matrix N of the sums S_ij = Σ c_i
/// p_j; it maximises qᵀ N q = tr(Rᵀ M).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Horn {
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub(crate) min_ratio: f64,
}

impl Default for Horn {
    fn default() -> Self {
        Self { min_ratio: 1e-3 }
    }
}

impl Component for Horn {
    const NAME: &'static str = "horn";
    const SUMMARY: &'static str = "unweighted least squares by unit quaternions";
    const SOURCE: &'static str = "Horn, Closed-form solution of absolute orientation using unit quaternions, 1987";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        fraction("min-ratio", self.min_ratio)
    }
}

impl Solver for Horn {
    fn least_squares(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        let model = centroid(data.points.iter().map(|point| point.model.coords));
        let measured = centroid(data.points.iter().map(|point| point.measured.at.coords));
        let s: Matrix3<f64> = data
            .points
            .iter()
            .map(|point| (point.measured.at.coords - measured) * (point.model.coords - model).transpose())
            .sum();
        let (x, y, z) = (s.m23 - s.m32, s.m31 - s.m13, s.m12 - s.m21);
        #[rustfmt::skip]
        let n = Matrix4::new(
            s.trace(), x,                     y,                     z,
            x,         s.m11 - s.m22 - s.m33, s.m12 + s.m21,         s.m31 + s.m13,
            y,         s.m12 + s.m21,         s.m22 - s.m11 - s.m33, s.m23 + s.m32,
            z,         s.m31 + s.m13,         s.m23 + s.m32,         s.m33 - s.m11 - s.m22,
        );
        let eigen = n.symmetric_eigen();
        let q = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
        Ok(Transform::new(rotation, model - rotation * measured))
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        sandwich::or_resampled(data, at, |_| 1.0, |sampled| self.solve(sampled))
    }
}
