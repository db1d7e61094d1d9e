//! From matched pixels to measured points.

use nalgebra::Matrix4;
use seafix_component::in_range;
use seafix_geometry::{MeasuredPoint, StereoRig, UncertainPixels, UncertainPoint};
use serde::{Deserialize, Serialize};

/// What the triangulation is told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Triangulator {
    /// Standard deviation of the coordinates of a key point that no corner was fitted to (px).
    pub sigma_px: f64,
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

impl Default for Triangulator {
    fn default() -> Self {
        Self { sigma_px: 0.15, calibration_px: 0.15, epipolar_px: 1.5, confidence: 1.0, max_depth: 20.0 }
    }
}

impl Triangulator {
    /// Whether the settings can be.
    ///
    /// # Errors
    /// The setting that is out of its range, its value, and the range.
    pub fn check(&self) -> Result<(), String> {
        let Self { sigma_px, calibration_px, epipolar_px, confidence, max_depth } = *self;
        in_range(sigma_px > 0.0 && sigma_px <= 100.0, "sigma-px", sigma_px, "more than 0, at most 100 (px)")?;
        let calibrated = (0.0..=100.0).contains(&calibration_px);
        in_range(calibrated, "calibration-px", calibration_px, "a number from 0 to 100 (px)")?;
        let band = epipolar_px > 0.0 && epipolar_px <= 1000.0;
        in_range(band, "epipolar-px", epipolar_px, "more than 0, at most 1000 (px)")?;
        let share = confidence > 0.0 && confidence <= 1.0;
        in_range(share, "confidence", confidence, "more than 0, at most 1 (no test)")?;
        in_range(max_depth > 0.0 && max_depth.is_finite(), "max-depth", max_depth, "a positive depth (m)")
    }
}

impl Triangulator {
    /// Replaces `cloud` by the points whose two pixels pass the epipolar and the χ² test and meet in front of
    /// the cameras, in the order of `pairs`.
    pub fn triangulate_into(&self, pairs: &[UncertainPixels], rig: &StereoRig, cloud: &mut Vec<MeasuredPoint>) {
        cloud.clear();
        let near = pairs
            .iter()
            .filter(|pair| rig.epipolar_distance(&pair.at).is_some_and(|distance| distance <= self.epipolar_px));
        cloud.extend(near.filter_map(|pair| {
            let calibration = Matrix4::identity() * (self.calibration_px * self.calibration_px);
            let pair = UncertainPixels { covariance: pair.covariance + calibration, ..*pair };
            let found = rig.triangulate(&pair).ok()?;
            // The distribution of χ² with one degree of freedom is P(x) = erf √(x/2).
            let likely = libm::erf((0.5 * found.disagreement).sqrt()) <= self.confidence;
            let kept = likely && found.point.coords.z <= self.max_depth;
            kept.then_some(MeasuredPoint {
                position: UncertainPoint { at: found.point, covariance: found.covariance },
                pixels: Some(pair),
            })
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};
    use seafix_geometry::{Pinhole, Point, Transform};

    #[test]
    fn three_standard_deviations_off_the_line_are_too_many() {
        let camera = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[]).unwrap();
        let right = Transform::new(UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0));
        let rig = StereoRig::new(camera, camera, right).unwrap();
        let kept = |confidence, sigmas: f64| {
            let mut at = rig.project(&Point::new(0.3, -0.2, 3.0)).unwrap();
            // Between two rows that err by 0.1 px each.
            at.right.v += sigmas * 0.1 * 2f64.sqrt();
            let (settings, mut cloud) =
                (Triangulator { confidence, calibration_px: 0.0, ..Triangulator::default() }, Vec::new());
            settings.triangulate_into(&[UncertainPixels::independent(at, 0.1)], &rig, &mut cloud);
            cloud.len() == 1
        };
        // P(χ² ≤ 9) = 0.9973.
        assert!(kept(0.9973, 2.99) && !kept(0.9973, 3.01));
        assert!(kept(1.0, 5.0), "no test");
    }
}
