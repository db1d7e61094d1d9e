//! Trajectories in TUM, KITTI and EuRoC files, recognised by content, and in logs.

mod euroc;
mod kitti;
mod log;
mod tum;

use std::path::Path;

use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use seafix_component::{Fault, read_text};
use seafix_evaluation::trajectory::Pose;

use crate::dataset::tum::nanoseconds;

pub use log::LoggedTrajectory;

/// A trajectory: the poses of a body in the order of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// The stamp of each pose (ns), strictly increasing; `None` for a KITTI file.
    pub stamps: Option<Vec<u64>>,
    /// The poses, `reference_from_body`.
    pub poses: Vec<Pose>,
    /// The indices of the poses before which the trajectory is broken. The motion to such a pose is unknown; a line `#
    /// broken: …` marks it in the file.
    pub breaks: Vec<usize>,
}

/// The format of a trajectory file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `seconds tx ty tz qx qy qz qw`, separated by blanks.
    Tum,
    /// The upper three rows of the 4×4 matrix in one line: 12 numbers, no stamp.
    Kitti,
    /// `nanoseconds, px, py, pz, qw, qx, qy, qz` and whatever follows, separated by commas.
    Euroc,
}

impl Format {
    /// The format by file name: `.csv` EuRoC, `.kitti` KITTI, any other TUM.
    pub fn of_name(file: &Path) -> Self {
        match file.extension().and_then(|ending| ending.to_str()) {
            Some("csv") => Self::Euroc,
            Some("kitti") => Self::Kitti,
            _ => Self::Tum,
        }
    }

    /// The format of a text, by the separator and the number of columns of its first data line.
    fn of_text(text: &str) -> Option<Self> {
        let line = lines(text).next()?.1;
        let full = |stamp: &str| stamp.trim().parse::<u64>().is_ok();
        match (line.contains(','), line.split_whitespace().count()) {
            (true, _) if text.contains("#timestamp") || line.split(',').next().is_some_and(full) => Some(Self::Euroc),
            (false, 12) => Some(Self::Kitti),
            _ => Some(Self::Tum),
        }
    }
}

impl Trajectory {
    /// Reads a trajectory file of any format.
    ///
    /// # Errors
    /// The first invalid line, or a file without poses.
    pub fn read(file: &Path) -> Result<Self, Fault> {
        Self::parse(&read_text(file)?, file)
    }

    /// Reads a trajectory file whose lines are out of order: they are sorted by time, and the first of each stamp is
    /// kept.
    ///
    /// # Errors
    /// As for [`read`](Self::read), except for the order.
    pub fn read_repaired(file: &Path) -> Result<Self, Fault> {
        let text = read_text(file)?;
        Self::of_lines(&sorted(&text), &text, file)
    }

    /// Reads the trajectory in a text; `file` is named in faults.
    ///
    /// # Errors
    /// As for [`read`](Self::read).
    pub fn parse(text: &str, file: &Path) -> Result<Self, Fault> {
        Self::of_lines(&all_lines(text).collect::<Vec<_>>(), text, file)
    }

    fn of_lines(lines: &[(usize, &str)], text: &str, file: &Path) -> Result<Self, Fault> {
        let Some(format) = Format::of_text(text) else {
            return Err(Fault::new("a trajectory without poses", file).remedy("give TUM, KITTI or EuRoC lines"));
        };
        let read = match format {
            Format::Tum => tum::parse(lines, file),
            Format::Kitti => kitti::parse(lines, file),
            Format::Euroc => euroc::parse(lines, file),
        };
        Ok(Self { breaks: breaks(lines), ..read? })
    }

    /// The text of this trajectory in a format. Poses without stamps receive their index as seconds.
    pub fn print(&self, format: Format) -> String {
        match format {
            Format::Tum => tum::print(self),
            Format::Kitti => kitti::print(self),
            Format::Euroc => euroc::print(self),
        }
    }

