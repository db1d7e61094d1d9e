//! What a solver is given.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, StereoRig, Transform, UncertainPixels, UncertainPoint};

use crate::{Correspondence, ModelPoint};

/// One identified point: where it was measured and where the model has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Measured, camera frame.
    pub measured: UncertainPoint<Camera>,
    /// Where the two images show it, if it came from images.
    pub pixels: Option<UncertainPixels>,
    /// The model's place.
    pub model: Point<Object>,
    /// Standard deviation of each coordinate of the model's place (m).
    pub model_sigma: f64,
}

impl Observation {
    /// C·H − P: the residual (m, object frame) that `object_from_camera` leaves.
    pub fn residual(&self, object_from_camera: &Transform<Object, Camera>) -> Vector3<f64> {
        *object_from_camera * self.measured.at - self.model
    }

    /// The covariance (m²) of the residual's noise, camera axes: Σ_measured + σ_model² I, and the square of
    /// [`digits`](Self::digits), so that no point is known better than it is written.
    pub fn noise(&self) -> Matrix3<f64> {
        let digits = self.digits();
        self.measured.covariance + Matrix3::identity() * (self.model_sigma * self.model_sigma + digits * digits)
    }

    /// How well its coordinates can be known (m), whatever is said of their noise: a nanometre, and of coordinates beyond a
    /// thousand kilometres what rounding leaves of them.
    pub fn digits(&self) -> f64 {
        const FLOOR: f64 = 1e-9;
        FLOOR.max(4.0 * f64::EPSILON * self.measured.at.coords.amax().max(self.model.coords.amax()))
    }

    /// Whether every coordinate in it is finite.
    pub fn is_finite(&self) -> bool {
        // Nought times a number is nought where it is finite and not a number where it is not: six tests in one.
        let (seen, known) = (&self.measured.at.coords, &self.model.coords);
        (seen.x * 0.0 + seen.y * 0.0 + seen.z * 0.0) + (known.x * 0.0 + known.y * 0.0 + known.z * 0.0) == 0.0
    }

    /// Whether its noise is.
    pub fn has_finite_noise(&self) -> bool {
        self.model_sigma.is_finite() && self.measured.covariance.iter().all(|x| x.is_finite())
    }
}

/// All identified points of one target, and the rig that saw them if there is one.
#[derive(Debug, Clone)]
pub struct Observations<'a> {
    /// The points, in the order of the model.
    pub points: Vec<Observation>,
    /// The rig.
    pub rig: Option<&'a StereoRig>,
}

impl<'a> Observations<'a> {
    /// What the identified pairs say.
    ///
    /// # Panics
    /// When a pair's index is out of range.
    pub fn of(
        pairs: &[Correspondence],
        model: &[ModelPoint],
        cloud: &[MeasuredPoint],
        rig: Option<&'a StereoRig>,
    ) -> Self {
        let points = pairs.iter().map(|pair| {
            let (known, seen) = (&model[pair.model], &cloud[pair.cloud]);
            Observation { measured: seen.position, pixels: seen.pixels, model: known.at, model_sigma: known.sigma }
        });
        Self { points: points.collect(), rig }
    }

    /// The residual C·H − P of each point (m).
    pub fn residuals(&self, object_from_camera: &Transform<Object, Camera>) -> Vec<Vector3<f64>> {
        self.points.iter().map(|point| point.residual(object_from_camera)).collect()
    }

    /// Root mean square of the residuals C·H − P over all points (m): the paper's measure.
    pub fn residual_rms(&self, object_from_camera: &Transform<Object, Camera>) -> f64 {
        let sum: f64 = self.points.iter().map(|point| point.residual(object_from_camera).norm_squared()).sum();
        (sum / self.points.len().max(1) as f64).sqrt()
    }
}
