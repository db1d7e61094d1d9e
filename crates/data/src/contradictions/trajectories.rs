//! Two trajectories of one motion that contradict each other, and the known mistake that explains it.
//!
//! Motions from pose to pose do not depend on the world's axes and origin, positions do not depend on the axes of the
//! body. Both are compared, so that a mistake is found whatever else differs. Errors of an estimate are small parts of
//! its motion or explained by no mistake.

use std::path::Path;

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use seafix_component::Fault;
use seafix_evaluation::trajectory::Pose;
use seafix_geometry::{Camera, Transform, World};

use super::poses::{Mistake, mistakes};

type Placed = Transform<World, Camera>;

/// The difference of an estimate from the reference.
type Measure<'a> = &'a dyn Fn(&[Placed]) -> Option<f64>;

/// The maximum number of compared motions.
const COMPARED: usize = 200;
/// The number of motions in a row that a trajectory is divided into: longer ones than noise, shorter ones than drift.
const PARTS: usize = 8;
/// A difference, as a part of the motion, that is no error of an estimate.
const LARGE: f64 = 0.3;
/// The factor by which a mistake, undone, must reduce it.
const CLEAR: f64 = 4.0;
/// A rotation (rad) below this is compared as if it had this angle: it may be noise.
const SMALL: f64 = 0.05;

/// The fault of an estimate in `file` that contradicts the reference, pose by pose, if a known mistake explains it.
/// `has_attitude` is false where one of the two has positions only.
pub fn trajectory_fault(reference: &[Pose], estimate: &[Pose], has_attitude: bool, file: &Path) -> Option<Fault> {
    let placed = |poses: &[Pose]| -> Vec<Placed> {
        let rotation =
            |pose: &Pose| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
        poses.iter().map(|pose| Transform::new(rotation(pose), pose.position)).collect()
    };
    let (reference, estimate) = (placed(reference), placed(estimate));
    let measures: [Measure<'_>; 2] =
        [&|other| motions_apart(&reference, other, has_attitude), &|other| positions_apart(&reference, other)];
    for measure in measures {
        let Some(given) = measure(&estimate).filter(|given| *given > LARGE) else { continue };
        let applies = |mistake: &Mistake| has_attitude || !depends_on_attitude(mistake);
        let explained = mistakes(&Transform::identity()).into_iter().filter(applies).find_map(|mistake| {
            let undone: Vec<Placed> = estimate.iter().map(|pose| (mistake.undo)(pose)).collect();
            let left = measure(&undone)?;
            (left * CLEAR < given && left < LARGE).then_some((left, mistake))
        });
        if let Some((left, mistake)) = explained {
            let percent = |part: f64| format!("{:.0} %", 100.0 * part);
            let value = format!(
                "they differ by {} of the motion (median), and by {} {}",
                percent(given),
                percent(left),
                mistake.name
            );
            return Some(Fault::new("poses that contradict the reference", file).value(value).remedy(mistake.remedy));
        }
    }
    None
}

/// Whether a mistake changes positions by an amount that the attitude decides, as the inverse does.
fn depends_on_attitude(mistake: &Mistake) -> bool {
    let place = Vector3::new(1.0, 2.0, 3.0);
    let turned = Transform::new(UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3), place);
    let undone = |pose: &Placed| (mistake.undo)(pose).translation();
    (undone(&Transform::new(UnitQuaternion::identity(), place)) - undone(&turned)).norm() > 1e-9
}

/// The median difference of the motions over an eighth of the trajectory, as a part of the motions.
pub(super) fn motions_apart(reference: &[Placed], estimate: &[Placed], has_attitude: bool) -> Option<f64> {
    let apart = (reference.len() / PARTS).max(1);
    let count = reference.len().checked_sub(apart).filter(|count| *count >= 3)?;
    let parts = (0..count).step_by(count.div_ceil(COMPARED)).filter_map(|from| {
        let motion = |poses: &[Placed]| poses[from].inverse() * poses[from + apart];
        let (a, b) = (motion(reference), motion(estimate));
        let (along, across) = (a.translation().norm(), b.translation().norm());
        let of_length = along + across;
        if !has_attitude {
            return (of_length > 0.0).then(|| (along - across).abs() / of_length);
        }
        let moved = (a.translation() - b.translation()).norm() / of_length.max(f64::MIN_POSITIVE);
        let angles = a.rotation().angle() + b.rotation().angle();
        let turned = a.rotation().angle_to(&b.rotation()) / angles.max(SMALL);
        Some(moved.max(turned))
    });
    median(parts.collect())
}

