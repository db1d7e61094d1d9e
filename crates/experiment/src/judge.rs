//! The only place where results and ground truth meet, after the pipeline has finished.

use nalgebra::Vector3;
use seafix_evaluation::{
    alert_limit, attitude_error, nees, position_error, residual_rms, symmetric_distance, symmetric_projection_distance,
    transfer_bound, transfer_rms,
};
use seafix_geometry::{Camera, Object, Point, StereoPixels, StereoRig, Transform, World};
use seafix_log::{Evaluation, FrameRecord, NavigationErrors, TruthRecord, VisiblePoint};
use seafix_navigation::Navigated;
use seafix_referencing::{Correspondence, Fix, Outcome, Site, Target, TargetKind};

use seafix::{FrameResult, NavigationState};
use seafix_data::{log_conversion, source::Truth};

use crate::{inspect, true_edges::TrueEdges};

/// The maximum distance (px) between a correct pair's cloud point and its model point's true projections.
pub(crate) const CORRECT_PX: f64 = 2.0;

/// A target with its ground truth at one instant.
struct TrueTarget<'a> {
    target: &'a Target,
    /// The true pose of the target's frame.
    world_from_object: Transform<World, Object>,
    /// The true position of each of its points in the camera frame; single objects may be displaced.
    points: Vec<Point<Camera>>,
    /// The visibility of its points to both cameras; `None` if unknown.
    visible: Option<Vec<bool>>,
}

/// The evaluation of a trial: the ground truth of an instant, and the targets.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evaluator<'a> {
    pub(crate) truth: &'a Truth,
    pub(crate) site: &'a Site,
    pub(crate) targets: &'a [Target],
    pub(crate) kind: TargetKind,
    pub(crate) rig: &'a StereoRig,
}

impl<'a> Evaluator<'a> {
    /// Adds the evaluation of every attempt.
    pub(crate) fn evaluate(
        &self,
        record: &mut FrameRecord,
        frame_result: &FrameResult,
        navigation_state: Option<&NavigationState>,
    ) {
        let Evaluator { truth, kind, rig, .. } = *self;
        if let (Some(navigation_state), Some(row)) = (navigation_state, &mut record.navigation) {
            row.errors = errors(navigation_state, self);
        }
        record.poi = inspect::poi(truth, self.site, rig, kind, frame_result, navigation_state);
        for (attempt, row) in frame_result.attempts.iter().zip(record.targets.iter_mut()) {
            let Some(known) = &self.known(attempt.target) else { continue };
            let Evaluation { identified, edges_identified, .. } = row.evaluation;
            let edges = (!known.target.edges.is_empty())
                .then(|| TrueEdges::of(known.target, &known.points, &camera_from(known, truth), rig));
            row.evaluation = Evaluation {
                identified,
                edges_identified,
                visible: count_visible(known, rig),
                edges_visible: edges.as_ref().map(TrueEdges::visible),
                wrong: Some(false),
                alert_limit: Some(alert_limit(known.target.diameter())),
                ..Evaluation::default()
            };
            if let Some((_, bound)) =
                truth.bound.filter(|(object, _)| kind != TargetKind::Site && *object == attempt.target)
            {
                let true_pose = known.world_from_object.inverse() * truth.world_from_camera;
                let model: Vec<Point<Object>> = known.target.points.iter().map(|point| point.at).collect();
                row.evaluation.tre_crlb = Some(transfer_bound(&bound, &true_pose, &model));
                row.evaluation.position_crlb = Some(bound.position_rms());
            }
            if let Outcome::Fix(fix) = &attempt.answer.outcome {
                evaluate(&mut row.evaluation, fix, known, frame_result, truth, rig);
                row.evaluation.correct_edges =
                    edges.as_ref().map(|edges| edges.correct(&fix.edges, &frame_result.lines));
            }
        }
    }

