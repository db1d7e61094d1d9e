//! Reference points where no object is: key frames laid on the way, found again, and joined in a graph.

mod drift;
mod file;
mod footprint;
mod graph;
mod keyframe;
mod recognition;
#[cfg(test)]
mod tests;
mod traverse;

use std::collections::BTreeMap;

use nalgebra::Matrix6;
use seafix_geometry::{Camera, Covariance6, Transform, World};

use crate::{Navigated, ObjectPlacement, ObjectPose, RelativeMotion};

pub use footprint::Footprint;
pub use graph::{FactorGraph, GraphSolution, NoCovariance};
pub use keyframe::{KeyFrame, StereoFeatures};
pub use recognition::{LoopCandidate, NotRecognized, PlaceRecognizer, Recognition, Recognized};
pub use traverse::{Closure, PoseEstimate, PoseGraphSettings, Relocalization, Traverse};

/// A place on the way that is a node of the graph.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseNode {
    /// When the camera was there (ns).
    pub stamp_ns: u64,
    /// Where that is, as known by now.
    pub world_from_camera: Transform<World, Camera>,
    /// How well its position is known: one standard deviation over the three axes together (m).
    pub sigma: f64,
    /// What it looks like there, where that was kept.
    pub keyframe: Option<KeyFrame>,
}

/// The motion between two stations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryEdge {
    /// The station where it begins.
    pub from: usize,
    /// The station where it ends.
    pub to: usize,
    /// `from_from_to`. Legs that follow each other share errors that [last](crate::CorrelatedError): the Doppler log's scale, the
    /// gyro's bias.
    pub motion: RelativeMotion,
}

/// A fix of an object, taken at a station.
#[derive(Debug, Clone, PartialEq)]
pub struct FixEdge {
    /// The station.
    pub pose_node: usize,
    /// Where the camera was relative to the object.
    pub navigated: Navigated,
}

/// A pose of a station from elsewhere: acoustics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorPose {
    /// The station.
    pub pose_node: usize,
    /// Its pose.
    pub world_from_camera: Transform<World, Camera>,
    /// The covariance of that.
    pub covariance: Covariance6<World, Camera>,
}

/// Stations, what lies between them, and the objects of the site they hang on: all that is needed to say where every
/// key frame is, and how well that is known.
///
/// It may be laid by one run and go on in another: what two runs have in common, objects and key frames that were found
/// again, joins them in one graph.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PoseGraph {
    /// Names and places of the objects.
    pub objects: Vec<(String, ObjectPlacement)>,
    /// The stations, in order of being laid.
    pub pose_nodes: Vec<PoseNode>,
    /// What odometry measured between successive ones.
    pub odometry_edges: Vec<OdometryEdge>,
    /// Fixes of objects.
    pub fixes: Vec<FixEdge>,
    /// Poses from elsewhere.
    pub prior_poses: Vec<PriorPose>,
    /// Key frames found again: `from` is the key frame.
    pub loops: Vec<OdometryEdge>,
}

/// The graph of a network at its most likely poses.
#[derive(Debug, Clone)]
pub struct Closed {
    solved: GraphSolution,
    objects: usize,
    /// The factor of each loop.
    loops: Vec<usize>,
    fixes: Vec<usize>,
    /// Of a station, the node of errors that last.
    correlated: BTreeMap<usize, usize>,
}

impl PoseGraph {
    /// A network without stations, at a site with these objects.
    pub fn new(objects: Vec<(String, ObjectPlacement)>) -> Self {
        Self { objects, ..Self::default() }
    }

    /// Lays a station; its number.
    pub fn add_node(&mut self, pose_node: PoseNode) -> usize {
        self.pose_nodes.push(pose_node);
        self.pose_nodes.len() - 1
    }

