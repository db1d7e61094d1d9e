//! Navigation along a pose graph: key frames are added and recognised during a dive.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2};
use seafix_component::{Settings, in_range};
use seafix_geometry::{Camera, Covariance6, Point, StereoRig, Transform, World};
use seafix_vision::Threads;
use serde::{Deserialize, Serialize};

use super::{
    Closed, FixEdge, OdometryEdge, PoseGraph, PoseNode, PriorPose,
    footprint::Footprint,
    in_world,
    keyframe::{KeyFrame, StereoFeatures},
    recognition::{LoopCandidate, NotRecognized, PlaceRecognizer, Recognition, Recognized},
};
use crate::{
    navigated::{Navigated, ObjectPlacement},
    odometry::StereoPair,
    odometry_trajectory::RelativeMotion,
};

/// The settings that control adding and matching of key frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PoseGraphSettings {
    /// Coverage threshold, above 0 and at most 1.
    ///
    /// A key frame is added where no existing one covers this fraction of the view.
    pub overlap: f64,
    /// Ratio of position standard deviations, above 1.
    ///
    /// A key frame is also added where every covering one is less accurate than the current pose by this factor.
    pub covariance_ratio: f64,
    /// Minimum time (s) between two searches for key frames; no search takes place in a frame with a fix.
    pub loop_interval: f64,
    /// Minimum path length (m) between adding a key frame and matching it again; over shorter paths odometry is more
    /// accurate.
    pub min_loop_distance: f64,
    /// Minimum coverage of the view by a candidate key frame, above 0 and at most 1.
    ///
    /// It is the coverage after the view is moved towards the key frame by at most three standard deviations of their
    /// distance.
    pub min_overlap: f64,
    /// Minimum time (s) between two visits of an object or key frame.
    ///
    /// Only the most accurate fix or loop of a visit enters the graph; the others share its errors (model,
    /// illumination, viewpoint).
    pub visit_gap: f64,
    /// The settings of place recognition.
    pub recognition: Recognition,
}

impl Default for PoseGraphSettings {
    fn default() -> Self {
        Self {
            overlap: 0.5,
            covariance_ratio: 2.0,
            loop_interval: 2.0,
            min_loop_distance: 10.0,
            min_overlap: 0.3,
            visit_gap: 10.0,
            recognition: Recognition::default(),
        }
    }
}

impl PoseGraphSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// A sentence that names the invalid setting.
    pub fn check(&self) -> Result<(), String> {
        let fraction = |name, x: f64| in_range(x > 0.0 && x <= 1.0, name, x, "a fraction above 0, at most 1");
        fraction("overlap", self.overlap)?;
        fraction("min-overlap", self.min_overlap)?;
        in_range(self.covariance_ratio > 1.0, "covariance-ratio", self.covariance_ratio, "a number above 1")?;
        let not_negative = |name, x: f64, what| in_range(x >= 0.0 && x.is_finite(), name, x, what);
        not_negative("loop-interval", self.loop_interval, "a time of at least 0 (s)")?;
        not_negative("min-loop-distance", self.min_loop_distance, "a length of at least 0 (m)")?;
        not_negative("visit-gap", self.visit_gap, "a time of at least 0 (s)")?;
        self.recognition.check().map_err(|message| format!("recognition.{message}"))
    }
}

/// The camera's pose at one instant, as known to navigation.
#[derive(Debug, Clone)]
pub struct PoseEstimate {
    /// Time (ns).
    pub stamp_ns: u64,
    /// The navigated pose relative to an object, if there is one.
    pub navigated: Option<Navigated>,
    /// The prior pose in the world, if there is one.
    pub prior_pose: Option<(Transform<World, Camera>, Covariance6<World, Camera>)>,
}

/// The result of one instant.
#[derive(Debug, Clone, Default)]
pub struct Closure {
    /// The pose node that became a key frame.
    pub added: Option<usize>,
    /// The result of the search for key frames, if one took place.
    pub sought: Option<Result<Relocalization, NotRecognized>>,
}

/// A relocalization: a recognised key frame and the resulting pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Relocalization {
    /// The pose node of the key frame.
    pub pose_node: usize,
    /// The recognition.
    pub recognized: Recognized,
    /// The camera's pose relative to an object, by the optimised graph.
    ///
    /// `None` if nothing connects them, or if the loop contradicts the rest of the graph and was rejected.
    pub navigated: Option<Navigated>,
    /// Whether the loop was rejected.
    pub given_up: bool,
}

/// The best fix of the current visit of an object.
#[derive(Debug, Clone, Copy)]
struct Visit {
    fix: usize,
    sigma: f64,
    seconds: f64,
}

/// The best loop of the current pass over a key frame.
///
/// The errors of a key frame's points are the same each time, so only the best loop of a pass enters the graph.
#[derive(Debug, Clone, Copy)]
struct Pass {
    index: usize,
    sigma: f64,
    seconds: f64,
}

