//! The fixes in a trial's log, as a table or as a trajectory.

use std::{fmt::Write as _, path::Path};

use seafix_component::Fault;
use seafix_geometry::{Camera, NotRigid, Object, Transform, World};
use seafix_log::{Matrix4, Matrix6, Outcome, Reader, TargetRecord, TrialHeader, unchanged};

use crate::dataset::tum;

/// A fix as a log holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct LoggedFix {
    /// The number of the frame.
    pub frame: u64,
    /// The time of the images (ns).
    pub stamp_ns: u64,
    /// The target.
    pub object: String,
    /// The pose of the left camera in the object frame.
    pub object_from_camera: Transform<Object, Camera>,
    /// The covariance of ξ in T_true = T_est · Exp(ξ), rotation first, camera frame (rad, m).
    pub covariance: Matrix6,
    /// The pose of the left camera in the world; `None` without a survey.
    pub world_from_camera: Option<Transform<World, Camera>>,
}

impl LoggedFix {
    /// The expected RMS length of the camera's position error (m), √tr Σ of its position.
    pub fn position_rms(&self) -> f64 {
        (3..6).map(|axis| self.covariance[axis][axis]).sum::<f64>().sqrt()
    }
}

/// The fixes of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct LoggedFixes {
    /// The name of the trial.
    pub trial: String,
    /// The fixes in the order of the frames.
    pub fixes: Vec<LoggedFix>,
}

/// The head of the CSV table.
pub fn csv_head() -> String {
    let mut head = "trial,frame,stamp_ns,object,tx,ty,tz,qx,qy,qz,qw".to_owned();
    for (row, column) in upper_triangle() {
        let _ = write!(head, ",c{row}{column}");
    }
    head + "\n"
}

/// The places of the upper triangle of a covariance, row by row.
fn upper_triangle() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|row| (row..6).map(move |column| (row, column)))
}

impl LoggedFixes {
    /// Reads the fixes of a trial's log.
    ///
    /// # Errors
    /// A log that cannot be read, or a fix whose pose is no rigid motion.
    pub fn read(file: &Path) -> Result<Self, Fault> {
        let unreadable = |error: seafix_log::LogError| Fault::new(error.to_string(), file);
        let reader = unchanged(file).and_then(|()| Reader::open(file)).map_err(unreadable)?;
        let header = reader.header().clone();
        let mut fixes = Vec::new();
        for frame in reader.without_images().without_inputs() {
            let frame = frame.map_err(unreadable)?;
            for target in frame.targets.iter().filter(|target| target.outcome == Outcome::Fix) {
                let fix = fix(&header, target, (frame.frame, frame.stamp_ns)).map_err(|error| {
                    Fault::new("a fix that is no rigid motion", file).value(format!("frame {}: {error}", frame.frame))
                })?;
                fixes.extend(fix);
            }
        }
        Ok(Self { trial: header.trial, fixes })
    }

    /// The lines of the CSV table: object_from_camera and the upper triangle of its covariance.
    pub fn csv(&self) -> String {
        let mut text = String::new();
        for fix in &self.fixes {
            let (t, q) = (fix.object_from_camera.translation(), fix.object_from_camera.rotation());
            let _ = write!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{}",
                quoted(&self.trial),
                fix.frame,
                fix.stamp_ns,
                quoted(&fix.object),
                t.x,
                t.y,
                t.z,
                q.i,
                q.j,
                q.k,
                q.w
            );
            for (row, column) in upper_triangle() {
                let _ = write!(text, ",{}", fix.covariance[row][column]);
            }
            text.push('\n');
        }
        text
    }

    /// The trajectory as TUM lines, one for each frame with a fix: world_from_camera.
    ///
    /// A frame with fixes of several objects has the one with the smallest standard deviation of its position. The
    /// result is `None` if a fix has no pose in the world, because its object was not surveyed.
    pub fn world_tum(&self) -> Option<String> {
        let mut poses: Vec<(u64, Transform<World, Camera>)> = Vec::new();
        for fix in self.best_of_frames() {
            poses.push((fix.stamp_ns, fix.world_from_camera?));
        }
        Some(tum::print(&poses))
    }

    /// The trajectory relative to the objects as TUM lines: object_from_camera.
    pub fn object_tum(&self) -> String {
        let poses = self.best_of_frames().into_iter().map(|fix| (fix.stamp_ns, fix.object_from_camera));
        tum::print(&poses.collect::<Vec<_>>())
    }

    /// The most precise fix of every frame.
    fn best_of_frames(&self) -> Vec<&LoggedFix> {
        let mut best: Vec<&LoggedFix> = Vec::new();
        for fix in &self.fixes {
            match best.last_mut().filter(|last| last.stamp_ns == fix.stamp_ns) {
                Some(last) if fix.position_rms() < last.position_rms() => *last = fix,
                Some(_) => {}
                None => best.push(fix),
            }
        }
        best
    }
}

