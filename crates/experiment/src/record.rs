//! Conversion of results to log records.

use seafix::{FrameResult, Hints, Motion, NavigationState, SensorFrame, TargetAttempt};
use seafix_component::Registry;
use seafix_data::{
    log_conversion::{self, model, rows3, rows6},
    source::Sequence,
};
use seafix_geometry::{LensModel, MeasuredPoint, Object, Pinhole, Pixel, StereoPixels, StereoRig, Transform};
use seafix_log::{
    Alternative, Axis, BestPose, CameraRecord, CloudPoint, Component, EdgePair, FrameRecord, FrameTimes, Inputs,
    Integrity, NavigatedRecord, NavigationErrors, NavigationRecord, OdometryStep, Outcome as Logged, Pair, PixelPair,
    PriorRecord, RigRecord, SharedStages, TargetModel, TargetRecord, TargetTimes, TrialHeader,
};
use seafix_navigation::{FUSIONS, Navigated, ODOMETRIES, POLICIES};
use seafix_referencing::{Correspondence, Outcome, SEARCHES, SOLVERS, Target, TargetKind};
use seafix_vision::{DESCRIPTORS, DETECTORS, LOCATORS, MATCHERS};

use crate::{
    events::logged,
    experiment::{Experiment, Plan, Trial},
    git::Git,
    not_attempted::NotAttempted,
    pictures::Pictures,
    sweep::AxisValue,
};

/// The name of the search for labelled points.
const LABELLED: &str = "labelled";

/// The log header of `trial`, the same for every frame.
pub(crate) fn header(plan: &Plan, trial: &Trial, sequence: &dyn Sequence, targets: &[Target]) -> TrialHeader {
    let site = sequence.site();
    let world_from_site = site.objects.get(site.frame).and_then(|object| object.world_from_object);
    let pipeline = trial.stages.settings();
    let prior = sequence.prior_sigma();
    TrialHeader {
        run: plan.id(),
        trial: trial.name.clone(),
        title: plan.name.replace(['-', '_'], " "),
        question: plan.experiment.question.clone(),
        command: plan.command.clone(),
        axes: trial
            .cell
            .iter()
            .map(|AxisValue { key, value, .. }| Axis {
                key: key.clone(),
                value: value.as_str().map_or_else(|| value.to_string(), str::to_owned),
            })
            .collect(),
        components: components(&trial.resolved, sequence),
        configuration: toml::to_string(&trial.resolved).expect("a resolved experiment is plain values"),
        site: if site.objects.is_empty() { String::new() } else { site.to_toml() },
        source: sequence.name().to_owned(),
        rig: rig(sequence.rig()),
        body_from_camera: sequence.body_from_camera().rows(),
        world_from_site: world_from_site.map(|pose| pose.rows()),
        targets: targets
            .iter()
            .map(|target| TargetModel {
                site_from_object: match (world_from_site, target.world_from_object) {
                    (Some(site), Some(object)) => Some((site.inverse() * object).rows()),
                    _ => (pipeline.target == TargetKind::Site || target.name == site.frame_object().id)
                        .then(|| Transform::<Object, Object>::identity().rows()),
                },
                ..model(target)
            })
            .collect(),
        prior_position_sigma: prior.map(|(position, _)| position),
        prior_attitude_sigma: prior.map(|(_, attitude)| attitude),
        pixel_sigma: sequence.pixel_sigma().or_else(|| pipeline.pixel_sigma()),
        seeds: vec![("experiment".to_owned(), trial.resolved.seed)],
        versions: versions(),
    }
}

/// The results of one frame, without truth, for the tables of results.
pub(crate) fn frame(
    number: u64,
    sensor_frame: &SensorFrame,
    frame_result: &FrameResult,
    navigation_state: Option<&NavigationState>,
    shared: SharedStages,
    trial: &Trial,
    targets: &[Target],
) -> FrameRecord {
    let pipeline = trial.stages.settings();
    let search = if matches!(sensor_frame.hints, Hints::Labels(_)) { LABELLED } else { &pipeline.search.name };
    let solver = &pipeline.solver.name;
    let mut attempts: Vec<TargetRecord> =
        frame_result.attempts.iter().map(|attempt| target(attempt, &targets[attempt.target], search, solver)).collect();
    if attempts.is_empty() {
        let why = match navigation_state {
            Some(navigation_state) if !navigation_state.due => NotAttempted::NotDue,
            _ if frame_result.cloud.is_empty() && frame_result.lines.is_empty() => NotAttempted::NoData,
            _ => NotAttempted::NothingInView,
        };
        let without = TargetRecord::not_attempted(search, solver, why.reason());
        attempts.push(TargetRecord { explanation: why.sentence().to_owned(), ..without });
    }
    FrameRecord {
        frame: number,
        stamp_ns: sensor_frame.stamp_ns,
        targets: attempts,
        times: times(&frame_result.times, navigation_state, shared),
        navigation: navigation_state.map(|navigation_state| Box::new(navigation(navigation_state, targets))),
        ..FrameRecord::default()
    }
}

