//! Lines of trajectory files.

use crate::formats::pose_rows::PoseRow;

/// The beginning of a comment line that marks the motion to the next pose as unknown.
pub(super) const BROKEN: &str = "# broken";

/// The lines with their numbers, from 1.
pub(super) fn all_lines(text: &str) -> Vec<(usize, &str)> {
    text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())).collect()
}

/// The indices of the poses before which the trajectory is broken. A mark belongs to the next line of the file.
pub(super) fn breaks(lines: &[(usize, &str)], rows: &[PoseRow]) -> Vec<usize> {
    let marks = lines.iter().filter(|(_, line)| line.starts_with(BROKEN)).map(|(number, _)| *number);
    let next = |mark: usize| {
        let following = lines.iter().find(|(line, text)| *line > mark && !text.is_empty() && !text.starts_with('#'))?;
        rows.iter().position(|row| row.line == following.0)
    };
    let mut breaks: Vec<usize> = marks.filter_map(next).filter(|&index| index > 0).collect();
    breaks.sort_unstable();
    breaks.dedup();
    breaks
}