    /// Adds the ground truth, which only a log holds.
    pub(crate) fn annotate(&self, record: &mut FrameRecord) {
        let known: Vec<TrueTarget<'_>> = (0..self.targets.len()).filter_map(|index| self.known(index)).collect();
        record.truth = Some(TruthRecord {
            world_from_camera: self.truth.world_from_camera.rows(),
            world_from_object: known
                .iter()
                .map(|known| (known.target.name.clone(), known.world_from_object.rows()))
                .collect(),
            visible: known.iter().flat_map(visible_points).collect(),
        });
        if let Some(inputs) = &mut record.inputs {
            inputs.truth = Some(log_conversion::truth(self.truth, self.site));
        }
    }

    /// The ground truth of one target.
    fn known(&self, index: usize) -> Option<TrueTarget<'a>> {
        let objects = match self.kind {
            TargetKind::Object | TargetKind::Joint => index..index + 1,
            TargetKind::Site => 0..self.site.objects.len(),
        };
        true_target(&self.targets[index], objects, self.site, self.truth, self.kind)
    }
}

/// The errors of the navigated poses, each relative to its own object.
fn errors(navigation_state: &NavigationState, judge: &Evaluator<'_>) -> NavigationErrors {
    let mut errors = NavigationErrors::default();
    let of = |navigated: &Navigated| {
        let known = judge.known(navigated.object)?;
        let true_pose = known.world_from_object.inverse() * judge.truth.world_from_camera;
        Some((known, navigated.object_pose.object_from_camera, true_pose))
    };
    if let Some(navigated) = &navigation_state.pose
        && let Some((known, estimate, true_pose)) = of(navigated)
    {
        let model: Vec<Point<Object>> = known.target.points.iter().map(|point| point.at).collect();
        let sum: Vector3<f64> = known.points.iter().map(|point| point.coords).sum();
        let centroid = Point::from(sum / known.points.len() as f64);
        errors.tre_rms = transfer_rms(&estimate, &true_pose, &model);
        errors.position_error = Some(position_error(&estimate, &true_pose));
        errors.attitude_error = Some(attitude_error(&estimate, &true_pose));
        errors.nees = nees(&estimate, &true_pose, &navigated.object_pose.covariance, &centroid);
    }
    if let Some((_, estimate, true_pose)) = navigation_state.odometry_only.as_ref().and_then(of) {
        errors.odometry_only_position_error = Some(position_error(&estimate, &true_pose));
        errors.odometry_only_attitude_error = Some(attitude_error(&estimate, &true_pose));
    }
    errors
}

fn true_target<'a>(
    target: &'a Target,
    objects: std::ops::Range<usize>,
    site: &Site,
    truth: &Truth,
    kind: TargetKind,
) -> Option<TrueTarget<'a>> {
    let frame = match kind {
        TargetKind::Object | TargetKind::Joint => objects.start,
        TargetKind::Site => site.frame,
    };
    let camera_from_world = truth.world_from_camera.inverse();
    let mut points = Vec::with_capacity(target.points.len());
    let mut visible = truth.visible.as_ref().map(|_| Vec::with_capacity(target.points.len()));
    for o in objects {
        let camera_from_object = camera_from_world * truth.world_from_object[o]?;
        for (p, point) in site.objects[o].points.iter().enumerate() {
            points.push(camera_from_object * point.at);
            if let (Some(mask), Some(seen)) = (&mut visible, &truth.visible) {
                mask.push(seen.contains(&(o, p)));
            }
        }
    }
    Some(TrueTarget { target, world_from_object: truth.world_from_object[frame]?, points, visible })
}

fn visible_points(known: &TrueTarget<'_>) -> Vec<VisiblePoint> {
    let mask = known.visible.as_deref().unwrap_or_default();
    let seen = mask.iter().enumerate().filter(|(_, seen)| **seen);
    seen.map(|(point, _)| VisiblePoint { object: known.target.name.clone(), point: point as u32 }).collect()
}

/// The true pose of a target in the camera's frame.
fn camera_from(known: &TrueTarget<'_>, truth: &Truth) -> Transform<Camera, Object> {
    truth.world_from_camera.inverse() * known.world_from_object
}

/// The number of the target's points in view of both cameras: by the data set, otherwise by projection.
fn count_visible(known: &TrueTarget<'_>, rig: &StereoRig) -> Option<u32> {
    let count = match &known.visible {
        Some(mask) => mask.iter().filter(|seen| **seen).count(),
        None => known.points.iter().filter(|point| rig.sees(point, 0.0).is_some()).count(),
    };
    Some(count as u32)
}

