//! A run along a network: key frames are laid on the way, and found again.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2};
use seafix_component::in_range;
use seafix_geometry::{Camera, Covariance6, Point, StereoRig, Transform, World};
use seafix_vision::Threads;
use serde::{Deserialize, Serialize};

use super::{
    Closed, FixEdge, Footprint, KeyFrame, LoopCandidate, NotRecognized, OdometryEdge, PlaceRecognizer, PoseGraph,
    PoseNode, PriorPose, Recognition, Recognized, StereoFeatures, in_world,
};
use crate::{Navigated, ObjectPlacement, RelativeMotion, StereoPair};

/// When key frames are laid and sought.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PoseGraphSettings {
    /// A key frame is laid where those there are cover less than this share of what is in view,
    pub overlap: f64,
    /// or where the pose is known so many times better than at each of those that cover it.
    pub covariance_ratio: f64,
    /// Key frames are sought no sooner than this after the last time (s), and only where no object was fixed,
    pub loop_interval: f64,
    /// and none that was laid less than so much of this run's way ago (m): odometry knows that better.
    pub min_loop_distance: f64,
    /// A key frame is tried that may cover this share of what is in view.
    pub min_overlap: f64,
    /// Fixes of an object with less time between them are of one visit (s), and only the best of a visit counts: the others
    /// share its errors, of the model, of the light, of the view. The same holds for key frames found again.
    pub visit_gap: f64,
    /// How they are recognised.
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
    /// What cannot be worked with, as a sentence.
    ///
    /// # Errors
    /// The sentence.
    pub fn check(&self) -> Result<(), String> {
        let fraction = |name, x: f64| in_range(x > 0.0 && x <= 1.0, name, x, "a share above 0, up to 1");
        fraction("overlap", self.overlap)?;
        fraction("min-overlap", self.min_overlap)?;
        in_range(self.covariance_ratio > 1.0, "covariance-ratio", self.covariance_ratio, "a number above 1")?;
        let not_negative = |name, x: f64, what| in_range(x >= 0.0 && x.is_finite(), name, x, what);
        not_negative("loop-interval", self.loop_interval, "a time of 0 or more (s)")?;
        not_negative("min-loop-distance", self.min_loop_distance, "a length of 0 or more (m)")?;
        not_negative("visit-gap", self.visit_gap, "a time of 0 or more (s)")?;
        self.recognition.check().map_err(|said| format!("recognition.{said}"))
    }
}

/// What is known of the camera at an instant.
#[derive(Debug, Clone)]
pub struct PoseEstimate {
    /// When (ns).
    pub stamp_ns: u64,
    /// The navigated pose, where there is one.
    pub navigated: Option<Navigated>,
    /// The rough pose, where there is one.
    pub prior_pose: Option<(Transform<World, Camera>, Covariance6<World, Camera>)>,
}

/// What became of an instant.
#[derive(Debug, Clone, Default)]
pub struct Closure {
    /// The station that was laid as a key frame.
    pub added: Option<usize>,
    /// What came of the search, where there was one.
    pub sought: Option<Result<Relocalization, NotRecognized>>,
}

/// A key frame that was found again.
#[derive(Debug, Clone, PartialEq)]
pub struct Relocalization {
    /// Its station.
    pub pose_node: usize,
    /// How it was recognised.
    pub recognized: Recognized,
    /// The camera relative to an object, by all that the network knows now; `None` where nothing connects them, or where
    /// the loop contradicts the rest of the network and was given up.
    pub navigated: Option<Navigated>,
    /// Whether the loop was given up.
    pub given_up: bool,
}

/// The last fix of an object that counts.
#[derive(Debug, Clone, Copy)]
struct Visit {
    fix: usize,
    sigma: f64,
    seconds: f64,
}

/// The last time a key frame was found again, as long as the vehicle is over it: its points err alike each time, so only
/// the best of a pass counts.
#[derive(Debug, Clone, Copy)]
struct Pass {
    index: usize,
    sigma: f64,
    seconds: f64,
}

/// A fix or a loop must be so much better than the best of its visit or pass to take its place.
const CLEARLY: f64 = 0.8;

/// A run along a network.
#[derive(Debug)]
pub struct Traverse<'a> {
    settings: &'a PoseGraphSettings,
    recognizer: PlaceRecognizer<'a>,
    pose_graph: PoseGraph,
    /// Of each station, what it shows and at which length of this run's way it was laid; earlier runs' long before.
    footprints: Vec<Option<Footprint>>,
    added_at: Vec<f64>,
    /// The last station, while the motion since is known.
    last: Option<usize>,
    /// The motion since then.
    since: RelativeMotion,
    path: f64,
    seconds: f64,
    sought_at: f64,
    /// Points of the last glance: what will be in view near by.
    outline: Vec<Point<Camera>>,
    visits: Vec<Option<Visit>>,
    /// By the key frame's station.
    passes: BTreeMap<usize, Pass>,
}

impl<'a> Traverse<'a> {
    /// Sets out in `pose_graph`, empty or laid by an earlier run.
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