/// Maximum ratio of standard deviations at which a fix or loop replaces the best one so far.
const CLEARLY: f64 = 0.8;

/// A dive along a pose graph.
#[derive(Debug)]
pub struct Traverse<'a> {
    settings: &'a PoseGraphSettings,
    recognizer: PlaceRecognizer<'a>,
    pose_graph: PoseGraph,
    /// For each pose node, its footprint; `added_at` holds the path length at which it was added, −∞ for earlier runs.
    footprints: Vec<Option<Footprint>>,
    added_at: Vec<f64>,
    /// The last pose node, while the motion since then is known.
    last: Option<usize>,
    /// The motion since the last pose node.
    since: RelativeMotion,
    path: f64,
    seconds: f64,
    sought_at: f64,
    /// The points of the last processed pair: a prediction of the view nearby.
    outline: Vec<Point<Camera>>,
    visits: Vec<Option<Visit>>,
    /// The current pass over each key frame, by pose node.
    passes: BTreeMap<usize, Pass>,
}

impl<'a> Traverse<'a> {
    /// A new dive that extends `pose_graph`, empty or from an earlier run.
    pub fn begin(settings: &'a PoseGraphSettings, pose_graph: PoseGraph, rig: &'a StereoRig, threads: Threads) -> Self {
        let visits = vec![None; pose_graph.objects.len()];
        let added_at = vec![f64::NEG_INFINITY; pose_graph.pose_nodes.len()];
        let mut traverse = Self {
            settings,
            recognizer: PlaceRecognizer::new(&settings.recognition, rig, threads),
            pose_graph,
            footprints: Vec::new(),
            added_at,
            last: None,
            since: still(),
            path: 0.0,
            seconds: 0.0,
            sought_at: f64::NEG_INFINITY,
            outline: Vec::new(),
            visits,
            passes: BTreeMap::new(),
        };
        traverse.arrange();
        traverse
    }

    /// The current pose graph.
    pub fn pose_graph(&self) -> &PoseGraph {
        &self.pose_graph
    }

    /// The final pose graph, with all loops closed.
    pub fn finish(mut self) -> PoseGraph {
        self.pose_graph.close();
        self.pose_graph
    }

    /// Propagates the pose by a motion over `seconds`; without a motion a new chain of edges begins.
    pub fn advance(&mut self, seconds: f64, motion: Option<&RelativeMotion>) {
        self.seconds += seconds;
        match motion {
            Some(motion) => {
                self.path += motion.motion.translation().norm();
                self.since = self.since.then(motion);
            }
            None => self.last = None,
        }
    }

    /// Replaces the placement of a displaced object.
    pub fn displaced(&mut self, object: usize, place: ObjectPlacement) {
        self.pose_graph.objects[object].1 = place;
    }

    /// Processes an instant: it adds fixes, searches for key frames in view, and adds a key frame where none covers the
    /// view.
    pub fn visit(&mut self, pair: &StereoPair<'_>, estimate: &PoseEstimate, fixes: &[Navigated]) -> Closure {
        self.visit_by(estimate, fixes, |recognizer| recognizer.stereo_features(pair))
    }

