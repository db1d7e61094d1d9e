//! What a pipeline computes from one sensor frame.

use std::sync::Arc;

use seafix_geometry::{MeasuredLine, MeasuredPoint, StereoRig};
use seafix_referencing::{Candidates, Gathered, Identification, Rejected, Target};
use seafix_vision::Keypoint;

use crate::{
    sensor_frame::SensorFrame,
    times::{FrameTimes, TargetTimes},
};

/// The result of the pipeline for one sensor frame.
#[derive(Debug, Default)]
pub struct FrameResult {
    /// The key points of the left image.
    pub keypoints: Arc<[Keypoint]>,
    /// The triangulated points, in the camera's frame.
    pub cloud: Arc<[MeasuredPoint]>,
    /// The measured straight edges, in the camera's frame.
    pub lines: Arc<[MeasuredLine]>,
    /// One attempt for each target in view.
    pub attempts: Vec<TargetAttempt>,
    /// The points that a joint fix takes from objects without a fix of their own.
    pub gathered: Gathered,
    /// The durations of the stages that serve all targets.
    pub times: FrameTimes,
}

/// The result of the search for one target.
#[derive(Debug)]
pub struct TargetAttempt {
    /// The index of the target.
    pub target: usize,
    /// The candidates of Stage 1.
    pub candidates: Candidates,
    /// The outcome with its pairs and integrity.
    pub answer: seafix_referencing::Attempt,
    /// The result of the joint fix as a sentence; `None` without one.
    pub joint: Option<String>,
    /// The durations of this target's stages.
    pub times: TargetTimes,
}

impl TargetAttempt {
    /// An attempt with its durations (ms): candidates, search and solution, then all stages of this target.
    pub(crate) fn new(
        target: usize,
        candidates: Candidates,
        answer: seafix_referencing::Attempt,
        [candidates_ms, search_ms, solve_ms]: [Option<f64>; 3],
        total_ms: f64,
    ) -> Self {
        let times = TargetTimes { candidates_ms, search_ms, solve_ms, total_ms: Some(total_ms) };
        Self { target, candidates, answer, joint: None, times }
    }
}

/// The cloud of one frame. It depends on the front end, and on the priors of the targets if the front end is guided;
/// trials that agree in these share it.
#[derive(Debug)]
pub struct Cloud {
    /// The key points of the left image.
    pub(crate) keypoints: Arc<[Keypoint]>,
    pub(crate) points: Arc<[MeasuredPoint]>,
    pub(crate) lines: Arc<[MeasuredLine]>,
    pub(crate) times: FrameTimes,
    /// The duration of all stages together (ms).
    pub(crate) total_ms: f64,
}

impl Cloud {
    /// The points of matched key points, then the corners of outlines and of straight edges, which may replace some.
    pub fn points(&self) -> &[MeasuredPoint] {
        &self.points
    }

    /// Features that were measured elsewhere.
    pub(crate) fn given(points: &[MeasuredPoint], lines: &[MeasuredLine]) -> Self {
        let times = FrameTimes::default();
        Self { keypoints: Arc::default(), points: points.into(), lines: lines.into(), times, total_ms: 0.0 }
    }
}

/// The candidates of one target and the result of the search among them. Both are independent of the solver, so that
/// trials with different solvers share them.
#[derive(Debug, Clone)]
pub struct SearchResult {
    pub(crate) candidates: Candidates,
    /// The candidates of each edge; empty without edges.
    pub(crate) edges: Vec<Vec<usize>>,
    pub(crate) found: Result<Identification, Rejected>,
    /// The durations of candidate selection and search (ms).
    pub(crate) spent: [f64; 2],
}

/// One frame with its cloud, and the targets to search for.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The measurements and their prior.
    pub sensor_frame: &'a SensorFrame,
    /// The cloud of these measurements.
    pub cloud: &'a Cloud,
    /// The targets.
    pub targets: &'a [Target],
    /// The stereo rig.
    pub rig: &'a StereoRig,
}