    /// The network as it is by now.
    pub fn pose_graph(&self) -> &PoseGraph {
        &self.pose_graph
    }

    /// The network, its loops closed.
    pub fn finish(mut self) -> PoseGraph {
        self.pose_graph.close();
        self.pose_graph
    }

    /// Some time and the motion in it; without a motion a new chain begins.
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

    /// An object stands elsewhere than was believed.
    pub fn displaced(&mut self, object: usize, place: ObjectPlacement) {
        self.pose_graph.objects[object].1 = place;
    }

    /// A new instant: its fixes are taken in, a key frame is sought where one may be, and one is laid where there is none.
    pub fn visit(&mut self, pair: &StereoPair<'_>, estimate: &PoseEstimate, fixes: &[Navigated]) -> Closure {
        self.visit_by(estimate, fixes, |recognizer| recognizer.stereo_features(pair))
    }

    /// The same, what is in view being made when it is asked for.
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

    /// Where the camera is, as far as is known.
    fn world(&self, estimate: &PoseEstimate) -> Option<Transform<World, Camera>> {
        let by_odometry = self.last.map(|last| self.pose_graph.pose_nodes[last].world_from_camera * self.since.motion);
        let by_object = || estimate.navigated.as_ref().map(|navigated| in_world(navigated, &self.places()).0);
        by_odometry.or_else(by_object).or_else(|| estimate.prior_pose.map(|(world, _)| world))
    }

    /// How well: one standard deviation of the position (m).
    fn sigma(&self, estimate: &PoseEstimate) -> f64 {
        let position = |matrix: &nalgebra::Matrix6<f64>| matrix.fixed_view::<3, 3>(3, 3).trace().sqrt();
        let by_odometry =
            self.last.map(|last| self.pose_graph.pose_nodes[last].sigma.hypot(self.since.covariance.position_sigma()));
        let by_object = estimate.navigated.as_ref().map(|navigated| position(&in_world(navigated, &self.places()).1));
        let prior_pose = || estimate.prior_pose.map_or(f64::INFINITY, |(_, covariance)| covariance.position_sigma());
        match (by_odometry, by_object) {
            (Some(a), Some(b)) => a.min(b),
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => prior_pose(),
        }
    }

    fn places(&self) -> Vec<ObjectPlacement> {
        self.pose_graph.objects.iter().map(|(_, place)| *place).collect()
    }

    /// Takes in a fix, if it is the best of its visit.
    fn fix(&mut self, estimate: &PoseEstimate, navigated: &Navigated) {
        let sigma = navigated.object_pose.covariance.position_sigma();
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

    /// The station of this instant, laid if there is none yet.
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
            // A chain hangs on something: until an object is fixed or a key frame recognised, on acoustics.
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

    /// Key frames that may show what is in view when it is known so well, how much of it they cover at best, and how far
    /// their middle is from where it should be.
    fn may_show(&self, view: &Footprint, sigma: f64) -> impl Iterator<Item = (usize, f64, f64)> {
        /// So many standard deviations off.
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

    /// Whether a key frame should be laid.
    fn wanted(&self, view: &Footprint, estimate: &PoseEstimate) -> bool {
        let covering = self.footprints.iter().zip(&self.pose_graph.pose_nodes).filter_map(|(footprint, pose_node)| {
            let fraction = view.covered_by(footprint.as_ref()?);
            (fraction >= self.settings.overlap).then_some(pose_node.sigma)
        });
        let best = covering.fold(f64::INFINITY, f64::min);
        best > self.settings.covariance_ratio * self.sigma(estimate)
    }

    /// Seeks a key frame; `None` where there is nothing to seek.
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
        // Those that cover most of it come first, and of these the nearest.
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
        let sigma = recognized.motion.covariance.position_sigma();
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

    /// The camera relative to the object that it is navigated by, or to the one it is known best to.
    fn best(&self, closed: &Closed, pose_node: usize, estimate: &PoseEstimate) -> Option<Navigated> {
        if let Some(known) = &estimate.navigated {
            return closed.navigated(known.object, pose_node);
        }
        let all = (0..self.pose_graph.objects.len()).filter_map(|object| closed.navigated(object, pose_node));
        let sigma = |navigated: &Navigated| navigated.object_pose.covariance.position_sigma();
        all.min_by(|a, b| sigma(a).total_cmp(&sigma(b)))
    }

    fn close(&mut self) -> Option<Closed> {
        let closed = self.pose_graph.close()?;
        self.arrange();
        Some(closed)
    }

    /// Lays the footprints where the stations are by now.
    fn arrange(&mut self) {
        let footprint = |pose_node: &PoseNode| {
            let keyframe = pose_node.keyframe.as_ref()?;
            Some(Footprint::of(&keyframe.places(), &pose_node.world_from_camera))
        };
        self.footprints = self.pose_graph.pose_nodes.iter().map(footprint).collect();
    }
}

/// No motion, exactly known.
fn still() -> RelativeMotion {
    RelativeMotion::new(Transform::identity(), Covariance6::new(nalgebra::Matrix6::zeros()))
}