fn fix(
    header: &TrialHeader,
    target: &TargetRecord,
    (frame, stamp_ns): (u64, u64),
) -> Result<Option<LoggedFix>, NotRigid> {
    let (Some(pose), Some(covariance)) = (target.object_from_camera, target.covariance) else { return Ok(None) };
    let object_from_camera = Transform::from_rows(&pose)?;
    let of_site =
        header.targets.iter().find(|model| model.id == target.object).and_then(|model| model.site_from_object);
    let world_from_camera = match (header.world_from_site, of_site) {
        (Some(site), Some(object)) => Some(in_world(&site, &object, object_from_camera)?),
        _ => None,
    };
    Ok(Some(LoggedFix {
        frame,
        stamp_ns,
        object: target.object.clone(),
        object_from_camera,
        covariance,
        world_from_camera,
    }))
}

/// The pose in the world by the survey.
fn in_world(
    world_from_site: &Matrix4,
    site_from_object: &Matrix4,
    object_from_camera: Transform<Object, Camera>,
) -> Result<Transform<World, Camera>, NotRigid> {
    // The frame of the site is that of one of its objects.
    let world_from_site: Transform<World, Object> = Transform::from_rows(world_from_site)?;
    let site_from_object: Transform<Object, Object> = Transform::from_rows(site_from_object)?;
    Ok(world_from_site * site_from_object * object_from_camera)
}

/// A name as a CSV cell.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fix(stamp_ns: u64, object: &str, x: f64, sigma: f64) -> LoggedFix {
        let mut covariance = [[0.0; 6]; 6];
        (3..6).for_each(|axis| covariance[axis][axis] = sigma * sigma / 3.0);
        let pose = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let pose = Transform::from_rows(&pose).expect("a rigid motion");
        let object = object.to_owned();
        LoggedFix { frame: 0, stamp_ns, object, object_from_camera: pose, covariance, world_from_camera: None }
    }

    /// Fails if a frame gives two lines, whose equal stamps no reader of trajectories accepts.
    #[test]
    fn a_frame_gives_one_line_and_the_more_precise_fix() {
        let fixes = vec![fix(5, "a", 1.0, 0.2), fix(5, "b", 2.0, 0.1), fix(9, "a", 3.0, 0.2)];
        let fixes = LoggedFixes { trial: "t,1".to_owned(), fixes };
        assert_eq!(fixes.object_tum(), "0.000000005 2 0 0 0 0 0 1\n0.000000009 3 0 0 0 0 0 1\n");
        assert_eq!(fixes.world_tum(), None);
        assert!((fixes.fixes[1].position_rms() - 0.1).abs() < 1e-15);
        let csv = fixes.csv();
        let line = csv.lines().next().expect("three lines");
        assert!(line.starts_with("\"t,1\",0,5,a,1,0,0,0,0,0,1,0,0,"), "{line}");
        assert_eq!(csv_head().split(',').count(), line.split(',').count() - 1, "a column for each cell");
    }
}
