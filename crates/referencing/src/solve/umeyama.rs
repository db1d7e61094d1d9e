//! Umeyama: least squares by singular values, with the scale as a diagnostic.

use nalgebra::{Matrix3, Vector3};
use seafix_component::{Component, Settings, in_range};
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

/// Umeyama's least squares min Σ ‖P_k − C_k H‖², with the scale as a diagnostic.
///
/// M = U S Vᵀ, R = U diag(1, 1, det U det V) Vᵀ, and the scale of the best similarity is s = tr(S diag(…)) / Σ‖c_k‖². A
/// fix is rigid, so the scale is not applied. It differs from one by noise, a wrong focal length, a wrong baseline or a
/// model in other units; a deviation beyond `max_scale_error` is rejected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Umeyama {
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub(crate) min_ratio: f64,
    /// Largest accepted relative scale error |s − 1|; infinite accepts every scale.
    pub(crate) max_scale_error: f64,
}

impl Default for Umeyama {
    fn default() -> Self {
        Self { min_ratio: 1e-3, max_scale_error: f64::INFINITY }
    }
}

impl Component for Umeyama {
    const NAME: &'static str = "umeyama";
    const SUMMARY: &'static str = "unweighted least squares by singular values, the scale as a diagnostic";
    const SOURCE: &'static str = "Umeyama, Least-squares estimation of transformation parameters between two point \
                                  patterns, 1991";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        fraction("min-ratio", self.min_ratio)?;
        in_range(self.max_scale_error > 0.0, "max-scale-error", self.max_scale_error, "a positive number")
    }
}

impl Solver for Umeyama {
    fn least_squares(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        let (pose, scale) = similarity(data);
        if (scale - 1.0).abs() <= self.max_scale_error {
            Ok(pose)
        } else {
            Err(Degenerate::Scale { scale, max: self.max_scale_error })
        }
    }

    fn scale(&self, data: &Observations<'_>) -> Option<f64> {
        check(data, self.minimum(), self.min_ratio).ok().map(|()| similarity(data).1)
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        sandwich::or_resampled(data, at, |_| 1.0, |sampled| self.solve(sampled))
    }
}

/// The rigid motion, and the scale of the best similarity.
fn similarity(data: &Observations<'_>) -> (Transform<Object, Camera>, f64) {
    let model = centroid(data.points.iter().map(|point| point.model.coords));
    let measured = centroid(data.points.iter().map(|point| point.measured.at.coords));
    let (mut m, mut size) = (Matrix3::zeros(), 0.0);
    for point in &data.points {
        let (p, c) = (point.model.coords - model, point.measured.at.coords - measured);
        m += p * c.transpose();
        size += c.norm_squared();
    }
    let svd = m.svd(true, true);
    let (u, v_t) = (svd.u.expect("u is requested"), svd.v_t.expect("v_t is requested"));
    let sign = if u.determinant() * v_t.determinant() < 0.0 { -1.0 } else { 1.0 };
    let guard = Vector3::new(1.0, 1.0, sign);
    let rotation = polish(u * Matrix3::from_diagonal(&guard) * v_t, &m);
    let rotation = Transform::<Object, Camera>::from_axes(&rotation, Vector3::zeros()).rotation();
    let scale = svd.singular_values.dot(&guard) / size;
    (Transform::new(rotation, model - rotation * measured), scale)
}

/// Newton steps on tr(Rᵀ M); they restore the precision of the weaker directions that the library's 3×3 decomposition
/// loses through MᵀM.
fn polish(mut rotation: Matrix3<f64>, m: &Matrix3<f64>) -> Matrix3<f64> {
    for _ in 0..4 {
        // At R Exp(φ): tr((R Exp φ)ᵀ M) has gradient g = vex(N − Nᵀ), N = Rᵀ M, and Hessian −(tr(N) I − sym N).
        let n = rotation.transpose() * m;
        let gradient = Vector3::new(n[(2, 1)] - n[(1, 2)], n[(0, 2)] - n[(2, 0)], n[(1, 0)] - n[(0, 1)]);
        let hessian = Matrix3::identity() * n.trace() - (n + n.transpose()) * 0.5;
        let Some(cholesky) = hessian.cholesky() else { break };
        let step = cholesky.solve(&gradient);
        if !(step.norm() < 1e-3) {
            break; // far from a maximum: keep the rotation of the singular values
        }
        rotation *= seafix_geometry::so3::exp(&step).to_rotation_matrix().into_inner();
        if step.norm() < 1e-15 {
            break;
        }
    }
    rotation
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observations::Observation;
    use seafix_geometry::{Point, UncertainPoint};

    #[test]
    fn a_model_in_millimetres_is_rejected_by_its_scale() {
        let points = [[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.0, 1.0, 3.5], [1.0, 1.0, 2.5]].map(|at| Observation {
            measured: UncertainPoint::isotropic(Point::from(at), 0.01),
            pixels: None,
            model: Point::from(at.map(|x| x * 1000.0)),
            model_sigma: 0.0,
        });
        let data = Observations { points: points.to_vec(), edges: Vec::new(), rig: None };
        let careful = Umeyama { max_scale_error: 0.1, ..Umeyama::default() };
        let Err(Degenerate::Scale { scale, .. }) = careful.solve(&data) else { panic!("a thousandfold model") };
        assert!((scale - 1000.0).abs() < 1e-9);
        assert!(Umeyama::default().solve(&data).is_ok());
    }
}
