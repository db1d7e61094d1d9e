//! TUM lines: `seconds tx ty tz qx qy qz qw`.

use std::path::Path;

use seafix_component::Fault;
use seafix_geometry::{Camera, Transform, World};

use super::{BROKEN, Pose, Trajectory, quaternion};
use crate::dataset::tum;

pub(super) fn parse(lines: &[(usize, &str)], file: &Path) -> Result<Trajectory, Fault> {
    let rows: Vec<(u64, Transform<World, Camera>)> = tum::parse_lines(lines.iter().copied(), file)?;
    let pose =
        |pose: &Transform<World, Camera>| Pose { rotation: pose.rotation_matrix(), position: pose.translation() };
    Ok(Trajectory {
        breaks: Vec::new(),
        stamps: Some(rows.iter().map(|(stamp, _)| *stamp).collect()),
        poses: rows.iter().map(|(_, transform)| pose(transform)).collect(),
    })
}

pub(super) fn print(trajectory: &Trajectory) -> String {
    let line = |(i, pose): (usize, &Pose)| {
        let (stamp, p, [w, x, y, z]) = (trajectory.stamp(i), pose.position, quaternion(pose));
        let (seconds, nanos) = (stamp / 1_000_000_000, stamp % 1_000_000_000);
        let broken = if trajectory.breaks.contains(&i) { format!("{BROKEN}\n") } else { String::new() };
        format!("{broken}{seconds}.{nanos:09} {} {} {} {x} {y} {z} {w}\n", p.x, p.y, p.z)
    };
    tum::COLUMNS.to_owned() + &trajectory.poses.iter().enumerate().map(line).collect::<String>()
}