    fn stamp(&self, i: usize) -> u64 {
        self.stamps.as_ref().map_or(i as u64 * 1_000_000_000, |stamps| stamps[i])
    }
}

/// The beginning of a comment line that marks the motion to the next pose as unknown.
const BROKEN: &str = "# broken";

/// The lines with their numbers, from 1.
fn all_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()))
}

fn holds_numbers(line: &str) -> bool {
    !line.is_empty() && !line.starts_with('#')
}

/// The data lines with their numbers, from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    all_lines(text).filter(|(_, line)| holds_numbers(line))
}

/// Numbered lines of a text.
type Lines<'a> = Vec<(usize, &'a str)>;

/// The lines sorted by stamp, with the first of each stamp kept. Comments stay before their line. Lines without a stamp
/// keep their place and are rejected by the reader.
fn sorted(text: &str) -> Lines<'_> {
    let mut groups: Vec<(Option<u64>, Lines<'_>)> = Vec::new();
    let mut group = Vec::new();
    for (number, line) in all_lines(text) {
        group.push((number, line));
        if holds_numbers(line) {
            let word = line.split([',', ' ', '\t']).next().unwrap_or_default();
            let stamp = if line.contains(',') { word.parse().ok() } else { nanoseconds(word) };
            groups.push((stamp, std::mem::take(&mut group)));
        }
    }
    if groups.iter().all(|(stamp, _)| stamp.is_some()) {
        groups.sort_by_key(|(stamp, _)| *stamp);
        groups.dedup_by_key(|(stamp, _)| *stamp);
    }
    groups.into_iter().flat_map(|(_, lines)| lines).collect()
}

/// The indices of the poses before which the trajectory is broken.
fn breaks(lines: &[(usize, &str)]) -> Vec<usize> {
    let (mut breaks, mut poses, mut broken) = (Vec::new(), 0, false);
    for (_, line) in lines {
        broken |= line.starts_with(BROKEN);
        if holds_numbers(line) {
            if std::mem::take(&mut broken) && poses > 0 {
                breaks.push(poses);
            }
            poses += 1;
        }
    }
    breaks
}

/// The number in a word, or a fault.
fn number(word: &str, file: &Path, line: usize) -> Result<f64, Fault> {
    word.trim()
        .parse()
        .ok()
        .filter(|x: &f64| x.is_finite())
        .ok_or_else(|| Fault::new("not a finite number", file).on_line(line).value(word).remedy("give a number"))
}

/// The pose with this position and attitude (w, x, y, z). An error is the norm of a quaternion that is not of unit
/// length.
fn pose(position: [f64; 3], [w, x, y, z]: [f64; 4]) -> Result<Pose, f64> {
    let quaternion = Quaternion::new(w, x, y, z);
    if (quaternion.norm() - 1.0).abs() > 1e-3 {
        return Err(quaternion.norm());
    }
    let rotation = UnitQuaternion::new_normalize(quaternion).to_rotation_matrix().into_inner();
    Ok(Pose { rotation, position: Vector3::from(position) })
}

