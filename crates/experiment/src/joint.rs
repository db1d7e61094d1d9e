//! All objects in view solved together, with those of the frames before.

use std::time::Instant;

use seafix_geometry::StereoRig;
use seafix_referencing::{Glimpse, JointFixes, Member, Observations, Outcome, Target, TargetKind, joint_fixes};

use crate::{Attempt, Sighting, Stages, stages::milliseconds};

impl Stages {
    /// How many frames before its own a frame's answer looks back on.
    pub(crate) fn looks_back(&self) -> usize {
        match self.settings().target {
            TargetKind::Joint => self.settings().window - 1,
            _ => 0,
        }
    }

    /// What a joint fix takes from a sighting: the identified points of every object that was fixed by itself.
    pub(crate) fn glimpse(&self, sighting: &Sighting, targets: &[Target], rig: &StereoRig) -> Glimpse {
        let mut points = Vec::new();
        if self.settings().target == TargetKind::Joint {
            for attempt in &sighting.attempts {
                let Outcome::Referenced(fix) = &attempt.answer.outcome else { continue };
                let model = &targets[attempt.target].points;
                let own = Observations::of(&fix.pairs, model, &sighting.cloud, Some(rig)).points;
                points.extend(own.into_iter().map(|point| (attempt.target, point)));
            }
        }
        Glimpse { points }
    }

    /// Replaces the pose of every object fixed by itself by that of one fix over all of them and over the `before`
    /// glimpses. Where the images contradict each other, or determine no joint fix, each keeps its own and is told why.
    pub(crate) fn join(
        &self,
        sighting: &mut Sighting,
        before: &[&Glimpse],
        own: &Glimpse,
        targets: &[Target],
        rig: &StereoRig,
    ) {
        if own.points.is_empty() {
            return;
        }
        let start = Instant::now();
        // What shares no object with this frame says nothing about it.
        let related = |glimpse: &&&Glimpse| {
            glimpse.points.iter().any(|(object, _)| own.points.iter().any(|(same, _)| same == object))
        };
        let all: Vec<Glimpse> = before.iter().filter(related).copied().chain([own]).cloned().collect();
        let members: Vec<Member> = targets.iter().map(Target::member).collect();
        let confidence = self.settings().acceptance.confidence;
        match joint_fixes(rig, &members, &all, confidence) {
            Ok(fixes) => replace(sighting, &fixes, targets, rig),
            Err(why) => {
                let fixed = |attempt: &&mut Attempt| matches!(attempt.answer.outcome, Outcome::Referenced(_));
                for attempt in sighting.attempts.iter_mut().filter(fixed) {
                    attempt.apart = Some(format!("no joint fix, the pose is that of the object alone: {why}"));
                }
            }
        }
        let spent = milliseconds(start);
        for attempt in &mut sighting.attempts {
            for time in [&mut attempt.times.solve_ms, &mut attempt.times.total_ms].into_iter().flatten() {
                *time += spent;
            }
        }
    }
}

fn replace(sighting: &mut Sighting, fixes: &JointFixes, targets: &[Target], rig: &StereoRig) {
    for attempt in &mut sighting.attempts {
        let Outcome::Referenced(fix) = &mut attempt.answer.outcome else { continue };
        let Some((pose, covariance)) = fixes.object_from_camera[attempt.target] else { continue };
        // What protects the object's own fix protects this one, and the way between them.
        let moved = (pose.translation() - fix.object_from_camera.translation()).norm();
        let turned = seafix_geometry::so3::angle(&(pose.rotation().inverse() * fix.object_from_camera.rotation()));
        if let Some(level) = &mut fix.integrity.protection {
            level.position += moved;
            level.attitude += turned;
        }
        (fix.object_from_camera, fix.covariance) = (pose, covariance);
        fix.used = (0..fix.pairs.len()).collect();
        let points = &targets[attempt.target].points;
        let data = Observations::of(&fix.pairs, points, &sighting.cloud, Some(rig));
        (fix.residuals, fix.residual_rms) = (data.residuals(&pose), data.residual_rms(&pose));
    }
}
