//! Kabsch: unweighted least squares over the rigid motions.

use nalgebra::{Matrix3, Vector3};
use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Object, Transform, so3};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver,
    spread::{centroid, check},
};
use crate::Observations;

/// The rigid motion of least squared residuals, min Σ ‖P_k − C_k H‖² over SE(3): the paper's
/// "standard method", every identified point with the same weight.
///
/// With a_k = P_k − P̄, b_k = C_k − C̄ and M = Σ a_k b_kᵀ = U S Vᵀ, the rotation is
/// R = U diag(1, 1, det(U Vᵀ)) Vᵀ, the translation P̄ − R C̄; the determinant keeps reflections out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Kabsch {
    /// Second extent of the points over the first below which they count as a line.
    pub least_ratio: f64,
}

impl Default for Kabsch {
    fn default() -> Self {
        Self { least_ratio: 1e-3 }
    }
}

impl Component for Kabsch {
    const NAME: &'static str = "kabsch";
    const SUMMARY: &'static str = "unweighted least squares over rigid motions, by singular values";
    const SOURCE: &'static str = "Kabsch, A solution for the best rotation to relate two sets of vectors, 1976; \
                                  Umeyama, Least-squares estimation of transformation parameters, 1991";

    fn check(&self) -> Result<(), String> {
        // Written so that a NaN is refused too.
        let share = self.least_ratio >= 0.0 && self.least_ratio < 1.0;
        in_range(share, "least-ratio", self.least_ratio, "a share from 0 to below 1")
    }
}

impl Solver for Kabsch {
    fn least_squares(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.least_ratio)?;
        Ok(fit(data))
    }
}

/// The least-squares motion of three or more points that do not lie on a line.
pub(crate) fn fit(data: &Observations<'_>) -> Transform<Object, Camera> {
    let points = &data.points;
    let model = centroid(points.iter().map(|point| point.model.coords));
    let measured = centroid(points.iter().map(|point| point.measured.at.coords));
    let m: Matrix3<f64> = points
        .iter()
        .map(|point| (point.model.coords - model) * (point.measured.at.coords - measured).transpose())
        .sum();
    let rotation = polish(rotation_of(&m), &m);
    let mut motion = Transform::from_axes(&rotation, Vector3::zeros());
    motion = Transform::new(motion.rotation(), model - motion.rotation() * measured);
    motion
}

/// The rotation R that maximises tr(Rᵀ M).
fn rotation_of(m: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    let (u, v_t) = (svd.u.expect("u was asked for"), svd.v_t.expect("v_t was asked for"));
    let sign = if (u * v_t).determinant() < 0.0 { -1.0 } else { 1.0 };
    u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t
}

/// Newton's steps on the same objective. The 3×3 singular value decomposition is computed by way of
/// MᵀM, which costs half the digits of the weaker directions; a step or two give them back.
fn polish(mut rotation: Matrix3<f64>, m: &Matrix3<f64>) -> Matrix3<f64> {
    for _ in 0..4 {
        // At R Exp(φ): tr((R Exp φ)ᵀ M) has gradient g = vex(N − Nᵀ), N = Rᵀ M, and Hessian −(tr(N) I − sym N).
        let n = rotation.transpose() * m;
        let gradient = Vector3::new(n[(2, 1)] - n[(1, 2)], n[(0, 2)] - n[(2, 0)], n[(1, 0)] - n[(0, 1)]);
        let hessian = Matrix3::identity() * n.trace() - (n + n.transpose()) * 0.5;
        let Some(cholesky) = hessian.cholesky() else { break };
        let step = cholesky.solve(&gradient);
        if !(step.norm() < 1e-3) {
            break; // far from a maximum: what the singular values said stands
        }
        rotation *= so3::exp(&step).to_rotation_matrix().into_inner();
        if step.norm() < 1e-15 {
            break;
        }
    }
    rotation
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_refused() {
        assert_eq!(Kabsch::default().check(), Ok(()));
        for bad in [-0.1, 1.0, f64::NAN] {
            assert!(Kabsch { least_ratio: bad }.check().is_err(), "{bad}");
        }
    }
}
