//! Triangulators: from matched pixels to measured points.

mod methods;
mod rules;

pub use methods::{Linear, Midpoint, Optimal};
use nalgebra::Matrix4;
pub use rules::PointRules;
use seafix_component::{Choice, Component, Registry, entry};
use seafix_geometry::{MeasuredPoint, StereoRig, Triangulation, UncertainPixels, UncertainPoint, Untriangulable};
use serde::Deserializer;

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
        let PointRules { calibration_px, epipolar_px, confidence, max_depth, .. } = *self.rules();
        let near =
            pairs.iter().filter(|pair| rig.epipolar_distance(&pair.at).is_some_and(|distance| distance <= epipolar_px));
        cloud.extend(near.filter_map(|pair| {
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
        }));
    }
}

/// The registry of triangulators.
pub static TRIANGULATORS: Registry<dyn Triangulator> =
    Registry::new("triangulator", &[entry!(Linear), entry!(Midpoint), entry!(Optimal)]);

/// Deserialises the choice of a triangulator; settings without a name are those of `optimal`.
///
/// # Errors
/// A value that is neither a name nor a table.
pub fn read_triangulator<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Choice, D::Error> {
    Choice::deserialize_or(deserializer, Optimal::NAME)
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
            // The difference of two rows with an error of 0.1 px each.
            at.right.v += sigmas * 0.1 * 2f64.sqrt();
            let (rules, mut cloud) =
                (PointRules { confidence, calibration_px: 0.0, ..PointRules::default() }, Vec::new());
            Optimal(rules).triangulate_into(&[UncertainPixels::independent(at, 0.1)], &rig, &mut cloud);
            cloud.len() == 1
        };
        // P(χ² ≤ 9) = 0.9973.
        assert!(kept(0.9973, 2.99) && !kept(0.9973, 3.01));
        assert!(kept(1.0, 5.0), "a confidence of 1 disables the test");
    }
}
