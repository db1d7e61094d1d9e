//! Durations of the pipeline's stages.

use std::time::Instant;

/// Durations of the stages that serve all targets of a frame (ms); `None` where a stage did not run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameTimes {
    /// Filters and detection, both images.
    pub detect_ms: Option<f64>,
    /// Corner location, both images.
    pub locate_ms: Option<f64>,
    /// Description, both images.
    pub describe_ms: Option<f64>,
    /// Matching.
    pub match_ms: Option<f64>,
    /// Alignment of the right image to the left.
    pub refine_ms: Option<f64>,
    /// Triangulation.
    pub triangulate_ms: Option<f64>,
}

/// Durations of the stages of one target (ms); `None` where a stage did not run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TargetTimes {
    /// Selection of the candidates.
    pub candidates_ms: Option<f64>,
    /// Search.
    pub search_ms: Option<f64>,
    /// Solver and acceptance tests, and a joint fix.
    pub solve_ms: Option<f64>,
    /// All stages, the common ones included.
    pub total_ms: Option<f64>,
}

/// The result of `work` and its duration (ms).
pub(crate) fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, milliseconds(start))
}

/// Milliseconds since an instant.
pub(crate) fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
