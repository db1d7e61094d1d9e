//! What a method was given, to the last bit.

use super::{
    header::TargetModel,
    line::EdgePair,
    matrix::{Matrix3, Matrix4, Matrix6},
};

/// The exact inputs of the method and the ground truth of a frame, as far as [`FrameRecord`](super::FrameRecord) lacks them;
/// a replay needs them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Inputs {
    /// The prior pose and its covariance.
    pub prior: Option<(ExactPose, Matrix6)>,
    /// For each point of the cloud with pixels, in order, their covariance (px²).
    pub pixel_covariances: Vec<Matrix4>,
    /// The label of each cloud point, if the points are labelled: the object and the point.
    pub names: Option<Vec<SitePoint>>,
    /// An identification problem that states its own candidates and tolerance.
    pub problem: Option<ProblemRecord>,
    /// The ground truth.
    pub truth: Option<TrueState>,
    /// Whether the logged images are bitwise those of the method.
    pub exact_images: bool,
    /// The sensor readings since the previous frame, in order of arrival.
    pub readings: Vec<SensorReading>,
}

/// A reading of a navigation sensor, body frame.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorReading {
    /// `doppler`: velocity over ground (m/s); `gyro`: rate of turn (rad/s).
    pub device: String,
    /// When it was so (ns).
    pub stamp_ns: u64,
    /// What it says.
    pub value: [f64; 3],
    /// The covariance of its noise.
    pub covariance: Matrix3,
}

/// A rigid motion `a_from_b` without rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactPose {
    /// The rotation as a quaternion (x, y, z, w).
    pub rotation: [f64; 4],
    /// The translation (m).
    pub translation: [f64; 3],
}

/// A point of the site by the indices of its object and of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SitePoint {
    /// Index of the object.
    pub object: u32,
    /// Index of the point in the object.
    pub point: u32,
}

/// An identification problem about an object of its own, which no other frame has and the header does not know.
#[derive(Debug, Clone, PartialEq)]
pub struct ProblemRecord {
    /// The object.
    pub model: TargetModel,
    /// Distances that differ by no more agree (m).
    pub delta: f64,
    /// The prior pose, object from camera, and the half-size of the gates about it (m).
    pub prior: Option<(ExactPose, f64)>,
    /// The only pairs (model, cloud) to consider.
    pub putative: Option<Vec<[u32; 2]>>,
    /// The straight edges; the measured lines are those of the frame.
    pub edges: Vec<ProblemEdge>,
    /// The only pairs (edge, line) to consider.
    pub putative_edges: Option<Vec<EdgePair>>,
}

/// A straight edge of a problem.
#[derive(Debug, Clone, PartialEq)]
pub struct ProblemEdge {
    /// Its ends, object frame (m).
    pub ends: [[f64; 3]; 2],
    /// The model points at its ends; `None` for a place of its own.
    pub points: [Option<u32>; 2],
}

/// What the judge knew.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueState {
    /// The left camera.
    pub world_from_camera: ExactPose,
    /// Objects, by index, that are not where the survey has them; `None` where nobody knows where they are.
    pub moved: Vec<(u32, Option<ExactPose>)>,
    /// The points that both cameras see, where that is known.
    pub visible: Option<Vec<SitePoint>>,
    /// The Cramér–Rao bound on the pose relative to the object of this index.
    pub bound: Option<(u32, Matrix6)>,
    /// The answer to an identification problem.
    pub answer: Option<AnswerRecord>,
}

/// The answer to an identification problem, and what the best fit could do.
#[derive(Debug, Clone, PartialEq)]
pub struct AnswerRecord {
    /// The true pairs (model, cloud).
    pub pairs: Vec<[u32; 2]>,
    /// RMS over all model points of where the least-squares pose of the pairs misplaces them (m).
    pub ideal_rms: Option<f64>,
    /// Whether putative pairs were given.
    pub is_putative: bool,
}
