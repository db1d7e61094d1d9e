//! Poses between those of a trajectory.

use nalgebra::{Rotation3, UnitQuaternion};

use super::pose::Pose;

/// The pose at `stamp` (ns): linear in position and along the shortest rotation between the neighbours, as in evo. Before
/// the first and after the last stamp it is that pose.
///
/// # Panics
/// If there are fewer than two poses, or stamps and poses differ in number.
pub fn interpolate(stamps: &[u64], poses: &[Pose], stamp: i128) -> Pose {
    assert!(poses.len() >= 2 && stamps.len() == poses.len(), "two stamped poses");
    let next = stamps.partition_point(|&other| i128::from(other) < stamp).clamp(1, poses.len() - 1);
    let (before, after) = (i128::from(stamps[next - 1]), i128::from(stamps[next]));
    let fraction = ((stamp - before) as f64 / (after - before).max(1) as f64).clamp(0.0, 1.0);
    let (a, b) = (&poses[next - 1], &poses[next]);
    let turn = |pose: &Pose| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
    let (from, to) = (turn(a), turn(b));
    // Opposite rotations have no shortest way between them.
    let rotation = from.try_slerp(&to, fraction, 1e-12).unwrap_or(if fraction < 0.5 { from } else { to });
    Pose { rotation: rotation.to_rotation_matrix().into_inner(), position: a.position.lerp(&b.position, fraction) }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_quarter_of_the_time_is_a_quarter_of_the_turn() {
        let pose = |angle: f64, x: f64| Pose {
            rotation: Rotation3::from_axis_angle(&Vector3::z_axis(), angle).into_inner(),
            position: [x, 0.0, 0.0].into(),
        };
        let (stamps, poses) = ([100, 500], [pose(0.0, 0.0), pose(0.8, 4.0)]);
        let at = |stamp: i128| interpolate(&stamps, &poses, stamp);
        let expected = pose(0.2, 1.0);
        assert!((at(200).rotation - expected.rotation).amax() < 1e-15 && at(200).position == expected.position);
        assert!((at(-7).rotation - poses[0].rotation).amax() < 1e-15 && at(900).position == poses[1].position);
    }
}
