//! The session of stereo visual odometry.

use std::time::Instant;

use nalgebra::{Matrix4, Vector4};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_geometry::{Camera, Covariance6, StereoRig, Transform, World};
use seafix_referencing::Observations;
use seafix_vision::{FrontEndOutput, Threads, Workspace};

use super::{
    consensus::{Rules, competitor, consensus, is_still, seen_again},
    follow::{Followed, WindowKeyFrame, follow},
    front_end::Seen,
    landmark::{Landmark, LandmarkObservation},
    pose::refine,
    range_offset::{OffsetEstimate, SPAN},
    settings::{Stereo, StereoStages},
    taken::Taken,
    window::adjust,
};
use crate::{
    odometry::{NotAfter, OdometrySession, RangeOffset, Stamps, StereoPair},
    odometry_trajectory::{Lost, OdometryOutcome, OdometryTrajectory, RelativeMotion, Segment, Waypoint},
    times::Times,
    unusable::RawImages,
};

/// The state of one session.
pub(super) struct StereoTracker<'a> {
    settings: &'a Stereo,
    stages: StereoStages,
    /// The rig, corrected by the offset of its disparities.
    rig: StereoRig,
    output: FrontEndOutput,
    work: Workspace,
    stamps: Stamps,
    raw: RawImages,
    /// The last pair of the trajectory.
    last: Option<Last>,
    /// A pair that could not be followed: its data, its index among the outcomes, the reason.
    pending: Option<(Seen, usize, Lost)>,
    /// The reason of the last break, until a usable pair begins the next segment.
    broken: Option<Lost>,
    /// Number of moving points beside static ones at the last doubt; zero once the vehicle has been seen to move.
    doubted: usize,
    frames: Vec<WindowKeyFrame>,
    /// The first key frame of the segment.
    first: usize,
    /// Number of landmarks that the last key frame saw.
    seen_by_keyframe: usize,
    landmarks: Vec<Landmark>,
    offset: OffsetEstimate,
    /// The first key frame of the next window of `offset`.
    offset_from: usize,
    segments: Vec<OpenSegment>,
    outcomes: Vec<OdometryOutcome>,
    times: Times,
}

/// The last pair of the trajectory.
struct Last {
    seen: Seen,
    world_from_camera: Transform<World, Camera>,
    /// The previous motion and its duration (s).
    motion: Option<(Transform<Camera, Camera>, f64)>,
}

/// A segment whose poses may still be adjusted.
struct OpenSegment {
    broken: Option<Lost>,
    poses: Vec<Relative>,
}

/// A pose relative to a key frame; bundle adjustment may still move the key frame.
struct Relative {
    stamp_ns: u64,
    frame: usize,
    frame_from_camera: Transform<Camera, Camera>,
    local: Option<RelativeMotion>,
}

/// The motion from the last pair to a new one.
struct Step {
    world_from_camera: Transform<World, Camera>,
    local: RelativeMotion,
    seconds: f64,
    sought: Vec<usize>,
    /// Index, pixel coordinates and covariance of each landmark that agrees with the pose.
    observations: Vec<(usize, Vector4<f64>, Matrix4<f64>)>,
    /// Whether other points moved while the inliers were static.
    passed_by: bool,
}

