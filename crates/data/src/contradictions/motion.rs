//! A truth judged by odometry, where there is no site to judge it by.
//!
//! Odometry has errors of its own, so that a difference alone is no fault: a known mistake of the truth or of the
//! calibration must explain it.

use std::path::Path;

use seafix_component::Fault;
use seafix_geometry::{Body, Camera, StereoRig, Transform, World};

use super::{poses::mistakes, rig_mistakes::rig_mistakes, trajectories::motions_apart};

type Pose = Transform<World, Camera>;

/// The part of the motion that sound odometry stays below.
const SOUND: f64 = 0.03;
/// The factor by which a mistake, undone, must reduce the difference.
const CLEAR: f64 = 4.0;

/// The fault of the `truth` of successive pairs that contradicts their `odometry` with the rig, if a known mistake
/// explains it. The odometry is `None` where it breaks.
pub(crate) fn motion_fault(
    truth: &[Pose],
    rig: &StereoRig,
    body_from_camera: &Transform<Body, Camera>,
    odometry: &dyn Fn(&StereoRig) -> Option<Vec<Pose>>,
    file: &Path,
) -> Option<Fault> {
    let motion = odometry(rig)?;
    let given = motions_apart(truth, &motion, true).filter(|given| *given > SOUND)?;
    let of_truth = mistakes(body_from_camera).into_iter().filter_map(|mistake| {
        let undone: Vec<Pose> = truth.iter().map(|pose| (mistake.undo)(pose)).collect();
        Some((motions_apart(&undone, &motion, true)?, mistake.name, mistake.remedy))
    });
    let of_rig = rig_mistakes(rig).into_iter().filter_map(|mistake| {
        let left = motions_apart(truth, &odometry(&mistake.rig)?, true)?;
        Some((left, mistake.name.to_owned(), mistake.remedy))
    });
    let (left, name, remedy) = of_truth.chain(of_rig).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (left < SOUND && left * CLEAR < given).then(|| {
        let percent = |part: f64| format!("{:.1} %", 100.0 * part);
        let value =
            format!("they differ by {} of the motion (median), and by {} {name}", percent(given), percent(left));
        Fault::new("a truth that contradicts the images' odometry", file).value(value).remedy(remedy)
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};
    use seafix_geometry::Pinhole;

    use super::*;

    fn rig(principal: [f64; 2]) -> StereoRig {
        let camera = Pinhole::new([640, 480], [520.0; 2], principal, &[]).unwrap();
        StereoRig::new(camera, camera, Transform::new(UnitQuaternion::identity(), Vector3::new(-0.12, 0.0, 0.0)))
            .unwrap()
    }

    fn walk() -> Vec<Pose> {
        let pose = |k: u32| {
            let t = f64::from(k);
            let turn = UnitQuaternion::from_euler_angles(0.03 * t, 0.5 * (0.2 * t).sin(), 0.05 * t);
            Transform::new(turn, Vector3::new(0.06 * t, 0.1 * (0.3 * t).sin(), 0.03 * t))
        };
        (0..24).map(pose).collect()
    }

    /// What is said if the truth is `wrong`, and if odometry drifts by `drift` with the rig of this principal point.
    fn said(wrong: &dyn Fn(&Pose) -> Pose, principal: [f64; 2], drift: f64) -> Option<String> {
        let truth: Vec<Pose> = walk().iter().map(wrong).collect();
        // Rays of an exchanged principal point lean to the side: a motion forward seems to be one to the side, too.
        let odometry = |other: &StereoRig| {
            let lean = (other.left().principal()[0] - 319.5) / 520.0;
            let see = |pose: &Pose| {
                let t = pose.translation();
                Transform::new(pose.rotation(), (1.0 + drift) * Vector3::new(t.x - lean * t.z, t.y + lean * t.z, t.z))
            };
            Some(walk().iter().map(see).collect())
        };
        let fault = motion_fault(&truth, &rig(principal), &Transform::identity(), &odometry, Path::new("d.toml"));
        fault.map(|fault| fault.to_string())
    }

    /// Fails if drift, or another difference that no mistake explains, is a fault.
    #[test]
    fn drift_is_no_fault() {
        assert_eq!(said(&|pose| *pose, [319.5, 239.5], 0.01), None);
        assert_eq!(said(&|pose| *pose, [319.5, 239.5], 0.3), None);
        let world = Transform::<World, World>::exp(&[0.3, 0.1, 2.0, 5.0, -3.0, 1.0].into());
        assert_eq!(said(&|pose| world * *pose, [319.5, 239.5], 0.01), None);
    }

    #[test]
    fn mistakes_of_truth_and_rig_are_named() {
        let sound = [319.5, 239.5];
        let inverse = said(&|pose| pose.inverse().relabel(), sound, 0.001).unwrap();
        assert!(inverse.contains("if the inverse is taken"), "{inverse}");
        let conjugate = |pose: &Pose| Transform::new(pose.rotation().inverse(), pose.translation());
        assert!(said(&conjugate, sound, 0.001).unwrap().contains("if the rotations alone are inverted"));
        let exchanged = said(&|pose| *pose, [239.5, 319.5], 0.001).unwrap();
        assert!(
            exchanged.contains("contradicts the images' odometry in d.toml") && exchanged.contains("if cx and cy"),
            "{exchanged}"
        );
    }
}
