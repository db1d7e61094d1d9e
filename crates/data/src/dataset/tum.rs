//! Trajectories as TUM lines: `seconds tx ty tz qx qy qz qw`.

use std::path::Path;

use seafix_component::Fault;
use seafix_geometry::{Frame, Transform};

use crate::formats::pose_rows::{Attitude, PoseRow, PoseRows, Reading, read};

/// A stamp (ns) and the pose at it.
pub type Stamped<A, B> = (u64, Transform<A, B>);

/// The poses of a table, and the first quaternion that had to be normalised: its line and length.
pub type Poses<A, B> = (Vec<Stamped<A, B>>, Option<(usize, f64)>);

/// Reads the poses of a TUM text; `file` is named in faults. Lines that begin with `#` are comments; one that names the
/// columns decides their order.
///
/// # Errors
/// The first line that is no pose, has a quaternion off unit length by more than 1e-3, or has a stamp not later than
/// the previous one; a table without stamps or attitudes.
pub fn parse<A: Frame, B: Frame>(text: &str, file: &Path) -> Result<Poses<A, B>, Fault> {
    let lines: Vec<(usize, &str)> = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim())).collect();
    let PoseRows { rows, normalised, .. } = read(&lines, file, Reading { sorts: false, doubts_order: false })?;
    let pose = |row: PoseRow| {
        let fault = |what: &str, remedy: &str| Fault::new(what, file).on_line(row.line).remedy(remedy);
        let stamp =
            row.stamp_ns.ok_or_else(|| fault("a pose without a stamp", "give `seconds tx ty tz qx qy qz qw`"))?;
        match row.attitude {
            Attitude::Quaternion(turn) => Ok((stamp, Transform::new(turn, row.position))),
            Attitude::Matrix(matrix) => Ok((stamp, Transform::from_axes(&matrix, row.position))),
            Attitude::Unknown => Err(fault("a pose without an attitude", "give `seconds tx ty tz qx qy qz qw`")),
        }
    };
    Ok((rows.into_iter().map(pose).collect::<Result<_, _>>()?, normalised))
}

/// The minimum of |w| for a rotation of at most 50°.
const NEAR_ONE: f64 = 0.9;
/// The minimum number of lines that could be doubted.
const FEW: usize = 3;
/// The comment that names the columns.
pub const COLUMNS: &str = "# seconds tx ty tz qx qy qz qw\n";

/// The TUM text of these poses. Reading it returns the same poses except for rounding of the last bit. It names its
/// columns if their order could be doubted.
pub fn print<A: Frame, B: Frame>(poses: &[Stamped<A, B>]) -> String {
    let doubtful = poses.len() >= FEW && poses.iter().all(|(_, pose)| pose.rotation().i.abs() >= NEAR_ONE);
    let columns = if doubtful { COLUMNS } else { "" };
    let lines: String = poses
        .iter()
        .map(|(stamp, pose)| {
            let (t, q) = (pose.translation(), pose.rotation());
            format!(
                "{}.{:09} {} {} {} {} {} {} {}\n",
                stamp / 1_000_000_000,
                stamp % 1_000_000_000,
                t.x,
                t.y,
                t.z,
                q.i,
                q.j,
                q.k,
                q.w
            )
        })
        .collect();
    columns.to_owned() + &lines
}

/// The pose closest in time to `stamp`, within a millisecond.
pub fn at<A: Frame, B: Frame>(poses: &[Stamped<A, B>], stamp: u64) -> Option<Transform<A, B>> {
    const TOLERANCE_NS: u64 = 1_000_000;
    let after = poses.partition_point(|(time, _)| *time < stamp);
    poses[after.saturating_sub(1)..poses.len().min(after + 1)]
        .iter()
        .min_by_key(|(time, _)| time.abs_diff(stamp))
        .filter(|(time, _)| time.abs_diff(stamp) <= TOLERANCE_NS)
        .map(|(_, pose)| *pose)
}

/// The pose within a millisecond of `stamp`, otherwise one interpolated between neighbours at most `max_gap` (ns)
/// apart: linear in position, along the shortest rotation in attitude.
pub fn between<A: Frame, B: Frame>(poses: &[Stamped<A, B>], stamp: u64, max_gap: u64) -> Option<Transform<A, B>> {
    let after = poses.partition_point(|(time, _)| *time < stamp);
    at(poses, stamp).or_else(|| {
        let ((t0, before), (t1, after)) = (poses.get(after.checked_sub(1)?)?, poses.get(after)?);
        let fraction = (stamp - t0) as f64 / (t1 - t0) as f64;
        let turn = before.rotation().try_slerp(&after.rotation(), fraction, 1e-9)?;
        let place = before.translation().lerp(&after.translation(), fraction);
        (t1 - t0 <= max_gap).then(|| Transform::new(turn, place))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Camera, World};

    fn read(text: &str) -> Result<Vec<Stamped<World, Camera>>, Fault> {
        parse(text, Path::new("truth.tum")).map(|(poses, _)| poses)
    }

    #[test]
    fn stamps_keep_their_nanoseconds() {
        let poses = read("# comment\n1700000000.123456789 1 2 3 0 0 0 1\n").unwrap();
        assert_eq!(poses[0].0, 1_700_000_000_123_456_789);
        assert_eq!(read(&print(&poses)).unwrap(), poses);
    }

    #[test]
    fn bad_lines_are_rejected_by_number() {
        let message = |text: &str| read(text).unwrap_err().to_string();
        assert!(message("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0\n").starts_with("7 columns in truth.tum:2"));
        assert!(message("1.5,0,0,0,0,0,0,1\n").contains("(TUM) or qw qx qy qz (EuRoC)"));
        assert!(message("1 0 0 0 0 0 0 2\n").contains("unit length"));
        assert!(message("1 0 0 0 0 0 0 0\n").contains("without an attitude"));
        assert!(message("1 NaN 0 0 0 0 0 1\n").contains("not a finite number"));
        assert!(message("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n").contains("sort the lines"));
    }

    #[test]
    fn a_comment_that_names_the_columns_is_obeyed() {
        let w_first = read("# t x y z q_w q_x q_y q_z\n1 0 0 0 0.8 0.6 0 0\n").unwrap();
        assert_eq!(w_first, read("1 0 0 0 0.6 0 0 0.8\n").unwrap());
        let walk: String = (1..5).map(|t| format!("{t} {t} 0 0 1 0 0 0\n")).collect();
        assert_eq!(read(&walk).unwrap().len(), 4, "a data set states its order");
    }

    #[test]
    fn a_quaternion_that_is_normalised_is_named_once() {
        let text = "# seconds\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1.0005\n3 0 0 0 0 0 0 0.9995\n";
        let of = |text: &str| parse::<World, Camera>(text, Path::new("truth.tum")).unwrap();
        assert_eq!(of(text).0[1].1.rotation().w, 1.0);
        assert_eq!(of(text).1, Some((3, 1.0005)));
        assert_eq!(of("1 0 0 0 0.707107 0 0 0.707107\n").1, None);
    }

    #[test]
    fn the_nearest_pose_in_time_is_found() {
        let poses = read("1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n").unwrap();
        assert_eq!(at(&poses, 2_000_000_300).unwrap().translation().x, 2.0);
        assert_eq!(at(&poses, 1_500_000_000), None);
        assert_eq!(at::<World, Camera>(&[], 0), None);
    }
}