impl OdometrySession for StereoTracker<'_> {
    fn advance(&mut self, pair: &StereoPair<'_>) -> Result<OdometryOutcome, NotAfter> {
        self.stamps.take(self.outcomes.len(), pair.stamp_ns)?;
        let start = Instant::now();
        if let Some(lost) = self.raw.take([pair.left, pair.right]) {
            self.outcomes.push(OdometryOutcome::Skipped(lost.clone()));
            return Ok(OdometryOutcome::Skipped(lost));
        }
        self.times.since("check", start);
        let start = Instant::now();
        let seen = Seen::new(pair, &self.stages, &self.rig, &mut self.output, &mut self.work);
        let stages = self.output.times.stages();
        let known: f64 = stages.iter().map(|(_, ms)| ms).sum();
        stages.into_iter().for_each(|(stage, ms)| self.times.add(stage, ms));
        self.times.add("keep", start.elapsed().as_secs_f64() * 1e3 - known);
        self.take(seen);
        Ok(self.outcomes.last().cloned().expect("every pair has an outcome"))
    }

    fn latest(&self) -> Option<(usize, Waypoint)> {
        let number = self.segments.len().checked_sub(1)?;
        Some((number, self.waypoint(self.segments[number].poses.last()?)))
    }

    fn trajectory(&self) -> OdometryTrajectory {
        let segments = self.segments.iter().map(|segment| {
            let poses = segment.poses.iter().map(|pose| self.waypoint(pose));
            Segment { broken: segment.broken.clone(), poses: poses.collect() }
        });
        OdometryTrajectory {
            segments: segments.collect(),
            outcomes: self.outcomes.clone(),
            times: self.times.0.clone(),
        }
    }

    fn range_offset(&self) -> Option<RangeOffset> {
        self.offset.offset(self.min_offset())
    }
}

impl<'a> StereoTracker<'a> {
    pub(super) fn new(settings: &'a Stereo, stages: StereoStages, rig: &'a StereoRig, threads: Threads) -> Self {
        Self {
            settings,
            stages,
            rig: *rig,
            output: FrontEndOutput::new(threads),
            work: Workspace::new(threads),
            stamps: Stamps::default(),
            raw: RawImages::default(),
            last: None,
            pending: None,
            broken: None,
            doubted: 0,
            frames: Vec::new(),
            first: 0,
            seen_by_keyframe: 0,
            landmarks: Vec::new(),
            offset: OffsetEstimate::default(),
            offset_from: 0,
            segments: Vec::new(),
            outcomes: Vec::new(),
            times: Times::default(),
        }
    }

    /// Processes a pair: it continues the segment or begins a new one.
    fn take(&mut self, seen: Seen) {
        let Some(last) = self.last.take() else {
            let outcome = self.begin(seen, None);
            return self.outcomes.push(outcome);
        };
        match self.follow(&seen, &last) {
            Ok(step) => {
                // A single pair between that failed was an outlier.
                self.pending = None;
                self.outcomes
                    .push(OdometryOutcome::Followed { sought: step.sought.len(), found: step.observations.len() });
                self.accept(seen, step);
            }
            // The following pairs may still decide whether the vehicle is at rest; the last pair is kept.
            Err(lost @ Lost::Still { .. }) => {
                self.outcomes.push(OdometryOutcome::Skipped(lost));
                self.last = Some(last);
            }
            Err(lost) => match (self.pending.take(), lost) {
                // Two successive failures: a new segment begins with the first of the two pairs.
                (Some((first, index, why)), _) => {
                    self.outcomes[index] = self.begin(first, Some(why));
                    self.take(seen);
                }
                (None, lost @ Lost::Gap { .. }) => {
                    let outcome = self.begin(seen, Some(lost));
                    self.outcomes.push(outcome);
                }
                (None, lost) => {
                    self.pending = Some((seen, self.outcomes.len(), lost.clone()));
                    self.outcomes.push(OdometryOutcome::Skipped(lost));
                    self.last = Some(last);
                }
            },
        }
    }

    /// Begins a segment at the pose where the previous one ended.
    fn begin(&mut self, seen: Seen, broken: Option<Lost>) -> OdometryOutcome {
        let broken = self.broken.take().or(broken);
        let (found, needed) = (seen.cloud.len(), self.settings.min_points);
        if found < needed {
            // The reason is kept until a usable pair begins the segment.
            self.broken = broken;
            return OdometryOutcome::Skipped(Lost::FewPoints { found, needed });
        }
        let world_from_camera = self.world_from_last();
        self.landmarks.clear();
        self.frames.iter_mut().for_each(|frame| frame.image = None);
        self.first = self.frames.len();
        self.keyframe(&seen, world_from_camera, &[]);
        let pose = Relative {
            stamp_ns: seen.stamp_ns,
            frame: self.first,
            frame_from_camera: Transform::identity(),
            local: None,
        };
        self.segments.push(OpenSegment { broken, poses: vec![pose] });
        self.last = Some(Last { seen, world_from_camera, motion: None });
        OdometryOutcome::Began
    }

