//! The scale error and the depth error between measurement and model.

use nalgebra::{Matrix3, Vector3, Vector6};
use seafix_geometry::{Camera, Object, Transform};

use crate::{
    observations::Observation,
    solve::likelihood::descent::{Term, Terms, linearize},
};

/// The relative excess of measured distances over the model's, from a fit with a scale in some directions.
///
/// A wrong baseline scales every measurement, a wrong survey the model. A wrong focal length f of both cameras scales
/// the depth alone: X = u b/d does not depend on it, Z = f b/d does (u the pixel from the principal point, d the
/// disparity, b the baseline). Three points show neither error, since any triangle fits nearly within its noise. With
/// many points it shows in every distance, long before a single residual exceeds its limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleError {
    /// The estimate: measured distances are 1 + `value` times the model's (dimensionless).
    pub value: f64,
    /// The standard deviation that follows from the noise of the points.
    pub sigma: f64,
}

/// The directions in which an error of the rig or of the survey stretches the distances between points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lever {
    /// All directions: a wrong baseline, unit or survey.
    Isotropic,
    /// The optical axis: a wrong focal length of both cameras.
    Depth,
}

impl Lever {
    /// The lever d (m, camera axes) of a point at p − p̄ from the mean: p − p̄, or (p − p̄)_z e_z.
    fn of(self, offset: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Isotropic => *offset,
            Self::Depth => Vector3::new(0.0, 0.0, offset.z),
        }
    }
}

/// The scale error of the points at their maximum-likelihood pose: one step of the fit with seven parameters.
///
/// A scale error ε moves the position p of a point (camera frame) by ε d, with d its [`Lever`] from the mean p̄. The
/// motion absorbs the displacement of the mean. With J of the motion (3×6) as in [`linearize`] and the pull W r of each
/// point, ε = (Σ dᵀWr − cᵀ N⁻¹ Σ JᵀWr)/s and σ² = 1/s, where N = Σ JᵀWJ (6×6), c = Σ JᵀWd (6), s = Σ dᵀWd − cᵀ N⁻¹ c:
/// the normal equations with ε beside the motion, reduced to ε (Schur complement). χ² falls by ε² s = (ε/σ)².
///
/// `None` if the points determine no motion, or no scale beside it; see [`of_mean_variance`]. A plane seen face-on has
/// no depth error.
pub(crate) fn scale_error(
    points: &[Observation],
    pose: &Transform<Object, Camera>,
    terms: Terms<'_>,
    lever: Lever,
) -> Option<ScaleError> {
    let all = linearize(points, pose, &terms).ok()?;
    let covariance = all.covariance().ok()?;
    let (r, t) = (pose.rotation_matrix(), pose.translation());
    let places: Vec<Vector3<f64>> = points.iter().map(|point| r.tr_mul(&(point.model.coords - t))).collect();
    let mean = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let (mut c, mut own, mut pull, mut isotropic) = (Vector6::zeros(), 0.0, 0.0, 0.0);
    for (k, at) in places.iter().enumerate() {
        let (message, offset) = (terms(k, at)?, at - mean);
        let d = lever.of(&offset);
        let weighted = message.information * d;
        let turn = -at.cross(&weighted);
        c += Vector6::new(turn.x, turn.y, turn.z, -weighted.x, -weighted.y, -weighted.z);
        own += d.dot(&weighted);
        isotropic += offset.dot(&(message.information * offset));
        pull += d.dot(&message.pull);
    }
    let by_motion = covariance * c;
    let left = own - c.dot(&by_motion);
    // The rounding residue of coincident points, of a plane seen face-on, or beside a nearly exact coordinate is no
    // information.
    (left > ROUNDING * own && own > f64::EPSILON * isotropic)
        .then(|| ScaleError { value: (pull - by_motion.dot(&all.gradient)) / left, sigma: (1.0 / left).sqrt() })
}