/// The median distance of the positions, as a part of the extent of the reference.
fn positions_apart(reference: &[Placed], estimate: &[Placed]) -> Option<f64> {
    let middle = reference.iter().map(|pose| pose.translation()).sum::<Vector3<f64>>() / reference.len() as f64;
    let extent = median(reference.iter().map(|pose| (pose.translation() - middle).norm()).collect())?;
    let apart = reference.iter().zip(estimate).map(|(a, b)| (a.translation() - b.translation()).norm());
    median(apart.collect()).filter(|_| reference.len() >= 3 && extent > 0.0).map(|apart| apart / extent)
}

fn median(mut all: Vec<f64>) -> Option<f64> {
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;

    fn walk() -> Vec<Pose> {
        let pose = |k: usize| {
            let t = 0.1 * k as f64;
            let rotation = Rotation3::from_euler_angles(0.3 * t.sin(), 0.2 * (1.3 * t).cos(), 0.5 * t).into_inner();
            Pose { rotation, position: Vector3::new(3.0 * t.cos(), 2.0 * t.sin(), 0.4 * t) }
        };
        (0..64).map(pose).collect()
    }

    fn said(change: &dyn Fn(&Pose) -> Pose, has_attitude: bool) -> Option<String> {
        let estimate: Vec<Pose> = walk().iter().map(change).collect();
        trajectory_fault(&walk(), &estimate, has_attitude, Path::new("e.tum")).map(|fault| fault.to_string())
    }

    /// A sound estimate, one with another origin and one with drift are not doubted. Fails if positions alone are
    /// compared without a mistake that explains them.
    #[test]
    fn an_estimate_with_errors_is_not_doubted() {
        assert_eq!(said(&|pose| *pose, true), None);
        let world = Rotation3::from_euler_angles(0.2, -0.4, 1.0).into_inner();
        let other = |pose: &Pose| Pose {
            rotation: world * pose.rotation,
            position: world * pose.position + Vector3::new(40.0, -3.0, 9.0),
        };
        assert_eq!(said(&other, true), None);
        let drifted = |pose: &Pose| Pose { position: pose.position * 1.1, ..*pose };
        assert_eq!(said(&drifted, true), None);
    }

    #[test]
    fn the_mistake_is_named() {
        let quaternion =
            |pose: &Pose| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
        let misread = |pose: &Pose| {
            let q = quaternion(pose);
            let q = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q.k, q.w, q.i, q.j));
            Pose { rotation: q.to_rotation_matrix().into_inner(), ..*pose }
        };
        let conjugate = |pose: &Pose| Pose { rotation: pose.rotation.transpose(), ..*pose };
        let inverse = |pose: &Pose| pose.to(&Pose::IDENTITY);
        let millimetres = |pose: &Pose| Pose { position: pose.position * 1000.0, ..*pose };
        let enu = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        let exchanged = |pose: &Pose| Pose { rotation: enu * pose.rotation, position: enu * pose.position };
        for (change, has_attitude, part) in [
            (&misread as &dyn Fn(&Pose) -> Pose, true, "if w is read first"),
            (&inverse, true, "if the inverse is taken"),
            (&conjugate, true, "if the rotations alone are inverted (JPL"),
            (&millimetres, true, "millimetres"),
            (&millimetres, false, "millimetres"),
            (&exchanged, true, "ENU for NED"),
        ] {
            let said = said(change, has_attitude).unwrap_or_default();
            assert!(said.starts_with("poses that contradict the reference in e.tum") && said.contains(part), "{said}");
        }
    }
}