    fn waypoint(&self, pose: &Relative) -> Waypoint {
        Waypoint {
            stamp_ns: pose.stamp_ns,
            world_from_camera: self.frames[pose.frame].world_from_camera * pose.frame_from_camera,
            local: pose.local,
        }
    }

    /// The pose of the last waypoint; the identity before the first one.
    fn world_from_last(&self) -> Transform<World, Camera> {
        self.latest().map_or_else(Transform::identity, |(_, waypoint)| waypoint.world_from_camera)
    }

    /// The motion from `last` to `seen`.
    fn follow(&mut self, seen: &Seen, last: &Last) -> Result<Step, Lost> {
        let settings = self.settings;
        let seconds = (seen.stamp_ns - last.seen.stamp_ns) as f64 * 1e-9;
        if seconds > settings.max_gap {
            return Err(Lost::Gap { seconds, max: settings.max_gap });
        }
        let (predicted, moving) = self.predicted(seen, last, seconds)?;
        let start = Instant::now();
        let mut guess = last.world_from_camera * predicted;
        let calibration = self.stages.front_end.triangulator.rules().calibration_px;
        let images = [&seen.images[0], &seen.images[1]];
        let followed = follow(
            &settings.follow,
            &self.rig,
            &self.frames,
            &self.landmarks,
            images,
            &guess,
            (settings.landmarks, calibration),
            &mut self.work,
        );
        self.times.since("follow", start);
        let start = Instant::now();
        let needed = settings.min_points;
        let few = |found| Lost::NoConsensus { found, matches: followed.sought.len(), needed };
        let found = followed.for_pose(&self.frames, &self.landmarks);
        let pose = refine(&self.rig, &found, &guess).ok_or(few(0))?;
        self.times.since("pose", start);
        guess = pose.world_from_camera;
        let Followed { sought, found } = followed;
        let observations: Vec<_> =
            found.into_iter().zip(&pose.agrees).filter_map(|(one, agrees)| agrees.then_some(one)).collect();
        if observations.len() < needed {
            return Err(Lost::NoConsensus { found: observations.len(), matches: sought.len(), needed });
        }
        // A doubt stays until evidence decides it: the moving points may leave the view meanwhile.
        let beside = moving.map_or(0, |moving| if moving > 0 { moving } else { self.doubted });
        if beside > 0 && !self.were_elsewhere(&observations, needed) {
            self.doubted = beside;
            return Err(Lost::Still { still: observations.len(), moving: beside });
        }
        self.doubted = 0;
        let covariance = Covariance6::new(pose.covariance);
        if covariance.position_rms() > settings.max_sigma {
            return Err(Lost::Weak(covariance.position_rms()));
        }
        let motion = last.world_from_camera.inverse() * guess;
        let speed = motion.translation().norm() / seconds;
        if speed > settings.max_speed {
            return Err(Lost::Jump { speed, seconds, max: settings.max_speed });
        }
        let local = RelativeMotion::new(motion, covariance);
        Ok(Step { world_from_camera: guess, local, seconds, sought, observations, passed_by: beside > 0 })
    }

    /// Whether enough landmarks have been at another position of the image before.
    ///
    /// A part of the vehicle never has, however sharp it is and however often it is found again.
    fn were_elsewhere(&self, observations: &[(usize, Vector4<f64>, Matrix4<f64>)], needed: usize) -> bool {
        let far = self.rules().elsewhere();
        let moved = |(index, pixels, _): &&(usize, Vector4<f64>, Matrix4<f64>)| {
            let first = self.landmarks[*index].place;
            libm::hypot(pixels[0] - first.u, pixels[1] - first.v) > far
        };
        observations.iter().filter(moved).count() >= needed
    }

