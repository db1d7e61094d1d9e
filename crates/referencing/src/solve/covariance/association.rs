//! The covariance of a pose by uncertain data association.

use nalgebra::{Cholesky, Matrix3, Matrix3x6, Matrix6, U6, Vector3};
use seafix_geometry::{Camera, Object, Transform, UncertainPoint, so3::skew};

use crate::observations::{Observation, Observations};

/// The increase of a pose's covariance because other candidates may be the identified points.
///
/// It is the spread of the innovations of probabilistic data association (Bar-Shalom and Fortmann, *Tracking and Data
/// Association*, 1988) about the chosen candidates. Each point i is predicted by the pose without it; with the
/// innovations ν of its candidates, their covariances S, the density λ of clutter among them and the probability of
/// detection P,
///
/// β_j ∝ N(ν_j; 0, S_j), β_0 ∝ λ (1 − P)/P.
///
/// If candidate j is the point, the pose moves by N⁻¹ JᵀW (z_j − z_c); if none is, it moves to the pose without the
/// point. The result is the sum of the second moments of these steps, and of β_0 times the increase of the covariance
/// without the point. It is zero if no other candidate is within [`GATE`] standard deviations of a prediction. Points
/// are treated as independent.
///
/// `others` are the other candidates of each point, `detected` is P, `edges` the information of edges on the pose. A point whose absence leaves the pose
/// undetermined is taken as identified.
pub(crate) fn association(
    data: &Observations<'_>,
    pose: &Transform<Object, Camera>,
    others: &[Vec<UncertainPoint<Camera>>],
    detected: f64,
    edges: &Matrix6<f64>,
) -> Matrix6<f64> {
    if others.iter().all(Vec::is_empty) {
        return Matrix6::zeros();
    }
    let points: Option<Vec<Weighted>> = data.points.iter().map(|point| Weighted::of(point, pose)).collect();
    let Some(points) = points else { return Matrix6::zeros() };
    let normal: Matrix6<f64> = points.iter().map(|one| one.by.transpose() * one.information * one.by).sum();
    let normal = if data.edges.is_empty() { normal } else { normal + edges };
    let Some(root) = normal.cholesky() else { return Matrix6::zeros() };
    let covariance = root.inverse();
    // The residuals are those of the given pose, which the step without a point then leaves.
    let pulls = points.iter().map(|one| one.by.transpose() * (one.information * one.residual));
    let off = covariance * pulls.sum::<nalgebra::Vector6<f64>>();
    let mut sum = Matrix6::zeros();
    for ((one, point), others) in points.iter().zip(&data.points).zip(others).filter(|(_, others)| !others.is_empty()) {
        let own = one.by.transpose() * one.information * one.by;
        let Some(without) = without(&root, &(normal - own)) else { continue };
        let step = without * (normal * off - one.by.transpose() * (one.information * one.residual));
        let predicted = one.at + one.by * step;
        let own_noise = point.noise() - point.measured.covariance + one.by * without * one.by.transpose();
        let innovation = |at: &UncertainPoint<Camera>| {
            let (nu, spread) = (at.at.coords - predicted, at.covariance + own_noise);
            // The trace bounds the largest eigenvalue, and so the distance from below.
            (nu.norm_squared() <= GATE * GATE * spread.trace()).then_some(())?;
            let root = spread.cholesky()?;
            let chi2 = nu.dot(&root.solve(&nu));
            let volume = root.l_dirty().diagonal().product();
            (chi2 <= GATE * GATE).then(|| (libm::exp(-0.5 * chi2) / (TWO_PI_ROOT.powi(3) * volume), volume))
        };
        let alternatives: Vec<(Vector3<f64>, f64, f64)> = others
            .iter()
            .filter_map(|other| {
                innovation(other).map(|(density, volume)| (other.at.coords - point.measured.at.coords, density, volume))
            })
            .collect();
        if alternatives.is_empty() {
            continue;
        }
        let chosen = innovation(&point.measured).map_or(0.0, |(density, _)| density);
        let gate = |volume: f64| 4.0 / 3.0 * std::f64::consts::PI * GATE.powi(3) * volume;
        let clutter: f64 = alternatives.iter().map(|(_, _, volume)| 1.0 / gate(*volume)).sum();
        let absent = clutter * (1.0 - detected) / detected;
        let total = chosen + absent + alternatives.iter().map(|(_, density, _)| density).sum::<f64>();
        if !(total > 0.0) {
            continue;
        }
        let gain = covariance * one.by.transpose() * one.information;
        let moment: Matrix3<f64> =
            alternatives.iter().map(|(shift, density, _)| shift * shift.transpose() * (density / total)).sum();
        let left = step - off;
        sum += gain * moment * gain.transpose() + (left * left.transpose() + without - covariance) * (absent / total);
    }
    sum
}

