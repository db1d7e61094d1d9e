//! The tree of coordinate frames.

use std::collections::HashMap;

use seafix_geometry::{Frame, Transform};

use super::messages::ChildPose;
use crate::dataset::tum::{Stamped, between};

/// The poses of a child in its parent in order of time; a static transform has one.
#[derive(Debug, Clone, Default)]
struct Edge {
    parent: String,
    is_static: bool,
    poses: Vec<Stamped<AnyFrame, AnyFrame>>,
}

/// The transforms of `/tf` and `/tf_static`.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tree {
    edges: HashMap<String, Edge>,
}

/// The maximum depth of the tree; a longer path to the root is a cycle.
const DEEPEST: usize = 64;

impl Tree {
    /// Adds a transform; a second parent of a frame replaces the first.
    pub(crate) fn add(&mut self, given: ChildPose, is_static: bool) {
        let name = |frame: &str| frame.trim_start_matches('/').to_owned();
        let edge = self.edges.entry(name(&given.child)).or_default();
        let parent = name(&given.header.frame);
        if edge.parent != parent || is_static {
            *edge = Edge { parent, is_static, poses: Vec::new() };
        }
        edge.poses.push((given.header.stamp_ns, given.pose.transform()));
    }

    /// Sorts all poses by time.
    pub(crate) fn sort(&mut self) {
        self.edges.values_mut().for_each(|edge| edge.poses.sort_by_key(|(stamp, _)| *stamp));
    }

    /// The pose of `from` in `to` at `stamp`, interpolated between two poses at most `max_gap` (ns) apart.
    pub(crate) fn look_up<A: Frame, B: Frame>(
        &self,
        to: &str,
        from: &str,
        stamp: u64,
        max_gap: u64,
    ) -> Option<Transform<A, B>> {
        let name = |frame: &str| frame.trim_start_matches('/').to_owned();
        let (to_root, from_root) = (self.to_root(name(to), stamp, max_gap), self.to_root(name(from), stamp, max_gap));
        let (from_up, to_up) = from_root
            .iter()
            .find_map(|(frame, up)| Some((up, &to_root.iter().find(|(other, _)| other == frame)?.1)))?;
        // The path leads from the child up to the first common frame and down again.
        let full = to_up.inverse() * *from_up;
        Some(full.relabel())
    }

    /// A frame and its ancestors as far as they are known at `stamp`, each with the first frame's pose in it.
    fn to_root(&self, frame: String, stamp: u64, max_gap: u64) -> Vec<(String, Transform<AnyFrame, AnyFrame>)> {
        let mut chain = vec![(frame, Transform::identity())];
        while let Some((here, up)) = chain.last().filter(|_| chain.len() < DEEPEST) {
            let Some(edge) = self.edges.get(here) else { break };
            let Some(pose) = edge.at(stamp, max_gap) else { break };
            let next = (edge.parent.clone(), pose * *up);
            chain.push(next);
        }
        chain
    }
}

/// A coordinate frame of the tree.
#[derive(Debug, Clone, Copy, PartialEq)]
struct AnyFrame;
impl Frame for AnyFrame {}

impl Edge {
    fn at(&self, stamp: u64, max_gap: u64) -> Option<Transform<AnyFrame, AnyFrame>> {
        if self.is_static { self.poses.last().map(|(_, pose)| *pose) } else { between(&self.poses, stamp, max_gap) }
    }
}
