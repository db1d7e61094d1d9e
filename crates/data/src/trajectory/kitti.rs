//! KITTI lines: the upper three rows of the pose's matrix, row by row.

use std::path::Path;

use nalgebra::Matrix3;
use seafix_component::Fault;

use super::{Pose, Trajectory, holds_numbers, number};

/// The benchmark's files have seven digits: their rotations are orthonormal to about 1e-6.
const ORTHONORMAL: f64 = 1e-3;

pub(super) fn parse(lines: &[(usize, &str)], file: &Path) -> Result<Trajectory, Fault> {
    let mut poses = Vec::new();
    for &(line, text) in lines.iter().filter(|(_, line)| holds_numbers(line)) {
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() != 12 {
            let fault = Fault::new(format!("{} columns", words.len()), file).on_line(line).value(text);
            return Err(fault.remedy("a KITTI line is the upper three rows of a 4×4 matrix, 12 numbers"));
        }
        let mut m = [0.0; 12];
        for (number_, word) in m.iter_mut().zip(&words) {
            *number_ = number(word, file, line)?;
        }
        let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
        let off = (rotation.transpose() * rotation - Matrix3::identity()).amax();
        if !(off <= ORTHONORMAL && rotation.determinant() > 0.0) {
            let value = format!("off by {off:.3e}, determinant {:.6}", rotation.determinant());
            let fault = Fault::new("a matrix whose left part is not a rotation", file).on_line(line).value(value);
            return Err(fault.remedy("a KITTI line is the upper three rows of a 4×4 matrix"));
        }
        poses.push(Pose { rotation, position: [m[3], m[7], m[11]].into() });
    }
    Ok(Trajectory { stamps: None, poses, breaks: Vec::new() })
}

pub(super) fn print(trajectory: &Trajectory) -> String {
    let line = |Pose { rotation, position }: &Pose| {
        let rows: Vec<String> = (0..3)
            .map(|i| format!("{} {} {} {}", rotation[(i, 0)], rotation[(i, 1)], rotation[(i, 2)], position[i]))
            .collect();
        rows.join(" ") + "\n"
    };
    trajectory.poses.iter().map(line).collect()
}
