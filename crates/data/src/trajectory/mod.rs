//! Trajectories in TUM, KITTI and EuRoC files, tables with named columns, COLMAP's images, and logs.

mod euroc;
mod kitti;
mod lines;
mod log;
mod poses;
mod tum;

use std::path::Path;

use seafix_component::{Fault, decoded_file, read_text};
use seafix_evaluation::trajectory::Pose;

use crate::formats::{
    colmap_images,
    pose_rows::{Attitude, PoseRow, PoseRows, Reading, read},
};
use lines::{all_lines, breaks};
pub use log::LoggedTrajectory;
pub use poses::Trajectory;

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
        Self::of_text(&read_text(file)?, file, true)
    }

    /// Reads the trajectory in a text; `file` is named in faults.
    ///
    /// # Errors
    /// As for [`read`](Self::read).
    pub fn parse(text: &str, file: &Path) -> Result<Self, Fault> {
        Self::of_text(text, file, false)
    }

    fn of_text(text: &str, file: &Path, sorts: bool) -> Result<Self, Fault> {
        decoded_file(file, || Self::read_text(text, file, sorts))
    }

    fn read_text(text: &str, file: &Path, sorts: bool) -> Result<Self, Fault> {
        let lines = all_lines(text);
        if colmap_images::is_one(&lines) {
            return Self::of_images(&lines, file);
        }
        let PoseRows { rows, warnings, .. } = read(&lines, file, Reading { sorts, doubts_order: true })?;
        let breaks = breaks(&lines, &rows);
        let has_attitude = rows.iter().all(|row| row.attitude != Attitude::Unknown);
        let stamps = rows.iter().map(|row| row.stamp_ns).collect();
        let poses = rows.iter().map(pose).collect();
        Ok(Self { stamps, poses, breaks, has_attitude, warnings })
    }

    /// The trajectory of the cameras of COLMAP's images.
    fn of_images(lines: &[(usize, &str)], file: &Path) -> Result<Self, Fault> {
        let images = colmap_images::parse(lines, file)?;
        if images.is_empty() {
            return Err(Fault::new("a trajectory without poses", file).remedy("give the lines of images"));
        }
        let stamps: Option<Vec<u64>> = images.iter().map(|image| image.stamp_ns).collect();
        let twice = stamps.as_ref().and_then(|stamps| stamps.windows(2).position(|pair| pair[0] == pair[1]));
        if let Some(index) = twice {
            let fault = Fault::new("two images of one time", file).on_line(images[index + 1].line);
            let remedy = "give the images of one camera";
            return Err(fault.value(format!("{} and {}", images[index].name, images[index + 1].name)).remedy(remedy));
        }
        let mut warnings = Vec::new();
        if stamps.is_none() {
            let fault = Fault::new("images whose names are no stamps", file).value(&images[0].name);
            warnings.push(fault.remedy("the poses are in order of the names and have no stamps"));
        }
        let poses = images
            .iter()
            .map(|image| Pose { rotation: image.rotation.to_rotation_matrix().into_inner(), position: image.position });
        Ok(Self { stamps, poses: poses.collect(), breaks: Vec::new(), has_attitude: true, warnings })
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

/// The pose of a row; one without an attitude has the axes of the reference.
fn pose(row: &PoseRow) -> Pose {
    let rotation = match row.attitude {
        Attitude::Quaternion(turn) => turn.to_rotation_matrix().into_inner(),
        Attitude::Matrix(rotation) => rotation,
        Attitude::Unknown => Pose::IDENTITY.rotation,
    };
    Pose { rotation, position: row.position }
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
            assert!(again.has_attitude && again.warnings.is_empty(), "{format:?}");
            assert_eq!(again.stamps, (format != Format::Kitti).then(|| walk.stamps.clone().unwrap()), "{format:?}");
            for (a, b) in again.poses.iter().zip(&walk.poses) {
                assert_eq!(a.position, b.position, "{format:?}");
                assert!((a.rotation - b.rotation).amax() < 1e-15, "{format:?}");
            }
        }
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
        assert!(read("1.5,0,0,0,0,0,0,1\n").unwrap_err().contains("(TUM) or qw qx qy qz (EuRoC)"));
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
    }
}
