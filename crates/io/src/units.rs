//! Lengths of a rig that no rig has: baselines in millimetres or centimetres, focal lengths in millimetres.

use std::path::Path;

use seafix_component::Fault;
use seafix_geometry::{LensModel, Pinhole, StereoRig};

/// The baselines (m) of stereo rigs: those in millimetres and centimetres are above, those in kilometres below.
const USUAL: std::ops::RangeInclusive<f64> = 1e-3..=10.0;

/// The doubt about a baseline (m) that no stereo rig has, with the likely unit; `None` for a usual one.
pub fn doubtful_baseline(baseline: f64) -> Option<(String, String)> {
    let guess = match baseline {
        // Cameras in one place, in any unit, are another fault.
        b if b < 1e-6 || USUAL.contains(&b) => return None,
        b if b >= 30.0 => format!("as millimetres it is {:.4} m: divide the translation by 1000", b * 1e-3),
        b if b > 1.0 => format!("as centimetres it is {:.4} m: divide the translation by 100", b * 1e-2),
        b => format!(
            "as kilometres it is {:.4} m: give metres; P[3] of ROS is −fx·baseline, in metres times pixels",
            b * 1e3
        ),
    };
    Some((format!("units? a baseline of {baseline} m"), format!("lengths are in metres; {guess}")))
}

/// The doubt about a focal length (px) of a perspective lens for images of this width (px), with the likely unit.
///
/// Half the field of view is atan(width / 2 f). Perspective lenses end near 60°, and at 80° an image would be stretched
/// 33 times at its border, so that a focal length below 0.088 widths is one in another unit.
pub(crate) fn doubtful_focal(focal: f64, width: u32) -> Option<(String, String)> {
    let half = (0.5 * f64::from(width) / focal).atan().to_degrees();
    (focal > 0.0 && half > 80.0).then(|| {
        let what = format!("units? {focal} px in images {width} px wide is a field of view of {:.1}°", 2.0 * half);
        (what, "focal lengths are in pixels: divide millimetres by the pitch of the pixels".to_owned())
    })
}

/// The fault of a rig whose baseline is not in metres, or whose focal lengths are not in pixels.
pub fn unit_fault(rig: &StereoRig, file: &Path) -> Option<Fault> {
    let perspective = |camera: &&Pinhole| camera.distortion().model() == LensModel::Pinhole;
    let doubtful = |camera: &Pinhole| doubtful_focal(camera.focal()[0], camera.size()[0]);
    if let Some((what, remedy)) = [rig.left(), rig.right()].into_iter().filter(perspective).find_map(doubtful) {
        return Some(Fault::new(what, file).remedy(remedy));
    }
    let (what, remedy) = doubtful_baseline(rig.baseline())?;
    Some(Fault::new(what, file).remedy(remedy))
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};
    use seafix_geometry::Transform;

    use super::*;

    #[test]
    fn a_focal_length_in_millimetres_is_named() {
        assert!(doubtful_focal(6.0, 1024).unwrap().0.starts_with("units? 6 px in images 1024 px wide"));
        assert_eq!((doubtful_focal(500.0, 1024), doubtful_focal(100.0, 1024)), (None, None));
    }

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