/// The quaternion (w, x, y, z) of a pose with w ≥ 0.
fn quaternion(pose: &Pose) -> [f64; 4] {
    let mut rotation = Rotation3::from_matrix_unchecked(pose.rotation);
    rotation.renormalize();
    let q = UnitQuaternion::from_rotation_matrix(&rotation).into_inner();
    let q = if q.w < 0.0 { -q } else { q };
    [q.w, q.i, q.j, q.k]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Trajectory, String> {
        Trajectory::parse(text, Path::new("walk")).map_err(|fault| fault.to_string())
    }

    #[test]
    fn each_format_reads_back_what_it_wrote() {
        let walk = read("1.000000001 1 2 3 0.1 -0.2 0.3 0.9273618495495704\n2.5 4 5 6 0 0 0 1\n").unwrap();
        for format in [Format::Tum, Format::Euroc, Format::Kitti] {
            let again = read(&walk.print(format)).unwrap();
            assert_eq!(again.stamps, (format != Format::Kitti).then(|| walk.stamps.clone().unwrap()), "{format:?}");
            for (a, b) in again.poses.iter().zip(&walk.poses) {
                assert_eq!(a.position, b.position, "{format:?}");
                assert!((a.rotation - b.rotation).amax() < 1e-15, "{format:?}");
            }
        }
    }

    #[test]
    fn the_format_is_reported_by_content() {
        assert_eq!(Format::of_text("# x\n1 0 0 0 0 0 0 1\n"), Some(Format::Tum));
        assert_eq!(Format::of_text("1 0 0 0 0 1 0 0 0 0 1 0\n"), Some(Format::Kitti));
        assert_eq!(
            Format::of_text("#timestamp, p_x\n1403636580838555648,4.6,-1.7,0.7,1,0,0,0,9\n"),
            Some(Format::Euroc)
        );
        assert_eq!(Format::of_text("# nothing\n\n"), None);
    }

    /// Seen to fail when comments are skipped, and when a line that cannot be sorted is rejected although it can be
    /// repaired.
    #[test]
    fn breaks_are_read_and_lines_sorted() {
        let text =
            "# broken: before all\n1 0 0 0 0 0 0 1\n# broken: x\n3 2 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n3 9 0 0 0 0 0 1\n";
        assert!(read(text).unwrap_err().contains("walk:5"));
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("walk");
        std::fs::write(&file, text).unwrap();
        let trajectory = Trajectory::read_repaired(&file).unwrap();
        assert_eq!(trajectory.poses.iter().map(|pose| pose.position.x).collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
        assert_eq!(trajectory.breaks, [2]);
        for format in [Format::Tum, Format::Euroc] {
            assert_eq!(read(&trajectory.print(format)).unwrap().breaks, [2], "{format:?}");
        }
        std::fs::write(&file, "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 2\n").unwrap();
        let message = Trajectory::read_repaired(&file).unwrap_err().to_string();
        assert!(message.contains("unit length") && message.contains("walk:2"), "a fault keeps its line: {message}");
    }

    #[test]
    fn faults_name_their_line() {
        assert!(read("").unwrap_err().starts_with("a trajectory without poses in walk"));
        assert!(read("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n").unwrap_err().starts_with("7 columns in walk:2"));
        assert!(read("1,0,0,0,0,0,0\n").unwrap_err().starts_with("7 columns in walk:1"));
        assert!(read("1.5,0,0,0,0,0,0,1\n").unwrap_err().contains("not commas"));
        assert!(read("5,0,0,0,1,0,0,0\n5,0,0,0,1,0,0,0\n").unwrap_err().contains("in walk:2: 5; sort the lines"));
        assert!(read("1 0 0 0 0 1 0 0 0 0 -1 0\n").unwrap_err().contains("not a rotation in walk:1"));
        let header =
            |quaternion: &str| format!("#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], {quaternion}\n");
        let line = "1000000000000,1,2,3,0.1,-0.2,0.3,0.9273618495495704\n";
        let xyzw = read(&(header("q_x [], q_y [], q_z [], q_w []") + line)).unwrap().poses[0];
        let wxyz = read(&(header("q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []") + line)).unwrap().poses[0];
        let tum = read("1000 1 2 3 0.1 -0.2 0.3 0.9273618495495704\n").unwrap().poses[0];
        assert!((xyzw.rotation - tum.rotation).amax() < 1e-15);
        assert!((xyzw.rotation - wxyz.rotation).amax() > 0.1, "the header names the order of w");
        let wxyz = "# timestamp tx ty tz qw qx qy qz\n1 0 0 0 1 0 0 0\n";
        assert!(read(wxyz).unwrap_err().starts_with("quaternions with w first in walk:1"), "{wxyz}");
    }
}
