//! Lengths of a rig that no rig has: calibrations in millimetres or centimetres.

use std::path::Path;

use seafix_component::Fault;
use seafix_geometry::StereoRig;

/// The baselines (m) of stereo rigs: those in millimetres and centimetres are above, those in kilometres below.
const USUAL: std::ops::RangeInclusive<f64> = 1e-3..=10.0;

/// The doubt about a baseline (m) that no stereo rig has, with the likely unit; `None` for a usual one.
pub fn doubtful_baseline(baseline: f64) -> Option<(String, String)> {
    let guess = match baseline {
        // Cameras in one place, in any unit, are another fault.
        b if b < 1e-6 || USUAL.contains(&b) => return None,
        b if b >= 30.0 => format!("as millimetres it is {:.4} m: divide the translation by 1000", b * 1e-3),
        b if b > 1.0 => format!("as centimetres it is {:.4} m: divide the translation by 100", b * 1e-2),
        b => format!("as kilometres it is {:.4} m: give metres", b * 1e3),
    };
    Some((format!("units? a baseline of {baseline} m"), format!("lengths are in metres; {guess}")))
}

/// The fault of a rig whose baseline is not in metres.
pub fn unit_fault(rig: &StereoRig, file: &Path) -> Option<Fault> {
    let (what, remedy) = doubtful_baseline(rig.baseline())?;
    Some(Fault::new(what, file).remedy(remedy))
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};
    use seafix_geometry::{Pinhole, Transform};

    use super::*;

    #[test]
    fn a_baseline_in_millimetres_is_named() {
        let camera = Pinhole::new([640, 480], [500.0; 2], [320.0, 240.0], &[]).unwrap();
        let of = |baseline: f64| {
            let pose = Transform::new(UnitQuaternion::identity(), Vector3::new(-baseline, 0.0, 0.0));
            unit_fault(&StereoRig::new(camera, camera, pose).unwrap(), Path::new("a")).map(|fault| fault.to_string())
        };
        assert!(of(250.0).unwrap().starts_with("units? a baseline of 250 m in a"));
        assert!(
            of(250.0).unwrap().contains("as millimetres it is 0.2500 m") && of(12.0).unwrap().contains("centimetres")
        );
        assert_eq!((of(0.05), of(3.0)), (None, None));
    }
}