    /// The most likely poses of all stations and objects, every measurement taken into account. Fixes and loops may be
    /// wrong: those that contradict the rest are given up.
    ///
    /// An object without a survey covariance stands exactly. Errors of the odometry that last are estimated along with the
    /// poses, from leg to leg as long as one begins where the other ends; a new chain knows nothing of them.
    ///
    /// `None` where the equations have no solution.
    pub fn solve(&self) -> Option<Closed> {
        let mut graph = FactorGraph::default();
        for (_, place) in &self.objects {
            let pose = place.world_from_object.relabel();
            let node = graph.node(pose);
            if graph.prior(node, pose, &place.covariance.matrix).is_err() {
                graph.hold(node);
            }
        }
        let first = self.objects.len();
        for pose_node in &self.pose_nodes {
            graph.node(pose_node.world_from_camera);
        }
        let mut correlated = BTreeMap::new();
        for odometry_edge in &self.odometry_edges {
            let before = correlated.get(&odometry_edge.from).copied();
            if let Some(after) = graph
                .drifting(first + odometry_edge.from, first + odometry_edge.to, &odometry_edge.motion, before)
                .ok()?
            {
                correlated.insert(odometry_edge.to, after);
            }
        }
        for prior_pose in &self.prior_poses {
            graph
                .prior(first + prior_pose.pose_node, prior_pose.world_from_camera, &prior_pose.covariance.matrix)
                .ok()?;
        }
        let mut fixes = Vec::new();
        for fix in &self.fixes {
            let ObjectPose { object_from_camera, covariance, .. } = fix.navigated.object_pose;
            let motion = RelativeMotion::new(object_from_camera.relabel(), Covariance6::new(covariance.matrix));
            fixes.push(graph.between(fix.navigated.object, first + fix.pose_node, &motion, true).ok()?);
        }
        let mut loops = Vec::new();
        for odometry_edge in &self.loops {
            loops.push(
                graph
                    .between(first + odometry_edge.from, first + odometry_edge.to, &odometry_edge.motion, true)
                    .ok()?,
            );
        }
        Some(Closed { solved: graph.solve()?, objects: first, loops, fixes, correlated })
    }

    /// Closes its loops: every station moves to its most likely pose. What was found; `None` where the equations have no
    /// solution, and nothing moves.
    pub fn close(&mut self) -> Option<Closed> {
        let closed = self.solve()?;
        for (index, pose_node) in self.pose_nodes.iter_mut().enumerate() {
            pose_node.world_from_camera = *closed.pose_node(index);
            pose_node.sigma = closed.covariance(index).position_sigma();
        }
        Some(closed)
    }

    /// The stations that are key frames.
    pub fn keyframes(&self) -> impl Iterator<Item = (usize, &PoseNode, &KeyFrame)> {
        self.pose_nodes
            .iter()
            .enumerate()
            .filter_map(|(index, pose_node)| Some((index, pose_node, pose_node.keyframe.as_ref()?)))
    }
}

impl Closed {
    /// Where a station is.
    pub fn pose_node(&self, pose_node: usize) -> &Transform<World, Camera> {
        self.solved.pose(self.objects + pose_node)
    }

    /// How well that is known.
    pub fn covariance(&self, pose_node: usize) -> Covariance6<World, Camera> {
        self.solved.covariance(self.objects + pose_node)
    }

    /// The motion from one station to another, with what both errors have in common taken into account.
    pub fn relative(&self, from: usize, to: usize) -> Option<RelativeMotion> {
        self.solved.relative(self.objects + from, self.objects + to)
    }

    /// A station relative to an object. `None` where nothing connects them.
    pub fn navigated(&self, object: usize, pose_node: usize) -> Option<Navigated> {
        let to = self.objects + pose_node;
        let RelativeMotion { motion, covariance, .. } = self.solved.relative(object, to)?;
        let object_pose = ObjectPose::new(motion.relabel(), Covariance6::new(covariance.matrix));
        let sensitivities =
            self.correlated.get(&pose_node).map(|correlated| self.solved.sensitivities(object, to, *correlated));
        Some(Navigated {
            object,
            object_pose: ObjectPose {
                sensitivities: sensitivities.unwrap_or(object_pose.sensitivities),
                ..object_pose
            },
        })
    }

    /// The loops that were given up: they contradict the rest.
    pub fn wrong_loops(&self) -> Vec<usize> {
        self.given_up(&self.loops)
    }

    /// The fixes that were given up.
    pub fn wrong_fixes(&self) -> Vec<usize> {
        self.given_up(&self.fixes)
    }

    fn given_up(&self, factors: &[usize]) -> Vec<usize> {
        let wrong = |(index, factor): (usize, &usize)| self.solved.given_up(*factor).then_some(index);
        factors.iter().enumerate().filter_map(wrong).collect()
    }
}

/// The covariance of the pose `world_from_camera` of a camera that is known relative to an object.
pub(crate) fn in_world(navigated: &Navigated, places: &[ObjectPlacement]) -> (Transform<World, Camera>, Matrix6<f64>) {
    let place = &places[navigated.object];
    let here = navigated.object_pose.object_from_camera;
    let adjoint = here.inverse().adjoint();
    let survey = adjoint * place.covariance.matrix * adjoint.transpose();
    (place.world_from_object * here, navigated.object_pose.covariance.matrix + survey)
}