/// The isotropic scale error with the mean variance of every point in all directions.
///
/// If one coordinate is nearly exact, rounding removes the information of the others on the scale; this form keeps it.
/// The depth error has no such form: the mean variance of a stereo point is far less than that of its depth.
pub(crate) fn of_mean_variance(points: &[Observation], pose: &Transform<Object, Camera>) -> Option<ScaleError> {
    let term = |k: usize, at: &Vector3<f64>| {
        let Observation { measured, model_sigma, .. } = &points[k];
        let variance = measured.covariance.trace() / 3.0 + model_sigma * model_sigma;
        (variance > 0.0).then(|| Term::of(Matrix3::identity() / variance, &(measured.at.coords - at)))
    };
    scale_error(points, pose, &term, Lever::Isotropic)
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

    /// Points (camera frame) measured at `by` times their depth.
    fn deep(places: &[Point<Camera>], by: f64, lever: Lever) -> Option<ScaleError> {
        let pose = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.4, 0.1, 0.2, -5.0].into());
        let seen = |at: &Point<Camera>| Observation {
            measured: UncertainPoint::isotropic(Point::new(at.coords.x, at.coords.y, by * at.coords.z), SIGMA),
            pixels: None,
            model: pose * *at,
            model_sigma: 0.0,
        };
        let data = Observations { points: places.iter().map(seen).collect(), edges: Vec::new(), rig: None };
        solved(&data, None, 1, |pose, terms| Ok(scale_error(&data.points, pose, terms, lever))).unwrap()
    }

    /// The corners of a box of 2 × 2 × 1 m along the optical axis have Σ d² = 8 · ¼ = 2 m², and no motion equals the
    /// stretch: σ = 2 mm/√2 m. The isotropic lever sees 2 of 18 m²: a ninth of the error.
    #[test]
    fn a_box_that_is_deeper_is_reported() {
        let corner = |k: usize| Point::new((k & 1) as f64 * 2.0, (k >> 1 & 1) as f64 * 2.0, 5.0 + (k >> 2 & 1) as f64);
        let corners: Vec<_> = (0..8).map(corner).collect();
        for by in [1.0, 1.05, 0.75] {
            let [depth, all] = [Lever::Depth, Lever::Isotropic].map(|lever| deep(&corners, by, lever).unwrap());
            assert!((depth.value - (by - 1.0)).abs() < 1e-9 && (all.value - (by - 1.0) / 9.0).abs() < 1e-9, "{by}");
            assert!((depth.sigma / (SIGMA / 2.0_f64.sqrt()) - 1.0).abs() < 1e-9, "{by}: {depth:?}");
        }
    }

    /// A square of 2 m tilted by θ about y: the rotation absorbs the stretch but for sin⁴ θ of its information. With Σ
    /// s² = 4 m² over the corners σ is 2 mm/(2 m · sin² θ). Face-on there is no information.
    #[test]
    fn a_plane_has_a_depth_error_by_its_tilt() {
        let square = |tilt: f64| {
            let corner = |k: usize| {
                let (s, t) = ((k & 1) as f64 * 2.0 - 1.0, (k >> 1) as f64 * 2.0 - 1.0);
                Point::new(s * tilt.cos(), t, 5.0 + s * tilt.sin())
            };
            deep(&[0, 1, 2, 3].map(corner), 1.0, Lever::Depth)
        };
        for tilt in [0.3_f64, 0.8] {
            let found = square(tilt).unwrap();
            let expected = SIGMA / (2.0 * tilt.sin().powi(2));
            assert!(found.value.abs() < 1e-9 && (found.sigma / expected - 1.0).abs() < 1e-6, "{tilt}: {found:?}");
        }
        assert_eq!(square(0.0), None);
    }

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
        solved(&data, None, 1, |pose, terms| Ok(scale_error(&data.points, pose, terms, Lever::Isotropic))).unwrap()
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
        let found = of_mean_variance(&points, &pose).unwrap();
        assert!((found.value - 0.015).abs() < 1e-3 && found.sigma < 1e-3, "{found:?}");
    }

    #[test]
    fn no_points_have_none() {
        let data = Observations { points: Vec::new(), edges: Vec::new(), rig: None };
        let pose = Transform::exp(&[0.0; 6].into());
        for lever in [Lever::Isotropic, Lever::Depth] {
            assert_eq!(scale_error(&data.points, &pose, &|_, _: &_| None, lever), None);
        }
    }
}