    fn rules(&self) -> Rules {
        let Stereo { consensus_px: px, confidence, draws, .. } = *self.settings;
        Rules { px, confidence, draws }
    }

    /// The motion `earlier_from_later` by RANSAC over the matches with the last pair.
    ///
    /// If the motion is indistinguishable from rest, the second value is the number of other points that agree on a
    /// motion; 0 if they are too few to be significant.
    fn predicted(
        &mut self,
        seen: &Seen,
        last: &Last,
        seconds: f64,
    ) -> Result<(Transform<Camera, Camera>, Option<usize>), Lost> {
        let settings = self.settings;
        let start = Instant::now();
        let pairs = seen.in_common(&last.seen, &self.stages, &self.rig, &mut self.work);
        self.times.since("between", start);
        let needed = settings.min_points;
        if pairs.len() < needed {
            return Err(Lost::FewMatches { found: pairs.len(), needed });
        }
        let start = Instant::now();
        let points =
            pairs.iter().map(|&(earlier, later)| seen_again(&last.seen.cloud[earlier].position, &seen.cloud[later]));
        let data = Observations { points: points.collect(), edges: Vec::new(), rig: Some(&self.rig) };
        let rules = self.rules();
        let mut guesses = vec![Transform::identity()];
        if let Some((motion, before)) = &last.motion {
            guesses.push(Transform::exp(&(motion.log() * (seconds / before))));
        }
        // The stamp seeds the sampler, so that the result does not depend on skipped pairs.
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed ^ seen.stamp_ns);
        let solvers = (&*self.stages.minimal, &*self.stages.solver);
        let best = consensus(&data, &self.rig, &rules, solvers, &guesses, &mut rng);
        let found = best.as_ref().map_or(0, |best| best.inliers.len());
        let answer = match best {
            Some(best) if found >= needed => {
                // A minimal sample always agrees on a motion; twice as many points are significant.
                let enough = |count: &usize| *count >= 2 * self.stages.minimal.minimum();
                let mut moving = || Some(competitor(&best, &data, &self.rig, &rules, solvers, &mut rng)).filter(enough);
                let beside = is_still(&best, &data, &self.rig, &rules).then(|| moving().unwrap_or(0));
                Ok((best.motion.relabel(), beside))
            }
            _ => Err(Lost::NoConsensus { found, matches: pairs.len(), needed }),
        };
        self.times.since("consensus", start);
        answer
    }

    /// Adds `seen` to the trajectory.
    fn accept(&mut self, seen: Seen, step: Step) {
        let Step { world_from_camera, local, seconds, sought, observations, passed_by } = step;
        for index in sought {
            self.landmarks[index].misses += 1;
        }
        for (index, ..) in &observations {
            self.landmarks[*index].misses = 0;
        }
        let fraction = observations.len() as f64 / self.seen_by_keyframe.max(1) as f64;
        // A passing object hides landmarks. Landmarks from other positions of the image are the evidence for a static
        // ground, so the key frame is kept.
        let own = fraction < self.settings.keyframe_fraction && !passed_by;
        if own {
            self.keyframe(&seen, world_from_camera, &observations);
            let start = Instant::now();
            self.adjust();
            self.reveal_offset(&seen);
            self.times.since("adjust", start);
        }
        let frame = self.frames.len() - 1;
        // The pose of a key frame refers to itself, so that it follows the adjustment.
        let frame_from_camera = match own {
            true => Transform::identity(),
            false => self.frames[frame].world_from_camera.inverse() * world_from_camera,
        };
        let pose = Relative { stamp_ns: seen.stamp_ns, frame, frame_from_camera, local: Some(local) };
        self.segments.last_mut().expect("a segment was begun").poses.push(pose);
        let motion = Some((local.motion, seconds));
        self.last = Some(Last { seen, world_from_camera: self.world_from_last(), motion });
    }

    /// Makes `seen` a key frame: it stores the landmark observations and adds new landmarks in free areas.
    fn keyframe(
        &mut self,
        seen: &Seen,
        world_from_camera: Transform<World, Camera>,
        observations: &[(usize, Vector4<f64>, Matrix4<f64>)],
    ) {
        let start = Instant::now();
        let settings = self.settings;
        let id = self.frames.len();
        self.frames.push(WindowKeyFrame { world_from_camera, image: Some(seen.images[0].clone()) });
        let mut taken = Taken::new(settings.apart_px);
        for (index, pixels, noise) in observations {
            taken.insert([pixels[0], pixels[1]]);
            if let Some(factor) = noise.cholesky() {
                let view = LandmarkObservation { frame: id, pixels: *pixels, information: factor.inverse() };
                self.landmarks[*index].views.push(view);
            }
        }
        let mut count = observations.len();
        for point in &seen.cloud {
            let Some(pixels) = point.pixels else { continue };
            let left = pixels.at.left;
            if count >= settings.landmarks || !taken.free([left.u, left.v]) {
                continue;
            }
            if let Some(landmark) =
                Landmark::begin(id, &pixels, self.stages.front_end.triangulator.rules().calibration_px, &self.rig)
            {
                taken.insert([left.u, left.v]);
                self.landmarks.push(landmark);
                count += 1;
            }
        }
        self.seen_by_keyframe = count;
        self.times.since("key frame", start);
    }

    /// Updates the estimate of the disparity's offset with every complete window, and corrects the rig if it is
    /// significant.
    ///
    /// Landmarks of the wrong rig are dropped: the last key frame begins new ones with the corrected rig.
    fn reveal_offset(&mut self, seen: &Seen) {
        let (end, window) = (self.frames.len(), self.settings.window.min(SPAN));
        // A segment that began anew has no landmarks of earlier key frames.
        self.offset_from = self.offset_from.max(self.first);
        if window < 2 || end < self.offset_from + window {
            return;
        }
        let base = end - window;
        self.offset.add(&self.rig, &self.frames, &self.landmarks, base);
        self.offset_from = end - 1;
        let min = self.min_offset();
        if !self.settings.correct_range_offset {
            return;
        }
        let Some(pixels) = self.offset.correction(min) else { return };
        self.rig = self.rig.with_range_offset(pixels);
        let world_from_camera = self.world_from_last_frame();
        self.landmarks.clear();
        self.frames.iter_mut().for_each(|frame| frame.image = None);
        self.frames.pop();
        self.first = self.frames.len();
        self.offset_from = self.first;
        self.keyframe(seen, world_from_camera, &[]);
    }

    /// The pose of the last key frame.
    fn world_from_last_frame(&self) -> Transform<World, Camera> {
        self.frames.last().map_or_else(Transform::identity, |frame| frame.world_from_camera)
    }

    /// The smallest offset that is corrected (px): two standard deviations of the disparity, a difference of two
    /// coordinates, by the calibration error that every coordinate is assumed to have.
    ///
    /// Over a real street with a right rig the estimate is off by a third of a pixel, ten times its own deviation.
    fn min_offset(&self) -> f64 {
        2.0 * std::f64::consts::SQRT_2 * self.stages.front_end.triangulator.rules().calibration_px
    }

    /// Adjusts the window and drops key frames and landmarks that have left it.
    fn adjust(&mut self) {
        let end = self.frames.len();
        let window = self.settings.window;
        let oldest = end.saturating_sub(window.max(1)).max(self.first);
        if window > 1 {
            adjust(&self.rig, &mut self.frames, &mut self.landmarks, oldest + 1);
        }
        self.frames[..oldest].iter_mut().for_each(|frame| frame.image = None);
        let frames = &self.frames;
        self.landmarks.retain(|landmark| {
            let linked = landmark.views.len() > 1 && landmark.views.last().is_some_and(|view| view.frame > oldest);
            landmark.at.z > 0.0 && (frames[landmark.anchor].image.is_some() || linked)
        });
    }
}
