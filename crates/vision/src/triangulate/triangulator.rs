//! Triangulators of a match.

use nalgebra::Matrix4;
use seafix_geometry::{MeasuredPoint, StereoRig, Triangulation, UncertainPixels, UncertainPoint, Untriangulable};

use crate::triangulate::rules::PointRules;

/// A triangulator: computes a point from a matched pair of pixels.
///
/// ```
/// # use nalgebra::{UnitQuaternion, Vector3};
/// # use seafix_geometry::{Pinhole, Transform};
/// use seafix_geometry::{Point, StereoRig, Triangulation, UncertainPixels, Untriangulable};
/// use seafix_vision::{PointRules, Triangulator};
///
/// /// The maximum-likelihood point.
/// #[derive(Debug, Default)]
/// struct MaximumLikelihood {
///     rules: PointRules,
/// }
///
/// impl Triangulator for MaximumLikelihood {
///     fn rules(&self) -> &PointRules {
///         &self.rules
///     }
///
///     fn point(&self, rig: &StereoRig, seen: &UncertainPixels) -> Result<Triangulation, Untriangulable> {
///         rig.triangulate(seen)
///     }
/// }
///
/// # let camera = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[]).unwrap();
/// # let right_from_left = Transform::new(UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0));
/// # let rig = StereoRig::new(camera, camera, right_from_left).unwrap();
/// let pixels = rig.project(&Point::new(0.3, -0.2, 3.0)).unwrap();
/// let mut cloud = Vec::new();
/// MaximumLikelihood::default().triangulate_into(&[UncertainPixels::independent(pixels, 0.1)], &rig, &mut cloud);
/// assert!((cloud[0].position.at.coords.z - 3.0).abs() < 1e-6);
/// ```
pub trait Triangulator: Send + Sync + std::fmt::Debug {
    /// The pixels' errors and the acceptance criteria.
    fn rules(&self) -> &PointRules;

    /// The point of two pixels, its covariance from theirs, and their disagreement across the epipolar line.
    ///
    /// # Errors
    /// [`Untriangulable`] if the pixels determine no point.
    fn point(&self, rig: &StereoRig, seen: &UncertainPixels) -> Result<Triangulation, Untriangulable>;

    /// Replaces `cloud` by the points in front of the cameras whose pairs pass the epipolar and the χ² test, in the
    /// order of `pairs`.
    fn triangulate_into(&self, pairs: &[UncertainPixels], rig: &StereoRig, cloud: &mut Vec<MeasuredPoint>) {
        cloud.clear();
        let confidence = self.rules().confidence;
        cloud.extend(pairs.iter().filter_map(|pair| self.measured(rig, pair, confidence)));
    }

    /// The point of one pair in front of the cameras, if the pair passes the epipolar test and the χ² test that a
    /// fraction `confidence` of good pairs passes.
    fn measured(&self, rig: &StereoRig, pair: &UncertainPixels, confidence: f64) -> Option<MeasuredPoint> {
        let PointRules { calibration_px, epipolar_px, max_depth, .. } = *self.rules();
        rig.epipolar_distance(&pair.at).filter(|&distance| distance <= epipolar_px)?;
        let calibration = Matrix4::identity() * (calibration_px * calibration_px);
        let pair = UncertainPixels { covariance: pair.covariance + calibration, ..*pair };
        let found = self.point(rig, &pair).ok()?;
        // The χ² distribution with one degree of freedom is P(x) = erf √(x/2).
        let likely = libm::erf((0.5 * found.disagreement).sqrt()) <= confidence;
        let kept = likely && found.point.coords.z <= max_depth;
        kept.then_some(MeasuredPoint {
            position: UncertainPoint { at: found.point, covariance: found.covariance },
            pixels: Some(pair),
        })
    }
}
