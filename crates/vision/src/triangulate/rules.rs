//! The error model of pixels and the acceptance criteria of points.

use seafix_component::{Settings, in_range};
use serde::{Deserialize, Serialize};

/// The settings of every triangulator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PointRules {
    /// Standard deviation (px) of a key point without a fitted corner, from image to image.
    pub sigma_px: f64,
    /// Standard deviation (px) of the offset of a key point without a fitted corner from its true corner.
    ///
    /// The offset is common to both images, so it affects directions and not disparities. Harris' maxima of 130 corners
    /// in 60 rendered pairs of a dive had an RMS offset of 0.87 px an axis and a disparity error of 0.13 px; fitted
    /// corners had 0.16 and 0.05 (`cargo test -p seafix-experiment located:: -- --ignored --nocapture`).
    pub peak_px: f64,
    /// Standard deviation (px) of the camera model's own error: calibration, lens, housing.
    ///
    /// It is added to each coordinate in both images: an alignment may be accurate to 0.01 px, the directions of its
    /// pixels are not.
    pub calibration_px: f64,
    /// Maximum distance from the epipolar line (px, Sampson distance).
    pub epipolar_px: f64,
    /// Fraction of good pairs that pass the χ² test of their epipolar disagreement; 1: no test.
    ///
    /// The test has one degree of freedom, so 0.997 is three standard deviations. It needs correct covariances.
    pub confidence: f64,
    /// Maximum depth of an accepted point (m).
    pub max_depth: f64,
}

impl Default for PointRules {
    fn default() -> Self {
        Self { sigma_px: 0.15, peak_px: 0.9, calibration_px: 0.15, epipolar_px: 1.5, confidence: 1.0, max_depth: 20.0 }
    }
}

impl PointRules {
    /// Checks the settings' ranges.
    ///
    /// # Errors
    /// The invalid setting, its value and its range.
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
