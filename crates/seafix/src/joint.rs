//! Joint fixes over all objects in view and over the preceding frames.

use std::{collections::BTreeMap, time::Instant};

use seafix_geometry::StereoRig;
use seafix_referencing::{
    Candidates, Gathered, JointFixes, Member, ObjectObservations, Observations, Outcome, Target, TargetKind, gather,
    joint_fixes,
};

use crate::{frame_result::FrameResult, pipeline::Pipeline, times::milliseconds};

impl Pipeline {
    /// The number of preceding frames that take part in a joint fix.
    pub fn window_length(&self) -> usize {
        match self.settings().target {
            TargetKind::Joint => self.settings().window - 1,
            _ => 0,
        }
    }

    /// The observations that a frame contributes to a joint fix: the identified points and edges of every object with a
    /// fix of its own, and the points of other objects at their predicted places.
    pub fn object_observations(
        &self,
        frame_result: &mut FrameResult,
        targets: &[Target],
        rig: &StereoRig,
    ) -> ObjectObservations {
        let mut object_observations = ObjectObservations::default();
        if self.settings().target != TargetKind::Joint {
            return object_observations;
        }
        let mut used = Vec::new();
        for attempt in &frame_result.attempts {
            let Outcome::Fix(fix) = &attempt.answer.outcome else { continue };
            let Target { points, edges, .. } = &targets[attempt.target];
            let data = Observations::of(&fix.pairs, points, &frame_result.cloud, Some(rig));
            object_observations.see(attempt.target, &data.with_edges(&fix.edges, edges, points, &frame_result.lines));
            object_observations.poses.push((attempt.target, fix.object_from_camera));
            used.extend(fix.pairs.iter().map(|pair| pair.cloud));
        }
        if object_observations.poses.is_empty() {
            return object_observations;
        }
        let mut listed: Vec<Option<&Candidates>> = vec![None; targets.len()];
        frame_result.attempts.iter().for_each(|attempt| listed[attempt.target] = Some(&attempt.candidates));
        let others = gather(
            rig,
            targets,
            &frame_result.cloud,
            &listed,
            (&object_observations, &used),
            &self.settings().acceptance,
        );
        for (object, pairs) in &others.added {
            object_observations
                .see(*object, &Observations::of(pairs, &targets[*object].points, &frame_result.cloud, Some(rig)));
        }
        frame_result.gathered = others;
        object_observations
    }

    /// Replaces the pose of every fixed object by that of one joint fix. The joint fix uses all fixed objects, the
    /// gathered points of others and the observations `before`. If the images contradict each other or determine no
    /// joint fix, each object keeps its own pose and its attempt states the reason.
    pub fn join(
        &self,
        frame_result: &mut FrameResult,
        before: &[&ObjectObservations],
        own: &ObjectObservations,
        targets: &[Target],
        rig: &StereoRig,
    ) {
        if own.poses.is_empty() {
            return;
        }
        let start = Instant::now();
        // A frame that shares no object with this one adds no information about it.
        let related = |object_observations: &&&ObjectObservations| {
            (0..targets.len()).any(|object| own.shows(object) && object_observations.shows(object))
        };
        let all: Vec<ObjectObservations> = before.iter().filter(related).copied().chain([own]).cloned().collect();
        let members: Vec<Member> = targets.iter().map(Target::member).collect();
        let confidence = self.settings().acceptance.confidence;
        let parts = match joint_fixes(rig, &members, &all, confidence) {
            Ok(fixes) => {
                replace(frame_result, &fixes, targets, rig);
                describe(&frame_result.gathered, own, all.len(), &fixes, targets)
            }
            Err(why) => JointReport {
                all: format!("no joint fix, each object keeps its own pose: {why}"),
                ..JointReport::default()
            },
        };
        for attempt in &mut frame_result.attempts {
            attempt.joint = match attempt.answer.outcome {
                Outcome::Fix(_) => Some(parts.all.clone()),
                _ => parts.own.get(&attempt.target).cloned(),
            };
        }
        let spent = milliseconds(start);
        for attempt in &mut frame_result.attempts {
            for time in [&mut attempt.times.solve_ms, &mut attempt.times.total_ms].into_iter().flatten() {
                *time += spent;
            }
        }
    }
}

/// The sentences about a joint fix.
#[derive(Default)]
struct JointReport {
    /// The sentence for every fixed object.
    all: String,
    /// The sentence for each object without a fix of its own.
    own: BTreeMap<usize, String>,
}

fn describe(
    others: &Gathered,
    own: &ObjectObservations,
    instants: usize,
    fixes: &JointFixes,
    targets: &[Target],
) -> JointReport {
    let counted = |n: usize, one: &str| if n == 1 { format!("1 {one}") } else { format!("{n} {one}s") };
    let features = |[points, edges]: [usize; 2]| match (points, edges) {
        (_, 0) => counted(points, "point"),
        (0, _) => counted(edges, "edge"),
        _ => format!("{}, {}", counted(points, "point"), counted(edges, "edge")),
    };
    let (mut part, mut out, mut reported) = (Vec::new(), Vec::new(), BTreeMap::new());
    for (object, target) in targets.iter().enumerate().filter(|(object, _)| own.shows(*object)) {
        let (name, seen) = (&target.name, features(own.count(object)));
        let gathered = others.added.iter().any(|(added, _)| *added == object);
        if fixes.left_out.contains(&object) {
            let why = format!("{seen}, inconsistent with the other objects");
            out.push(format!("`{name}` ({why})"));
            reported.insert(object, format!("not in the joint fix: {why}"));
            continue;
        }
        let moved = if fixes.displaced.contains(&object) { ", displaced since the survey" } else { "" };
        let how = if gathered { ", without a fix of its own" } else { "" };
        part.push(format!("`{name}` ({seen}{how}{moved})"));
        if gathered {
            reported.insert(object, format!("{seen} used in the joint fix"));
        }
    }
    for (object, why) in &others.left_out {
        out.push(format!("`{}` ({why})", targets[*object].name));
        reported.insert(*object, format!("not in the joint fix: {why}"));
    }
    let mut all = format!("joint fix over {}", part.join(", "));
    if instants > 1 {
        all += &format!(
            " and the previous {}",
            if instants == 2 { "frame".to_owned() } else { format!("{} frames", instants - 1) }
        );
    }
    if !out.is_empty() {
        all += &format!("; excluded: {}", out.join(", "));
    }
    JointReport { all, own: reported }
}

fn replace(frame_result: &mut FrameResult, fixes: &JointFixes, targets: &[Target], rig: &StereoRig) {
    for attempt in &mut frame_result.attempts {
        let Outcome::Fix(fix) = &mut attempt.answer.outcome else { continue };
        let Some((pose, covariance)) = fixes.object_from_camera[attempt.target] else { continue };
        // The protection level of the object's own fix holds for the joint fix once the distance between the two is
        // added.
        let moved = (pose.translation() - fix.object_from_camera.translation()).norm();
        let turned = seafix_geometry::so3::angle(&(pose.rotation().inverse() * fix.object_from_camera.rotation()));
        if let Some(level) = &mut fix.integrity.protection {
            level.position += moved;
            level.attitude += turned;
        }
        (fix.object_from_camera, fix.covariance) = (pose, covariance);
        fix.used = (0..fix.pairs.len()).collect();
        let points = &targets[attempt.target].points;
        let data = Observations::of(&fix.pairs, points, &frame_result.cloud, Some(rig));
        (fix.residuals, fix.residual_rms) = (data.residuals(&pose), data.residual_rms(&pose));
    }
}
