//! Trajectories in a trial's log.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use seafix_component::Fault;
use seafix_evaluation::trajectory::Pose;
use seafix_log::{FrameRecord, Matrix4, Reader, TrialHeader, unchanged};

use super::poses::Trajectory;

/// The kind of a logged trajectory of the left camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoggedTrajectory {
    /// The ground truth in the world.
    True,
    /// The odometry alone, from the first pair on. It has a break where the motion is unknown, and resumes at the pose
    /// before.
    Odometry,
    /// The navigated pose in the world, by the survey of its object. It has no breaks: after a gap of the odometry
    /// there is no pose until the next fix.
    Navigated,
}

impl Trajectory {
    /// Reads a trajectory from a trial's log: the frames that have a pose of this kind.
    ///
    /// # Errors
    /// A log that cannot be read or has no such trajectory.
    pub fn of_log(file: &Path, which: LoggedTrajectory) -> Result<Self, Fault> {
        let unreadable = |error: seafix_log::LogError| Fault::new(error.to_string(), file);
        let reader = unchanged(file).and_then(|()| Reader::open(file)).map_err(unreadable)?.without_images();
        let header = reader.header().clone();
        let (mut stamps, mut poses): (Vec<u64>, Vec<Pose>) = (Vec::new(), Vec::new());
        let mut breaks = Vec::new();
        let mut here = Pose { rotation: Matrix3::identity(), position: Vector3::zeros() };
        for frame in reader {
            let frame = frame.map_err(unreadable)?;
            let found = match which {
                LoggedTrajectory::True => frame.truth.as_ref().map(|truth| pose(&truth.world_from_camera)),
                LoggedTrajectory::Odometry => step(&frame).map(|step| {
                    match step {
                        Step::Begin => {}
                        Step::Go(motion) => here = after(&here, &motion),
                        Step::Broken => breaks.push(poses.len()),
                    }
                    here
                }),
                LoggedTrajectory::Navigated => navigated(&header, &frame),
            };
            if let Some(pose) = found {
                stamps.push(frame.stamp_ns);
                poses.push(pose);
            }
        }
        if poses.is_empty() {
            let (what, remedy) = match which {
                LoggedTrajectory::True => ("a log without truth", "give a trajectory to measure against"),
                _ => ("a log without navigation", "run an experiment with a table [navigation]"),
            };
            return Err(Fault::new(what, file).remedy(remedy));
        }
        Ok(Self { stamps: Some(stamps), poses, breaks, has_attitude: true, warnings: Vec::new() })
    }
}

/// The motion of the odometry to a frame.
enum Step {
    /// The first frame.
    Begin,
    /// A known motion from the last accepted frame.
    Go(Pose),
    /// An unknown motion: the trajectory resumes at this frame.
    Broken,
}

/// The motion of the odometry to a frame; `None` for a skipped frame.
fn step(frame: &FrameRecord) -> Option<Step> {
    let odometry = &frame.navigation.as_ref()?.odometry;
    match &odometry.motion {
        Some((motion, _)) => Some(Step::Go(pose(motion))),
        None if odometry.lost.is_empty() => Some(Step::Begin),
        None => odometry.is_break().then_some(Step::Broken),
    }
}

fn navigated(header: &TrialHeader, frame: &FrameRecord) -> Option<Pose> {
    let known = frame.navigation.as_ref()?.pose.as_ref()?;
    let target = header.targets.iter().find(|target| target.id == known.object)?;
    let world_from_object = after(&pose(&header.world_from_site?), &pose(&target.site_from_object?));
    Some(after(&world_from_object, &pose(&known.object_from_camera)))
}

fn pose(rows: &Matrix4) -> Pose {
    Pose { rotation: Matrix3::from_fn(|r, c| rows[r][c]), position: Vector3::new(rows[0][3], rows[1][3], rows[2][3]) }
}

/// The composition `a_from_c` of `a_from_b` and `b_from_c`.
fn after(first: &Pose, then: &Pose) -> Pose {
    Pose { rotation: first.rotation * then.rotation, position: first.rotation * then.position + first.position }
}
