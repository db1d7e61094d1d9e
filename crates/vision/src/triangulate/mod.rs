//! Triangulators: from matched pixels to measured points.

mod methods;
mod rules;
mod triangulator;

pub use methods::{Linear, Midpoint, Optimal};
pub use rules::PointRules;
use seafix_component::{Choice, Component, Registry, entry};
use serde::Deserializer;
pub use triangulator::Triangulator;

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
    use seafix_geometry::{StereoRig, UncertainPixels};

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
