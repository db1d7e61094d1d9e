//! The input of the pipeline at one instant.

use std::sync::Arc;

use seafix_geometry::{Camera, Covariance6, MeasuredLine, MeasuredPoint, Transform, World};
use seafix_navigation::Reading as SensorReading;
use seafix_referencing::{Prior, Target, problem_file::CoherenceProblem};
use seafix_vision::Image;

/// The measurements of one instant and the prior of its pose.
///
/// A frame holds everything that a method may use. It holds no ground truth.
#[derive(Debug, Clone)]
pub struct SensorFrame {
    /// The time (ns).
    pub stamp_ns: u64,
    /// The stereo pair or the cloud.
    pub frame_data: FrameData,
    /// The prior pose of the left camera in the world, if one is known.
    pub prior: Option<PosePrior>,
    /// Correspondences or a coherence problem supplied with the data.
    pub hints: Hints,
    /// The readings of the navigation sensors since the previous frame, in the order of arrival.
    pub readings: Vec<SensorReading>,
}

impl SensorFrame {
    /// The prior pose relative to each target; `None` without a prior or without a pose of the target in the world.
    pub fn target_priors(&self, targets: &[Target]) -> Vec<Option<Prior>> {
        let prior = |target: &Target| {
            let world = self.prior.as_ref()?;
            target.prior(&world.world_from_camera, &world.covariance)
        };
        targets.iter().map(prior).collect()
    }
}

/// Knowledge about the correspondences that the data supply.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Hints {
    /// No knowledge.
    #[default]
    Nothing,
    /// The label of each cloud point as (object, point) indices, each at most once. No search runs.
    Labels(Vec<(usize, usize)>),
    /// A coherence problem with tolerance, candidates and prior of its own. The settings `gate` and `tolerance` of
    /// the pipeline do not apply.
    Problem(Arc<CoherenceProblem>),
}

/// The cameras' part of a sensor frame.
#[derive(Debug, Clone)]
pub enum FrameData {
    /// A stereo pair: the left and the right image.
    Stereo(Image, Image),
    /// A cloud of measured points (camera frame, m) without images.
    Points(Vec<MeasuredPoint>),
    /// A cloud of measured points and measured straight edges (camera frame, m) without images.
    Features(Vec<MeasuredPoint>, Vec<MeasuredLine>),
}

/// A prior pose of the left camera in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosePrior {
    /// The pose.
    pub world_from_camera: Transform<World, Camera>,
    /// The covariance of ξ = (φ, ρ) in `T_true = T · Exp(ξ)`: rotation (rad) first, then translation (m), both along the
    /// axes of the camera.
    pub covariance: Covariance6<World, Camera>,
}

impl PosePrior {
    /// A prior with equal standard deviations on all axes: `attitude` (rad) and `position` (m).
    ///
    /// ```
    /// use seafix::{PosePrior, geometry::Transform};
    ///
    /// let prior = PosePrior::isotropic(Transform::identity(), 0.5_f64.to_radians(), 0.1);
    /// assert!((prior.covariance.position_sigma() - 0.1).abs() < 1e-12);
    /// ```
    pub fn isotropic(world_from_camera: Transform<World, Camera>, attitude: f64, position: f64) -> Self {
        Self { world_from_camera, covariance: Covariance6::isotropic(attitude, position) }
    }
}
