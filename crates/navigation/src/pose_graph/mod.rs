//! The pose graph: key frames, odometry, fixes and loops, for navigation between objects.

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

use crate::{
    chain::ObjectPose,
    navigated::{Navigated, ObjectPlacement},
    odometry_trajectory::RelativeMotion,
};

pub use footprint::Footprint;
pub use graph::{FactorGraph, GraphSolution, NoCovariance};
pub use keyframe::{KeyFrame, StereoFeatures};
pub use recognition::{LoopCandidate, NotRecognized, PlaceRecognizer, Recognition, Recognized};
pub use traverse::{Closure, PoseEstimate, PoseGraphSettings, Relocalization, Traverse};

/// A pose node: the camera's pose at one instant of a dive.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseNode {
    /// Time (ns).
    pub stamp_ns: u64,
    /// The pose, as estimated so far.
    pub world_from_camera: Transform<World, Camera>,
    /// Standard deviation of the position over the three axes together (m).
    pub sigma: f64,
    /// The key frame at this node, if one was added.
    pub keyframe: Option<KeyFrame>,
}

/// The motion between two pose nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryEdge {
    /// Index of the first node.
    pub from: usize,
    /// Index of the second node.
    pub to: usize,
    /// The motion `from_from_to`.
    ///
    /// Consecutive edges share [correlated errors](crate::CorrelatedError): the scale of the Doppler log, the bias of
    /// the gyro.
    pub motion: RelativeMotion,
}

/// A fix of an object at a pose node.
#[derive(Debug, Clone, PartialEq)]
pub struct FixEdge {
    /// Index of the node.
    pub pose_node: usize,
    /// The camera's pose relative to the object.
    pub navigated: Navigated,
}

/// A pose of a node from another sensor: acoustics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorPose {
    /// Index of the node.
    pub pose_node: usize,
    /// The pose.
    pub world_from_camera: Transform<World, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<World, Camera>,
}

/// A pose graph: pose nodes, the measurements between them, and the objects of the site.
///
/// A later run may extend the graph of an earlier one: objects and key frames that both have seen connect them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PoseGraph {
    /// Names and placements of the objects.
    pub objects: Vec<(String, ObjectPlacement)>,
    /// The pose nodes, in the order of their addition.
    pub pose_nodes: Vec<PoseNode>,
    /// The motions that odometry measured between successive nodes.
    pub odometry_edges: Vec<OdometryEdge>,
    /// The fixes of objects.
    pub fixes: Vec<FixEdge>,
    /// The prior poses of other sensors.
    pub prior_poses: Vec<PriorPose>,
    /// Loop closures: the motion from a key frame's node (`from`) to the node that recognised it.
    pub loops: Vec<OdometryEdge>,
}

/// An optimised pose graph.
#[derive(Debug, Clone)]
pub struct Closed {
    solved: GraphSolution,
    objects: usize,
    /// The factor of each loop.
    loops: Vec<usize>,
    fixes: Vec<usize>,
    /// For each pose node, the node of its correlated errors.
    correlated: BTreeMap<usize, usize>,
}

impl PoseGraph {
    /// A pose graph without pose nodes, at a site with these objects.
    pub fn new(objects: Vec<(String, ObjectPlacement)>) -> Self {
        Self { objects, ..Self::default() }
    }

    /// Adds a pose node; returns its index.
    pub fn add_node(&mut self, pose_node: PoseNode) -> usize {
        self.pose_nodes.push(pose_node);
        self.pose_nodes.len() - 1
    }

    /// The maximum-likelihood poses of all nodes and objects; inconsistent fixes and loops are rejected.
    ///
    /// An object without a survey covariance is fixed. Correlated errors of the odometry are estimated along with the
    /// poses, over a chain of consecutive edges; each chain has errors of its own.
    ///
    /// `None` if the equations have no solution.
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

    /// Optimises the graph and moves every pose node to its estimate.
    ///
    /// `None` if the equations have no solution; the graph is then unchanged.
    pub fn close(&mut self) -> Option<Closed> {
        let closed = self.solve()?;
        for (index, pose_node) in self.pose_nodes.iter_mut().enumerate() {
            pose_node.world_from_camera = *closed.pose_node(index);
            pose_node.sigma = closed.covariance(index).position_rms();
        }
        Some(closed)
    }

    /// The nodes with a key frame: index, node, key frame.
    pub fn keyframes(&self) -> impl Iterator<Item = (usize, &PoseNode, &KeyFrame)> {
        self.pose_nodes
            .iter()
            .enumerate()
            .filter_map(|(index, pose_node)| Some((index, pose_node, pose_node.keyframe.as_ref()?)))
    }
}

impl Closed {
    /// The pose of a node.
    pub fn pose_node(&self, pose_node: usize) -> &Transform<World, Camera> {
        self.solved.pose(self.objects + pose_node)
    }

    /// Its covariance.
    pub fn covariance(&self, pose_node: usize) -> Covariance6<World, Camera> {
        self.solved.covariance(self.objects + pose_node)
    }

    /// The motion between two nodes, including the cross-covariance of both poses.
    pub fn relative(&self, from: usize, to: usize) -> Option<RelativeMotion> {
        self.solved.relative(self.objects + from, self.objects + to)
    }

    /// The pose of a node relative to an object; `None` if nothing connects them.
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

    /// The indices of the rejected loops.
    pub fn wrong_loops(&self) -> Vec<usize> {
        self.given_up(&self.loops)
    }

    /// The indices of the rejected fixes.
    pub fn wrong_fixes(&self) -> Vec<usize> {
        self.given_up(&self.fixes)
    }

    fn given_up(&self, factors: &[usize]) -> Vec<usize> {
        let wrong = |(index, factor): (usize, &usize)| self.solved.given_up(*factor).then_some(index);
        factors.iter().enumerate().filter_map(wrong).collect()
    }
}

/// The pose `world_from_camera` and its covariance, of a camera with a known pose relative to an object.
pub(crate) fn in_world(navigated: &Navigated, places: &[ObjectPlacement]) -> (Transform<World, Camera>, Matrix6<f64>) {
    let place = &places[navigated.object];
    let here = navigated.object_pose.object_from_camera;
    let adjoint = here.inverse().adjoint();
    let survey = adjoint * place.covariance.matrix * adjoint.transpose();
    (place.world_from_object * here, navigated.object_pose.covariance.matrix + survey)
}