/// The covariance of a pose with the information `rest`, a part of the information with the Cholesky factor `root`;
/// `None` if it leaves the pose undetermined.
///
/// Two of three points leave the rotation about their line free, but rounding may give it a tiny information.
fn without(root: &Cholesky<f64, U6>, rest: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let half = root.l().solve_lower_triangular(rest)?;
    let fraction = root.l().solve_lower_triangular(&half.transpose())?;
    let fraction = 0.5 * (fraction + fraction.transpose());
    (fraction.symmetric_eigenvalues().min() > UNDETERMINED).then_some(())?;
    rest.cholesky().map(|root| root.inverse())
}

/// The fraction of its information below which a direction of the pose is undetermined: rounding of its sum leaves
/// some 1e-13.
const UNDETERMINED: f64 = 1e-9;
/// The standard deviations within which a candidate may be the point; beyond four the density is below e⁻⁸ of its
/// maximum.
const GATE: f64 = 4.0;
const TWO_PI_ROOT: f64 = 2.506_628_274_631_000_7;

/// A point's terms at a pose.
struct Weighted {
    /// Its predicted position, camera frame.
    at: Vector3<f64>,
    residual: Vector3<f64>,
    information: Matrix3<f64>,
    /// The derivative of `at` by ξ of `pose · Exp(ξ)`.
    by: Matrix3x6<f64>,
}

impl Weighted {
    fn of(point: &Observation, pose: &Transform<Object, Camera>) -> Option<Self> {
        let at = (pose.inverse() * point.model).coords;
        let mut by = Matrix3x6::zeros();
        by.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&at));
        by.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
        let information = point.noise().cholesky()?.inverse();
        Some(Self { at, residual: point.measured.at.coords - at, information, by })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Point;

    const SIGMA: f64 = 0.01;

    fn seen() -> (Observations<'static>, Transform<Object, Camera>) {
        let pose = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.4, 0.1, 0.2, -3.0].into());
        let points = (0..8).map(|k| {
            let (a, b) = (f64::from(k) * 1.3, f64::from(k * k % 5) * 0.4);
            let at = Point::new(a.sin(), b - 0.7, 0.5 * (a * 0.7).cos());
            Observation {
                measured: UncertainPoint::isotropic(pose.inverse() * at, SIGMA),
                pixels: None,
                model: at,
                model_sigma: 0.0,
            }
        });
        (Observations { points: points.collect(), edges: Vec::new(), rig: None }, pose)
    }

    fn with(shift: f64, detected: f64) -> Matrix6<f64> {
        let (data, pose) = seen();
        let mut others = vec![Vec::new(); 8];
        let at = data.points[3].measured.at + Vector3::new(0.0, shift, 0.0);
        others[3].push(UncertainPoint::isotropic(at, SIGMA));
        association(&data, &pose, &others, detected, &Matrix6::zeros())
    }

    /// A candidate that coincides with the chosen one moves nothing; one beyond the gate is none.
    #[test]
    fn other_candidates_count_where_they_may_be_the_point() {
        assert!(with(0.0, 1.0).amax() < 1e-15);
        assert_eq!(with(0.5, 0.5), Matrix6::zeros());
        let near = with(0.02, 1.0);
        assert!(near.symmetric_eigenvalues().min() > -1e-12 && near.trace() > 1e-7, "{near}");
        assert!(with(0.02, 0.5).trace() > near.trace(), "a point may be undetected");
    }

    /// Two of three points determine no pose, whatever rounding says.
    #[test]
    fn a_point_that_the_pose_needs_is_taken_as_identified() {
        let (mut data, pose) = seen();
        data.points.truncate(3);
        for turn in 0..200 {
            let turned = pose * Transform::exp(&[0.01 * f64::from(turn), 0.3, -0.2, 0.1, 0.4, 0.3].into());
            for point in &mut data.points {
                point.measured = UncertainPoint::isotropic(turned.inverse() * point.model, SIGMA);
            }
            let near = data.points[1].measured.at + Vector3::new(0.0, 0.02, 0.0);
            let others = [vec![], vec![UncertainPoint::isotropic(near, SIGMA)], vec![]];
            assert_eq!(association(&data, &turned, &others, 0.5, &Matrix6::zeros()), Matrix6::zeros());
        }
    }

    /// Two candidates, one of which is the point: the mixture of both poses about the pose of the chosen one.
    #[test]
    fn two_candidates_have_the_moment_of_their_mixture() {
        let (data, pose) = seen();
        let shift = Vector3::new(0.0, 0.02, 0.0);
        let found = with(shift.y, 1.0);
        let points: Vec<Weighted> = data.points.iter().map(|point| Weighted::of(point, &pose).unwrap()).collect();
        let normal: Matrix6<f64> = points.iter().map(|one| one.by.transpose() * one.information * one.by).sum();
        let one = &points[3];
        let own = one.by.transpose() * one.information * one.by;
        let spread =
            Matrix3::identity() * (SIGMA * SIGMA) + one.by * (normal - own).try_inverse().unwrap() * one.by.transpose();
        let odds = (-0.5 * shift.dot(&(spread.try_inverse().unwrap() * shift))).exp();
        let step = normal.try_inverse().unwrap() * one.by.transpose() * one.information * shift;
        let expected = step * step.transpose() * (odds / (1.0 + odds));
        assert!((found - expected).amax() < 1e-9 * expected.amax());
    }
}