    /// Processes an instant, with the features computed on demand.
    pub(super) fn visit_by(
        &mut self,
        estimate: &PoseEstimate,
        fixes: &[Navigated],
        stereo_features: impl FnOnce(&mut PlaceRecognizer<'a>) -> StereoFeatures,
    ) -> Closure {
        let mut closure = Closure::default();
        let Some(world) = self.world(estimate) else { return closure };
        fixes.iter().for_each(|fix| self.fix(estimate, fix));
        let expected = Footprint::of(&self.outline, &world);
        let seek = fixes.is_empty()
            && self.seconds - self.sought_at >= self.settings.loop_interval
            && (self.outline.is_empty() || self.may_show(&expected, self.sigma(estimate)).next().is_some());
        if !(seek || self.wanted(&expected, estimate)) {
            return closure;
        }
        let stereo_features = stereo_features(&mut self.recognizer);
        if stereo_features.cloud.len() < self.settings.recognition.min_points {
            return closure;
        }
        self.outline = stereo_features.places();
        if seek && let Some(sought) = self.seek(&stereo_features, estimate) {
            self.sought_at = self.seconds;
            closure.sought = Some(sought);
        }
        let Some(world) = self.world(estimate) else { return closure };
        if self.wanted(&Footprint::of(&self.outline, &world), estimate) {
            let pose_node = self.pose_node(estimate);
            self.pose_graph.pose_nodes[pose_node].keyframe = Some(stereo_features.reduced());
            closure.added = Some(pose_node);
            self.close();
        }
        closure
    }

    /// The camera's pose in the world, if it is known.
    fn world(&self, estimate: &PoseEstimate) -> Option<Transform<World, Camera>> {
        let by_odometry = self.last.map(|last| self.pose_graph.pose_nodes[last].world_from_camera * self.since.motion);
        let by_object = || estimate.navigated.as_ref().map(|navigated| in_world(navigated, &self.places()).0);
        by_odometry.or_else(by_object).or_else(|| estimate.prior_pose.map(|(world, _)| world))
    }

    /// The standard deviation of the camera's position (m).
    fn sigma(&self, estimate: &PoseEstimate) -> f64 {
        let position = |matrix: &nalgebra::Matrix6<f64>| matrix.fixed_view::<3, 3>(3, 3).trace().sqrt();
        let by_odometry =
            self.last.map(|last| self.pose_graph.pose_nodes[last].sigma.hypot(self.since.covariance.position_rms()));
        let by_object = estimate.navigated.as_ref().map(|navigated| position(&in_world(navigated, &self.places()).1));
        let prior_pose = || estimate.prior_pose.map_or(f64::INFINITY, |(_, covariance)| covariance.position_rms());
        match (by_odometry, by_object) {
            (Some(a), Some(b)) => a.min(b),
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => prior_pose(),
        }
    }

    fn places(&self) -> Vec<ObjectPlacement> {
        self.pose_graph.objects.iter().map(|(_, place)| *place).collect()
    }

    /// Adds a fix if it is the best of its visit.
    fn fix(&mut self, estimate: &PoseEstimate, navigated: &Navigated) {
        let sigma = navigated.object_pose.covariance.position_rms();
        let visit =
            self.visits[navigated.object].filter(|visit| self.seconds - visit.seconds <= self.settings.visit_gap);
        if let Some(visit) = visit
            && sigma > CLEARLY * visit.sigma
        {
            self.visits[navigated.object] = Some(Visit { seconds: self.seconds, ..visit });
            return;
        }
        let fix = FixEdge { pose_node: self.pose_node(estimate), navigated: navigated.clone() };
        let index = visit.map_or(self.pose_graph.fixes.len(), |visit| visit.fix);
        match self.pose_graph.fixes.get_mut(index) {
            Some(worse) => *worse = fix,
            None => self.pose_graph.fixes.push(fix),
        }
        self.visits[navigated.object] = Some(Visit { fix: index, sigma, seconds: self.seconds });
    }

    /// The pose node of this instant, added if necessary.
    fn pose_node(&mut self, estimate: &PoseEstimate) -> usize {
        if let Some(last) = self.last.filter(|last| self.pose_graph.pose_nodes[*last].stamp_ns == estimate.stamp_ns) {
            return last;
        }
        let world_from_camera = self.world(estimate).expect("asked for before").renormalized();
        let sigma = self.sigma(estimate);
        let pose_node = self.pose_graph.add_node(PoseNode {
            stamp_ns: estimate.stamp_ns,
            world_from_camera,
            sigma,
            keyframe: None,
        });
        self.footprints.push(None);
        self.added_at.push(self.path);
        match self.last {
            Some(from) => self.pose_graph.odometry_edges.push(OdometryEdge { from, to: pose_node, motion: self.since }),
            // The first node of a chain has the acoustic prior, until an object or key frame is recognised.
            None => {
                if let Some((world_from_camera, covariance)) = estimate.prior_pose {
                    self.pose_graph.prior_poses.push(PriorPose { pose_node, world_from_camera, covariance });
                }
            }
        }
        self.last = Some(pose_node);
        self.since = still();
        pose_node
    }

    /// The key frames that may be in view, given the position uncertainty `sigma`.
    ///
    /// Each has its maximum coverage of the view and the distance between the centres of both footprints.
    fn may_show(&self, view: &Footprint, sigma: f64) -> impl Iterator<Item = (usize, f64, f64)> {
        /// Maximum distance in standard deviations.
        const FAR: f64 = 3.0;
        let each = self.footprints.iter().zip(&self.pose_graph.pose_nodes).zip(&self.added_at).enumerate();
        each.filter_map(move |(index, ((footprint, pose_node), added_at))| {
            let footprint = footprint.as_ref().filter(|_| self.path - added_at >= self.settings.min_loop_distance)?;
            let reach = FAR * sigma.hypot(pose_node.sigma);
            let apart: Vector2<f64> = footprint.middle()? - view.middle().unwrap_or_else(Point2::origin);
            let by = apart * f64::min(1.0, reach / apart.norm().max(1e-12));
            let covered = view.moved(by).covered_by(footprint);
            (covered >= self.settings.min_overlap).then_some((index, covered, apart.norm()))
        })
    }

    /// Whether a key frame should be added.
    fn wanted(&self, view: &Footprint, estimate: &PoseEstimate) -> bool {
        let covering = self.footprints.iter().zip(&self.pose_graph.pose_nodes).filter_map(|(footprint, pose_node)| {
            let fraction = view.covered_by(footprint.as_ref()?);
            (fraction >= self.settings.overlap).then_some(pose_node.sigma)
        });
        let best = covering.fold(f64::INFINITY, f64::min);
        best > self.settings.covariance_ratio * self.sigma(estimate)
    }

    /// Searches for key frames in view; `None` without a candidate.
    fn seek(
        &mut self,
        stereo_features: &StereoFeatures,
        estimate: &PoseEstimate,
    ) -> Option<Result<Relocalization, NotRecognized>> {
        let world = self.world(estimate)?;
        let view = Footprint::of(&self.outline, &world);
        self.may_show(&view, self.sigma(estimate)).next()?;
        let pose_node = self.pose_node(estimate);
        let closed = self.pose_graph.solve()?;
        // Candidates are sorted by coverage, then by distance.
        let mut near: Vec<(usize, f64, f64)> = self.may_show(&view, self.sigma(estimate)).collect();
        near.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.2.total_cmp(&b.2)).then(a.0.cmp(&b.0)));
        near.truncate(self.settings.recognition.candidates);
        let near: Vec<(usize, RelativeMotion)> =
            near.iter().filter_map(|(index, ..)| Some((*index, closed.relative(*index, pose_node)?))).collect();
        let candidates: Vec<LoopCandidate<'_>> = near
            .iter()
            .filter_map(|(index, prior)| {
                let keyframe: &KeyFrame = self.pose_graph.pose_nodes[*index].keyframe.as_ref()?;
                Some(LoopCandidate { keyframe, prior: *prior })
            })
            .collect();
        if candidates.is_empty() {
            return None;
        }
        let between = |a: usize, b: usize| closed.relative(near[a].0, near[b].0);
        let recognized = match self.recognizer.recognize(stereo_features, &candidates, between) {
            Ok(recognized) => recognized,
            Err(why) => return Some(Err(why)),
        };
        let from = near[recognized.keyframe].0;
        let odometry_edge = OdometryEdge { from, to: pose_node, motion: recognized.motion };
        let sigma = recognized.motion.covariance.position_rms();
        let pass =
            self.passes.get(&from).copied().filter(|pass| self.seconds - pass.seconds <= self.settings.visit_gap);
        if let Some(pass) = pass
            && sigma > CLEARLY * pass.sigma
        {
            self.passes.insert(from, Pass { seconds: self.seconds, ..pass });
            let navigated = self.best(&closed, pose_node, estimate);
            return Some(Ok(Relocalization { pose_node: from, recognized, navigated, given_up: false }));
        }
        let before = self.pose_graph.loops.clone();
        let index = pass.map_or(before.len(), |pass| pass.index);
        match self.pose_graph.loops.get_mut(index) {
            Some(worse) => *worse = odometry_edge,
            None => self.pose_graph.loops.push(odometry_edge),
        }
        let given_up = self.pose_graph.solve().is_none_or(|closed| closed.wrong_loops().contains(&index));
        let mut navigated = None;
        if given_up {
            self.pose_graph.loops = before;
        } else if let Some(closed) = self.close() {
            self.passes.insert(from, Pass { index, sigma, seconds: self.seconds });
            navigated = self.best(&closed, pose_node, estimate);
        }
        Some(Ok(Relocalization { pose_node: from, recognized, navigated, given_up }))
    }

    /// The camera's pose relative to its current object, or else to the object with the smallest covariance.
    fn best(&self, closed: &Closed, pose_node: usize, estimate: &PoseEstimate) -> Option<Navigated> {
        if let Some(known) = &estimate.navigated {
            return closed.navigated(known.object, pose_node);
        }
        let all = (0..self.pose_graph.objects.len()).filter_map(|object| closed.navigated(object, pose_node));
        let sigma = |navigated: &Navigated| navigated.object_pose.covariance.position_rms();
        all.min_by(|a, b| sigma(a).total_cmp(&sigma(b)))
    }

    fn close(&mut self) -> Option<Closed> {
        let closed = self.pose_graph.close()?;
        self.arrange();
        Some(closed)
    }

    /// Recomputes the footprints at the current poses of their nodes.
    fn arrange(&mut self) {
        let footprint = |pose_node: &PoseNode| {
            let keyframe = pose_node.keyframe.as_ref()?;
            Some(Footprint::of(&keyframe.places(), &pose_node.world_from_camera))
        };
        self.footprints = self.pose_graph.pose_nodes.iter().map(footprint).collect();
    }
}

/// The identity motion with zero covariance.
fn still() -> RelativeMotion {
    RelativeMotion::new(Transform::identity(), Covariance6::new(nalgebra::Matrix6::zeros()))
}