fn evaluate(
    row: &mut Evaluation,
    fix: &Fix,
    known: &TrueTarget<'_>,
    frame_result: &FrameResult,
    truth: &Truth,
    rig: &StereoRig,
) {
    let estimate = &fix.object_from_camera;
    let true_pose = known.world_from_object.inverse() * truth.world_from_camera;
    let model: Vec<Point<Object>> = known.target.points.iter().map(|point| point.at).collect();
    let correct = |pair: &Correspondence| match &truth.answer {
        Some(answer) => answer.pairs.contains(&(pair.model, pair.cloud)),
        None => shows_the_point(pair, known, frame_result, rig),
    };
    let is_correct: Vec<bool> = fix.pairs.iter().map(correct).collect();
    let of = |keep: &dyn Fn(usize) -> bool| -> Vec<(Point<Camera>, Point<Object>)> {
        let kept = fix.pairs.iter().enumerate().filter(|(index, _)| is_correct[*index] && keep(*index));
        kept.map(|(_, pair)| (frame_result.cloud[pair.cloud].position.at, model[pair.model])).collect()
    };
    let used: Vec<Vector3<f64>> =
        fix.used.iter().map(|&index| frame_result.cloud[fix.pairs[index].cloud].position.at.coords).collect();
    let centroid = Point::from(used.iter().sum::<Vector3<f64>>() / used.len().max(1) as f64);

    row.correct_pairs = Some(is_correct.iter().filter(|correct| **correct).count() as u32);
    row.wrong_pairs = Some(fix.used.iter().any(|&index| !is_correct[index]));
    row.fit_rms = residual_rms(estimate, &of(&|_| true));
    row.fit_rms_unused = residual_rms(estimate, &of(&|index| !fix.used.contains(&index)));
    row.tre_rms = transfer_rms(estimate, &true_pose, &model);
    // Each problem has a model of its own, whose self-symmetries take longer than its search.
    if truth.answer.is_none() {
        let symmetries = symmetries(known.target);
        row.mssd = symmetric_distance(estimate, &true_pose, &model, &symmetries);
        row.mspd = symmetric_projection_distance(estimate, &true_pose, &model, &symmetries, rig.left());
    }
    row.position_error = Some(position_error(estimate, &true_pose));
    row.attitude_error = Some(attitude_error(estimate, &true_pose));
    row.nees = nees(estimate, &true_pose, &fix.covariance, &centroid);
    row.wrong = match &truth.answer {
        Some(answer) => Some(!answer.rule.holds(estimate, &true_pose, &model)),
        None => row.tre_rms.map(|tre| !(tre <= alert_limit(known.target.diameter()))),
    };
}

/// The motions that map every point of a target onto one, and its normal onto that point's.
fn symmetries(target: &Target) -> Vec<Transform<Object, Object>> {
    let agree = |motion: &Transform<Object, Object>, (from, to): &(usize, usize)| {
        let normals = target.points[*from].normal.zip(target.points[*to].normal);
        normals.is_none_or(|(a, b)| (motion.rotation() * a).dot(&b) > 0.0)
    };
    let complete = target.congruences().iter().filter(|it| it.broken_by.is_empty());
    complete.filter(|it| it.pairs.iter().all(|pair| agree(&it.motion, pair))).map(|it| it.motion).collect()
}

/// Whether the cloud point of `pair` is at its model point's true projections in both images.
fn shows_the_point(pair: &Correspondence, known: &TrueTarget<'_>, frame_result: &FrameResult, rig: &StereoRig) -> bool {
    let measured = &frame_result.cloud[pair.cloud];
    let shown: Option<StereoPixels> =
        measured.pixels.map(|pixels| pixels.at).or_else(|| rig.project(&measured.position.at));
    let (Some(shown), Some(expected)) = (shown, rig.project(&known.points[pair.model])) else { return false };
    shown.left.distance(&expected.left) <= CORRECT_PX && shown.right.distance(&expected.right) <= CORRECT_PX
}
