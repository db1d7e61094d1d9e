//! KITTI lines: the upper three rows of the pose's matrix, row by row.

use seafix_evaluation::trajectory::Pose;

use super::poses::Trajectory;

pub(super) fn print(trajectory: &Trajectory) -> String {
    let line = |Pose { rotation, position }: &Pose| {
        let rows: Vec<String> = (0..3)
            .map(|i| format!("{} {} {} {}", rotation[(i, 0)], rotation[(i, 1)], rotation[(i, 2)], position[i]))
            .collect();
        rows.join(" ") + "\n"
    };
    trajectory.poses.iter().map(line).collect()
}
