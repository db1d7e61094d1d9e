//! TUM lines: `seconds tx ty tz qx qy qz qw`.

use seafix_evaluation::trajectory::Pose;

use super::{
    lines::BROKEN,
    poses::{Trajectory, quaternion},
};
use crate::dataset::tum;

pub(super) fn print(trajectory: &Trajectory) -> String {
    let line = |(i, pose): (usize, &Pose)| {
        let (stamp, p, [w, x, y, z]) = (trajectory.stamp(i), pose.position, quaternion(pose));
        let (seconds, nanos) = (stamp / 1_000_000_000, stamp % 1_000_000_000);
        let broken = if trajectory.breaks.contains(&i) { format!("{BROKEN}\n") } else { String::new() };
        format!("{broken}{seconds}.{nanos:09} {} {} {} {x} {y} {z} {w}\n", p.x, p.y, p.z)
    };
    tum::COLUMNS.to_owned() + &trajectory.poses.iter().enumerate().map(line).collect::<String>()
}
