//! What one stereo pair gave.

use super::{
    header::{TargetModel, TrialHeader},
    inputs::Inputs,
    inspection::PointOfInterest,
    line::Line,
    matrix::{Matrix3, Matrix4},
    navigation::NavigationRecord,
    target::TargetRecord,
};

/// One frame: what was seen, what was known, and what came of every attempted target.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameRecord {
    /// Number of the frame in its trial, from 0.
    pub frame: u64,
    /// Time of capture (ns).
    pub stamp_ns: u64,
    /// The left and the right image, where there are images.
    pub images: Option<[GreyImage; 2]>,
    /// All key points detected in the left image (u, v), in pixels.
    pub key_points: Vec<[f64; 2]>,
    /// The triangulated points.
    pub cloud: Vec<CloudPoint>,
    /// The measured straight edges; empty for a trial without edges.
    pub lines: Vec<Line>,
    /// The prior pose.
    pub prior: Option<PriorRecord>,
    /// The ground truth, if it is known.
    pub truth: Option<TruthRecord>,
    /// What came of each attempted target; a frame that attempted none has the one
    /// [`TargetRecord::not_attempted`].
    pub targets: Vec<TargetRecord>,
    /// Times of the stages that serve all targets.
    pub times: FrameTimes,
    /// What the method was given, to the last bit; `None` in logs that are older than it.
    pub inputs: Option<Box<Inputs>>,
    /// What the navigator knew, where the trial navigates between fixes.
    pub navigation: Option<Box<NavigationRecord>>,
    /// The points of interest that truly are in both images.
    pub poi: Vec<PointOfInterest>,
}

impl FrameRecord {
    /// What is known of the object of this name: by the header of the trial, or by the frame, whose problem may be about
    /// an object of its own.
    pub fn model<'a>(&'a self, header: &'a TrialHeader, object: &str) -> Option<&'a TargetModel> {
        let own = self.inputs.iter().filter_map(|inputs| Some(&inputs.problem.as_ref()?.model));
        header.targets.iter().chain(own).find(|model| model.id == object)
    }
}

/// An 8-bit grey image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GreyImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width · height` bytes, row by row.
    pub pixels: Vec<u8>,
}

/// One triangulated point.
#[derive(Debug, Clone, PartialEq)]
pub struct CloudPoint {
    /// Where it is, camera frame (m).
    pub at: [f64; 3],
    /// Its covariance (m²).
    pub covariance: Matrix3,
    /// Where the images show it, if it comes from images.
    pub pixels: Option<PixelPair>,
}

/// A place in both images (u, v), in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelPair {
    /// In the left image.
    pub left: [f64; 2],
    /// In the right image.
    pub right: [f64; 2],
}

/// The prior pose.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorRecord {
    /// The prior pose of the left camera.
    pub world_from_camera: Matrix4,
}

/// The ground truth.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthRecord {
    /// The left camera's true pose.
    pub world_from_camera: Matrix4,
    /// The true place of each target, by its id: `world_from_object`.
    pub world_from_object: Vec<(String, Matrix4)>,
    /// The feature points that both cameras really see.
    pub visible: Vec<VisiblePoint>,
}

/// A feature point that both cameras see, by target and its place in the target's list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VisiblePoint {
    /// Id of the target.
    pub object: String,
    /// Index into the target's points.
    pub point: u32,
}

/// Times of the stages that serve all targets (ms); `None` where a stage did not run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameTimes {
    /// Filters and detection, both images.
    pub detect_ms: Option<f64>,
    /// Location of the exact corners, both images.
    pub locate_ms: Option<f64>,
    /// Description, both images.
    pub describe_ms: Option<f64>,
    /// Matching.
    pub match_ms: Option<f64>,
    /// Alignment between the views.
    pub refine_ms: Option<f64>,
    /// Triangulation.
    pub triangulate_ms: Option<f64>,
    /// Odometry, its own cloud included.
    pub odometry_ms: Option<f64>,
    /// Which of the stages several trials share.
    pub shared: SharedStages,
}

/// The stages that were computed once for several trials. The time of each is that of the one computation, and stands in
/// every trial that uses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SharedStages {
    /// Filters, detection, location, description, matching, alignment and triangulation.
    pub front_end: bool,
    /// Candidates and search, of every target.
    pub search: bool,
    /// Odometry.
    pub odometry: bool,
}
