//! The input of a solver.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{
    Camera, MeasuredLine, MeasuredPoint, Object, Point, StereoRig, Transform, UncertainPixels, UncertainPoint,
};

use crate::{
    problem::Correspondence,
    site::{edge::ModelEdge, model::ModelPoint},
};

/// An identified point: its measurement and its model coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// The measured point, camera frame.
    pub measured: UncertainPoint<Camera>,
    /// The pixels in both images; `None` for a point that does not come from images.
    pub pixels: Option<UncertainPixels>,
    /// The model point, object frame.
    pub model: Point<Object>,
    /// The standard deviation of each model coordinate (m).
    pub model_sigma: f64,
}

impl Observation {
    /// The residual C·H − P (m, object frame) at the pose `object_from_camera`.
    pub fn residual(&self, object_from_camera: &Transform<Object, Camera>) -> Vector3<f64> {
        *object_from_camera * self.measured.at - self.model
    }

    /// The covariance (m²) of the residual's noise, camera axes: Σ_measured + σ_model² I + [`digits`](Self::digits)² I.
    ///
    /// The last term limits the precision of a point to that of its coordinates.
    pub fn noise(&self) -> Matrix3<f64> {
        let digits = self.digits();
        self.measured.covariance + Matrix3::identity() * (self.model_sigma * self.model_sigma + digits * digits)
    }

    /// The numerical precision of the coordinates (m): a nanometre, or the rounding error beyond a thousand kilometres.
    pub fn digits(&self) -> f64 {
        const FLOOR: f64 = 1e-9;
        FLOOR.max(4.0 * f64::EPSILON * self.measured.at.coords.amax().max(self.model.coords.amax()))
    }

    /// Whether every coordinate is finite.
    pub fn is_finite(&self) -> bool {
        // Zero times a number is zero if it is finite and NaN otherwise: six tests in one.
        let (seen, known) = (&self.measured.at.coords, &self.model.coords);
        (seen.x * 0.0 + seen.y * 0.0 + seen.z * 0.0) + (known.x * 0.0 + known.y * 0.0 + known.z * 0.0) == 0.0
    }

    /// Whether the noise is finite.
    pub fn has_finite_noise(&self) -> bool {
        self.model_sigma.is_finite() && self.measured.covariance.iter().all(|x| x.is_finite())
    }
}

/// An identified edge: its measurement and its model ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeObservation {
    /// The measured line, camera frame.
    pub measured: MeasuredLine,
    /// The ends of the model edge, object frame.
    pub model: [Point<Object>; 2],
    /// The standard deviation of each coordinate of both ends (m); ends and points at one place share one error.
    pub model_sigmas: [f64; 2],
}

impl EdgeObservation {
    /// Whether every coordinate and standard deviation is finite.
    pub fn is_finite(&self) -> bool {
        let ends = self.measured.ends.iter().flat_map(|end| end.coords.iter());
        let model = self.model.iter().flat_map(|end| end.coords.iter());
        ends.chain(model).chain(&self.model_sigmas).all(|x| x.is_finite())
    }
}

/// The identified points and edges of one target, with the stereo rig if there is one.
#[derive(Debug, Clone)]
pub struct Observations<'a> {
    /// The points, in the order of the model.
    pub points: Vec<Observation>,
    /// The edges, in the order of the model.
    pub edges: Vec<EdgeObservation>,
    /// The stereo rig.
    pub rig: Option<&'a StereoRig>,
}

impl<'a> Observations<'a> {
    /// The observations of the identified pairs.
    ///
    /// # Panics
    ///
    /// If an index of a pair is out of range.
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
        Self { points: points.collect(), edges: Vec::new(), rig }
    }

    /// The observations with these identified edges in addition; a pair is (model edge, measured line).
    ///
    /// # Panics
    ///
    /// If an index of a pair is out of range.
    #[must_use]
    pub fn with_edges(
        mut self,
        pairs: &[Correspondence],
        edges: &[ModelEdge],
        model: &[ModelPoint],
        lines: &[MeasuredLine],
    ) -> Self {
        self.edges.extend(pairs.iter().map(|pair| EdgeObservation {
            measured: lines[pair.cloud],
            model: edges[pair.model].places(model),
            model_sigmas: edges[pair.model].sigmas(model),
        }));
        self
    }

    /// The residual C·H − P of each point (m).
    pub fn residuals(&self, object_from_camera: &Transform<Object, Camera>) -> Vec<Vector3<f64>> {
        self.points.iter().map(|point| point.residual(object_from_camera)).collect()
    }

    /// The RMS of the residuals C·H − P over all points (m). Over correctly identified points it is the fit RMS, the
    /// paper's measure.
    pub fn residual_rms(&self, object_from_camera: &Transform<Object, Camera>) -> f64 {
        let sum: f64 = self.points.iter().map(|point| point.residual(object_from_camera).norm_squared()).sum();
        (sum / self.points.len().max(1) as f64).sqrt()
    }
}