/// Adds the inputs of the frame, which only a log holds.
pub(crate) fn complete(
    record: &mut FrameRecord,
    sensor_frame: &SensorFrame,
    frame_result: &FrameResult,
    targets: &[Target],
    images: &Pictures,
) {
    let inputs = log_conversion::inputs(sensor_frame, &frame_result.cloud, targets);
    record.inputs = Some(Box::new(Inputs { exact_images: images.are_exact, ..inputs }));
    record.images.clone_from(&images.grey);
    record.key_points = frame_result.keypoints.iter().map(|keypoint| uv(&keypoint.at)).collect();
    let point = |point: &MeasuredPoint| CloudPoint {
        at: point.position.at.coords.into(),
        covariance: rows3(&point.position.covariance),
        pixels: point.pixels.map(|pixels| pixel_pair(&pixels.at)),
    };
    record.cloud = frame_result.cloud.iter().map(point).collect();
    record.lines = frame_result.lines.iter().map(log_conversion::line_record).collect();
    record.prior = sensor_frame.prior.map(|prior| PriorRecord { world_from_camera: prior.world_from_camera.rows() });
}

/// The result for one target.
fn target(attempt: &TargetAttempt, target: &Target, search: &str, solver: &str) -> TargetRecord {
    let answer = &attempt.answer;
    let mut record = TargetRecord::rejected(&target.name, search, solver, answer.outcome.reason().unwrap_or_default());
    record.candidates = attempt.candidates.lists.iter().map(|list| list.iter().map(|&j| j as u32).collect()).collect();
    let seafix::TargetTimes { candidates_ms, search_ms, solve_ms, total_ms } = attempt.times;
    record.times = TargetTimes { candidates_ms, search_ms, solve_ms, total_ms };
    record.optimal = Some(answer.optimal);
    record.consensus_bound = answer.consensus_bound.map(|n| n as u64);
    record.nfa = answer.nfa;
    record.p_absent = answer.p_absent;
    record.p_wrong = answer.p_wrong;
    record.best = answer.best.as_ref().map(|best| BestPose {
        object_from_camera: best.object_from_camera.rows(),
        covariance: best.covariance.map(|covariance| rows6(&covariance.matrix)),
        pairs: pairs(&best.pairs),
    });
    record.pair_tests = answer.pair_tests;
    record.pairs = pairs(&answer.identified);
    record.edges = edge_pairs(&answer.identified_edges);
    record.evaluation.identified = Some(answer.identified.len() as u32);
    record.evaluation.edges_identified = (!target.edges.is_empty()).then_some(answer.identified_edges.len() as u32);
    match &answer.outcome {
        Outcome::Fix(fix) => {
            record.outcome = Logged::Fix;
            record.object_from_camera = Some(fix.object_from_camera.rows());
            record.covariance = Some(rows6(&fix.covariance.matrix));
            record.pairs = pairs(&fix.pairs);
            record.edges = edge_pairs(&fix.edges);
            record.evaluation.identified = Some(fix.pairs.len() as u32);
            record.evaluation.edges_identified = (!target.edges.is_empty()).then_some(fix.edges.len() as u32);
            record.used = fix.used.iter().map(|&index| index as u32).collect();
            record.residual_rms = Some(fix.residual_rms);
            record.integrity = Some(integrity(&fix.integrity));
        }
        Outcome::Ambiguous(alternatives) => {
            record.outcome = Logged::Ambiguous;
            record.alternatives = alternatives
                .iter()
                .map(|other| Alternative {
                    object_from_camera: other.object_from_camera.rows(),
                    pairs: pairs(&other.pairs),
                    score: other.score,
                })
                .collect();
        }
        Outcome::Rejected(_) => record.outcome = Logged::Rejected,
        Outcome::Degenerate(_) => record.outcome = Logged::Degenerate,
    }
    let details = answer.outcome.sentence().into_iter().chain(attempt.joint.clone());
    record.explanation = details.collect::<Vec<_>>().join("; ");
    record
}

/// The durations of the stages, with those shared between trials.
fn times(spent: &seafix::FrameTimes, navigation_state: Option<&NavigationState>, shared: SharedStages) -> FrameTimes {
    let seafix::FrameTimes { detect_ms, locate_ms, describe_ms, match_ms, refine_ms, triangulate_ms } = *spent;
    let odometry_ms = navigation_state.map(|navigation_state| navigation_state.odometry_ms);
    FrameTimes { detect_ms, locate_ms, describe_ms, match_ms, refine_ms, triangulate_ms, odometry_ms, shared }
}

