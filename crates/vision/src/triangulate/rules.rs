//! What pixels err by, and which points are kept.

use seafix_component::in_range;
use serde::{Deserialize, Serialize};

/// What every triangulation is told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PointRules {
    /// Standard deviation of the coordinates of a key point that no corner was fitted to, from image to image (px).
    pub sigma_px: f64,
    /// How far such a key point lies off the corner that it means, in both images alike (standard deviation, px): directions
    /// suffer, disparities do not. Of 130 corners in 60 rendered pairs of a dive Harris' maxima were .87 px off an axis
    /// (RMS) and their disparities .13; fitted corners .16 and .05 (`cargo test -p seafix-experiment located:: -- --ignored --nocapture`).
    pub peak_px: f64,
    /// Standard deviation of what the camera model leaves unexplained (px): calibration, lens, housing. It
    /// comes to every coordinate in both images: an alignment may be good to a hundredth of a pixel, the
    /// directions that belong to it are not.
    pub calibration_px: f64,
    /// Largest distance from the epipolar line (px, Sampson).
    pub epipolar_px: f64,
    /// Share of good pairs that the χ² test of their disagreement across the epipolar line keeps, one degree of
    /// freedom: 0.997 is three standard deviations. It asks for covariances that are right. 1: no test.
    pub confidence: f64,
    /// Largest depth worth keeping (m).
    pub max_depth: f64,
}

impl Default for PointRules {
    fn default() -> Self {
        Self { sigma_px: 0.15, peak_px: 0.9, calibration_px: 0.15, epipolar_px: 1.5, confidence: 1.0, max_depth: 20.0 }
    }
}

impl PointRules {
    /// Whether the settings can be.
    ///
    /// # Errors
    /// The setting that is out of its range, its value, and the range.
    pub(super) fn check(&self) -> Result<(), String> {
        let Self { sigma_px, peak_px, calibration_px, epipolar_px, confidence, max_depth } = *self;
        in_range(sigma_px > 0.0 && sigma_px <= 100.0, "sigma-px", sigma_px, "more than 0, at most 100 (px)")?;
        let peaked = (0.0..=100.0).contains(&peak_px);
        in_range(peaked, "peak-px", peak_px, "a number from 0 to 100 (px)")?;
        let calibrated = (0.0..=100.0).contains(&calibration_px);
        in_range(calibrated, "calibration-px", calibration_px, "a number from 0 to 100 (px)")?;
        let band = epipolar_px > 0.0 && epipolar_px <= 1000.0;
        in_range(band, "epipolar-px", epipolar_px, "more than 0, at most 1000 (px)")?;
        let fraction = confidence > 0.0 && confidence <= 1.0;
        in_range(fraction, "confidence", confidence, "more than 0, at most 1 (no test)")?;
        in_range(max_depth > 0.0 && max_depth.is_finite(), "max-depth", max_depth, "a positive depth (m)")
    }
}
