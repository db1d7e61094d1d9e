//! The ways that a trial's log holds.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use seafix_component::Fault;
use seafix_evaluation::trajectory::Pose;
use seafix_log::{FrameRecord, Matrix4, Reader, TrialHeader};

use super::Trajectory;
use seafix::UNKNOWN_MOTION;

/// One of the ways of the left camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoggedTrajectory {
    /// As it really went, in the world.
    True,
    /// By odometry alone, from the first pair on; where the way was lost it is broken, and goes on where it ended.
    Odometry,
    /// By the navigated pose and the survey of the object it is relative to, in the world. It has no breaks: where odometry was
    /// lost there is no pose until the next fix, which tells where that is.
    Navigated,
}

impl Trajectory {
    /// A way from a trial's log: the frames that have it.
    ///
    /// # Errors
    /// A log that cannot be read, or one without such a way.
    pub fn of_log(file: &Path, which: LoggedTrajectory) -> Result<Self, Fault> {
        let unreadable = |error: seafix_log::LogError| Fault::new(error.to_string(), file);
        let reader = Reader::open(file).map_err(unreadable)?.without_images();
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
        Ok(Self { stamps: Some(stamps), poses, breaks })
    }
}

/// How the odometry reached a frame.
enum Step {
    /// It begins with it.
    Begin,
    /// By this motion from the frame that it reached before.
    Go(Pose),
    /// By a motion that nobody knows; it goes on from here.
    Broken,
}

/// How the odometry reached a frame; none where it left the frame out.
fn step(frame: &FrameRecord) -> Option<Step> {
    let odometry = &frame.navigation.as_ref()?.odometry;
    match &odometry.motion {
        Some((motion, _)) => Some(Step::Go(pose(motion))),
        None if odometry.lost.is_empty() => Some(Step::Begin),
        None => odometry.lost.ends_with(UNKNOWN_MOTION).then_some(Step::Broken),
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

/// `a_from_c`, of `a_from_b` and `b_from_c`.
fn after(first: &Pose, then: &Pose) -> Pose {
    Pose { rotation: first.rotation * then.rotation, position: first.rotation * then.position + first.position }
}