/// The state of navigation, without truth.
fn navigation(navigation_state: &NavigationState, targets: &[Target]) -> NavigationRecord {
    let pose = |pose: &Navigated| NavigatedRecord {
        object: targets[pose.object].name.clone(),
        object_from_camera: pose.object_pose.object_from_camera.rows(),
        covariance: rows6(&pose.object_pose.covariance.matrix),
    };
    NavigationRecord {
        state: navigation_state.state.to_string(),
        due: navigation_state.due,
        pose: navigation_state.pose.as_ref().map(pose),
        odometry_only: navigation_state.odometry_only.as_ref().map(pose),
        odometry: match &navigation_state.odometry {
            Motion::First => OdometryStep::default(),
            Motion::Known(step) => OdometryStep::known(step.motion.rows(), rows6(&step.covariance.matrix)),
            Motion::Skipped(why) => OdometryStep::skipped(why),
            Motion::Unknown(why) => OdometryStep::unknown(why),
        },
        events: navigation_state.events.iter().map(logged).collect(),
        errors: NavigationErrors::default(),
    }
}

fn integrity(it: &seafix_referencing::Integrity) -> Integrity {
    Integrity {
        redundancy: it.redundancy.name().to_owned(),
        chi2: it.chi2,
        dof: it.dof as u64,
        chi2_limit: it.chi2_limit,
        solution_separation: it.solution_separation,
        solution_separation_two: it.solution_separation_two,
        protection_position: it.protection.map(|level| level.position),
        protection_attitude: it.protection.map(|level| level.attitude),
        scale_error: it.scale_error.map(|it| it.value),
        scale_error_sigma: it.scale_error.map(|it| it.sigma),
        depth_error: it.depth_error.map(|it| it.value),
        depth_error_sigma: it.depth_error.map(|it| it.sigma),
    }
}

/// The components in use. A source of clouds uses no front end, and labelled points use no search.
fn components(experiment: &Experiment, sequence: &dyn Sequence) -> Vec<Component> {
    let pipeline = &experiment.pipeline;
    let front = [
        component(&DETECTORS, &pipeline.detector),
        component(&LOCATORS, &pipeline.locator),
        component(&DESCRIPTORS, &pipeline.descriptor),
        component(&MATCHERS, &pipeline.matcher),
    ];
    let search = match sequence.labelled() {
        false => component(&SEARCHES, &pipeline.search),
        true => Component {
            stage: SEARCHES.kind().to_owned(),
            name: LABELLED.to_owned(),
            summary: "none: all points are labelled".to_owned(),
            source: String::new(),
            settings: Vec::new(),
        },
    };
    let back = [search, component(&SOLVERS, &pipeline.solver)];
    let between = experiment.navigation.iter().flat_map(|navigation| {
        [
            component(&ODOMETRIES, &navigation.odometry),
            component(&POLICIES, &navigation.policy),
            component(&FUSIONS, &navigation.fusion),
        ]
    });
    front.into_iter().filter(|_| sequence.images()).chain(back).chain(between).collect()
}

fn versions() -> Vec<(String, String)> {
    let package = ("seafix".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
    let git = Git::here();
    let commit = git.commit.map(|commit| {
        let state = if git.dirty == Some(true) { " and uncommitted changes" } else { "" };
        ("commit".to_owned(), format!("{commit}{state}"))
    });
    std::iter::once(package).chain(commit).collect()
}

fn component<T: ?Sized>(registry: &Registry<T>, choice: &seafix_component::Choice) -> Component {
    let listing = registry.listings().into_iter().find(|listing| listing.name == choice.name);
    Component {
        stage: registry.kind().to_owned(),
        name: choice.name.clone(),
        summary: listing.as_ref().map_or_else(String::new, |listing| listing.summary.to_owned()),
        source: listing.as_ref().map_or_else(String::new, |listing| listing.source.to_owned()),
        settings: choice.settings.iter().map(|(key, value)| (key.clone(), value.to_string())).collect(),
    }
}

fn rig(rig: &StereoRig) -> RigRecord {
    RigRecord {
        left: camera(rig.left()),
        right: camera(rig.right()),
        right_from_left: rig.right_from_left().rows(),
        rectified: rig.is_rectified(),
        right_from_left_rotation: Some(log_conversion::pose(rig.right_from_left()).rotation),
    }
}

fn camera(camera: &Pinhole) -> CameraRecord {
    let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
    CameraRecord {
        size: camera.size(),
        matrix: [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
        distortion: camera.distortion().shortest().to_vec(),
        equidistant: camera.distortion().model() == LensModel::Equidistant,
    }
}

fn pairs(pairs: &[Correspondence]) -> Vec<Pair> {
    pairs.iter().map(|pair| Pair { model: pair.model as u32, cloud: pair.cloud as u32 }).collect()
}

fn edge_pairs(pairs: &[Correspondence]) -> Vec<EdgePair> {
    pairs.iter().map(|pair| EdgePair { model: pair.model as u32, line: pair.cloud as u32 }).collect()
}

pub(crate) fn pixel_pair(pixels: &StereoPixels) -> PixelPair {
    PixelPair { left: uv(&pixels.left), right: uv(&pixels.right) }
}

fn uv(pixel: &Pixel) -> [f64; 2] {
    [pixel.u, pixel.v]
}
