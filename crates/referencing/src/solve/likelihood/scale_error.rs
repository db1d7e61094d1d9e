//! The scale error between measurement and model.

use nalgebra::{Matrix3, Vector3, Vector6};
use seafix_geometry::{Camera, Object, Transform};

use crate::{
    observations::Observation,
    solve::likelihood::descent::{Term, Terms, linearize},
};

/// The relative excess of measured distances over the model's, from a fit with a scale.
///
/// A wrong baseline or focal length scales every measurement, a wrong survey the model. Three points do not show it,
/// since any triangle fits nearly within its noise. With many points it shows in every distance, long before a single
/// residual exceeds its limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleError {
    /// The estimate: measured distances are 1 + `value` times the model's.
    pub value: f64,
    /// The standard deviation that follows from the noise of the points.
    pub sigma: f64,
}

/// The scale error of the points at their maximum-likelihood pose: one step of the fit with seven parameters.
///
/// A scale error ε moves the position p of a point by ε d, with d = p − p̄ its lever from the mean. With J of the
/// motion as in [`linearize`] and the pull W r of each point, ε = (Σ dᵀWr − cᵀ N⁻¹ Σ JᵀWr)/s and σ² = 1/s, where N = Σ
/// JᵀWJ, c = Σ JᵀWd, s = Σ dᵀWd − cᵀ N⁻¹ c. `None` if the points determine no motion, or no scale beside it; see
/// [`isotropic`].
pub(crate) fn scale_error(
    points: &[Observation],
    pose: &Transform<Object, Camera>,
    terms: Terms<'_>,
) -> Option<ScaleError> {
    let all = linearize(points, pose, &terms).ok()?;
    let covariance = all.covariance().ok()?;
    let (r, t) = (pose.rotation_matrix(), pose.translation());
    let places: Vec<Vector3<f64>> = points.iter().map(|point| r.tr_mul(&(point.model.coords - t))).collect();
    let mean = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let (mut c, mut own, mut pull) = (Vector6::zeros(), 0.0, 0.0);
    for (k, at) in places.iter().enumerate() {
        let (message, d) = (terms(k, at)?, at - mean);
        let weighted = message.information * d;
        let turn = -at.cross(&weighted);
        c += Vector6::new(turn.x, turn.y, turn.z, -weighted.x, -weighted.y, -weighted.z);
        own += d.dot(&weighted);
        pull += d.dot(&message.pull);
    }
    let by_motion = covariance * c;
    let left = own - c.dot(&by_motion);
    // The rounding residue of coincident points, or beside a nearly exact coordinate, is no information.
    (left > ROUNDING * own)
        .then(|| ScaleError { value: (pull - by_motion.dot(&all.gradient)) / left, sigma: (1.0 / left).sqrt() })
}

/// The scale error with the mean variance of every point in all directions.
///
/// If one coordinate is nearly exact, rounding removes the information of the others on the scale; this form keeps it.
pub(crate) fn isotropic(points: &[Observation], pose: &Transform<Object, Camera>) -> Option<ScaleError> {
    let term = |k: usize, at: &Vector3<f64>| {
        let Observation { measured, model_sigma, .. } = &points[k];
        let variance = measured.covariance.trace() / 3.0 + model_sigma * model_sigma;
        (variance > 0.0).then(|| Term::of(Matrix3::identity() / variance, &(measured.at.coords - at)))
    };
    scale_error(points, pose, &term)
}

/// Fraction of the information on the scale that counts as rounding; with one weight 10¹⁰ times the others, the inverse
/// of N has five digits.
const ROUNDING: f64 = 1e-4;

#[cfg(test)]
mod tests {
    use seafix_geometry::{Point, UncertainPoint};

    use super::*;
    use crate::{observations::Observations, solve::likelihood::point_fit::solved};

    const SIGMA: f64 = 0.002;

    /// The corners of a box of 2 × 2 × 1 m, measured at `by` times their distance from the camera.
    fn scaled(by: f64) -> Option<ScaleError> {
        let pose = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.4, 0.1, 0.2, -5.0].into());
        let corner = |k: usize| Point::new((k & 1) as f64 * 2.0, (k >> 1 & 1) as f64 * 2.0, (k >> 2 & 1) as f64);
        let seen = |k: usize| Observation {
            measured: UncertainPoint::isotropic(((pose.inverse() * corner(k)).coords * by).into(), SIGMA),
            pixels: None,
            model: corner(k),
            model_sigma: 0.0,
        };
        let data = Observations { points: (0..8).map(seen).collect(), edges: Vec::new(), rig: None };
        solved(&data, None, 1, |pose, terms| Ok(scale_error(&data.points, pose, terms))).unwrap()
    }

    /// For eight corners Σ ‖d‖² = 8 · (1 + 1 + ¼) = 18 m², and no motion equals a scaling: σ = 2 mm/√18 m.
    #[test]
    fn a_box_that_is_larger_is_reported() {
        let of_box = SIGMA / 18.0_f64.sqrt();
        for by in [1.0, 1.01, 0.98] {
            let found = scaled(by).unwrap();
            assert!(
                (found.sigma / of_box - 1.0).abs() < 1e-9
                    && (found.value - (by - 1.0)).abs() < 1e-3 * (by - 1.0).abs() + 1e-9,
                "{by}: {found:?}"
            );
        }
    }

    /// One coordinate with a noise of a tenth of a micrometre takes all weight from the others.
    #[test]
    fn an_exact_coordinate_does_not_hide_it() {
        let pose = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.4, 0.1, 0.2, -5.0].into());
        let seen = |k: usize| {
            let corner = Point::new((k & 1) as f64 * 2.0, (k >> 1 & 1) as f64 * 2.0, (k >> 2 & 1) as f64);
            let at: Point<Camera> = ((pose.inverse() * corner).coords * 1.015).into();
            let mut measured = UncertainPoint::isotropic(at, SIGMA);
            measured.covariance[(0, 0)] = if k == 0 { 1e-14 } else { SIGMA * SIGMA };
            Observation { measured, pixels: None, model: corner, model_sigma: 0.0 }
        };
        let points: Vec<Observation> = (0..8).map(seen).collect();
        let found = isotropic(&points, &pose).unwrap();
        assert!((found.value - 0.015).abs() < 1e-3 && found.sigma < 1e-3, "{found:?}");
    }

    #[test]
    fn no_points_have_none() {
        let data = Observations { points: Vec::new(), edges: Vec::new(), rig: None };
        let pose = Transform::exp(&[0.0; 6].into());
        assert_eq!(scale_error(&data.points, &pose, &|_, _: &_| None), None);
    }
}
