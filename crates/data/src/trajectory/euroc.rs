//! EuRoC lines: `nanoseconds, px, py, pz, qw, qx, qy, qz`.

use seafix_evaluation::trajectory::Pose;

use super::{
    lines::BROKEN,
    poses::{Trajectory, quaternion},
};

pub(super) fn print(trajectory: &Trajectory) -> String {
    let line = |(i, pose): (usize, &Pose)| {
        let (stamp, p, [w, x, y, z]) = (trajectory.stamp(i), pose.position, quaternion(pose));
        let broken = if trajectory.breaks.contains(&i) { format!("{BROKEN}\n") } else { String::new() };
        format!("{broken}{stamp},{},{},{},{w},{x},{y},{z}\n", p.x, p.y, p.z)
    };
    let lines: String = trajectory.poses.iter().enumerate().map(line).collect();
    "#timestamp [ns], p_x [m], p_y [m], p_z [m], q_w, q_x, q_y, q_z\n".to_owned() + &lines
}
