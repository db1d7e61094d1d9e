//! The optimised graph.

use faer::{Mat, linalg::solvers::Solve, sparse::linalg::solvers::Llt};
use nalgebra::{Matrix6, SMatrix};
use seafix_geometry::{Camera, Covariance6, Transform, World};

use super::{FactorGraph, Pose, max};
use crate::{
    correlated_error::{CORRELATED, CorrelatedSensitivities},
    odometry_trajectory::RelativeMotion,
};

/// The optimised graph, with the covariances of its poses.
#[derive(Debug, Clone)]
pub struct GraphSolution {
    pub(super) graph: FactorGraph,
    pub(super) parts: Vec<usize>,
    pub(super) places: Vec<Option<usize>>,
    pub(super) factor: Option<Llt<usize, f64>>,
    pub(super) free: usize,
}

impl GraphSolution {
    /// The pose of a node.
    pub fn pose(&self, node: usize) -> &Pose {
        self.graph.pose(node)
    }

    /// The marginal covariance of a node's pose; zero for a fixed node.
    pub fn covariance(&self, node: usize) -> Covariance6<World, Camera> {
        Covariance6::new(self.joint(&[self.block(node)]).fixed_view::<6, 6>(0, 0).into_owned())
    }

    /// The motion between two nodes with its covariance, including the cross-covariance of both poses.
    ///
    /// Its error is ξ = β − Ad(B⁻¹ A) α. `None` if the nodes are not connected.
    pub fn relative(&self, from: usize, to: usize) -> Option<RelativeMotion> {
        let placed = |node: usize| self.places[node].is_none() || self.graph.placed(&self.parts, self.parts[node]);
        if self.parts[from] != self.parts[to] && !(placed(from) && placed(to)) {
            return None;
        }
        let motion = self.pose(from).inverse() * *self.pose(to);
        if from == to {
            return Some(RelativeMotion::new(motion, Covariance6::new(Matrix6::zeros())));
        }
        let joint = self.joint(&[self.block(from), self.block(to)]);
        let by = between(&motion);
        let joint = joint.fixed_view::<12, 12>(0, 0).into_owned();
        Some(RelativeMotion::new(motion, Covariance6::new(by * joint * by.transpose())))
    }

    /// The cross-covariance E\[ξ mᵀ\] of the motion between two nodes and the correlated errors m.
    pub(in crate::pose_graph) fn sensitivities(
        &self,
        from: usize,
        to: usize,
        correlated: usize,
    ) -> CorrelatedSensitivities {
        let first = 6 * self.free + CORRELATED * correlated;
        let joint = self.joint(&[self.block(from), self.block(to), (Some(first), CORRELATED)]);
        let motion = self.pose(from).inverse() * *self.pose(to);
        let in_units: CorrelatedSensitivities = between(&motion) * joint.fixed_view::<12, CORRELATED>(0, 12);
        self.graph.correlated[correlated].units.own(&in_units)
    }

    /// The first unknown of a movable node, and the number of its unknowns.
    fn block(&self, node: usize) -> (Option<usize>, usize) {
        (self.places[node].map(|place| 6 * place), 6)
    }

    /// The squared Mahalanobis norm rᵀ Σ⁻¹ r of a factor, χ² with six degrees of freedom.
    pub fn disagreement(&self, factor: usize) -> f64 {
        self.graph.disagreement(&self.graph.factors[factor])
    }

    /// Whether a doubtful factor was rejected: less than half of its weight remains.
    pub fn given_up(&self, factor: usize) -> bool {
        let s = self.graph.factors[factor].switch(self.disagreement(factor), max());
        s * s < 0.5
    }

    /// The joint covariance of several blocks of unknowns.
    fn joint(&self, blocks: &[(Option<usize>, usize)]) -> nalgebra::DMatrix<f64> {
        let size = blocks.iter().map(|(_, count)| count).sum();
        let mut all = nalgebra::DMatrix::zeros(size, size);
        let Some(factor) = &self.factor else { return all };
        // Pairs of (row of the result, unknown).
        let mut rows = Vec::with_capacity(size);
        let mut row = 0;
        for (first, count) in blocks {
            rows.extend((0..*count).filter_map(|k| Some((row + k, (*first)? + k))));
            row += count;
        }
        let mut units = Mat::<f64>::zeros(self.graph.unknowns(self.free), rows.len());
        rows.iter().enumerate().for_each(|(column, (_, unknown))| units[(*unknown, column)] = 1.0);
        let columns = factor.solve(&units);
        for (column, (b, _)) in rows.iter().enumerate() {
            rows.iter().for_each(|(a, unknown)| all[(*a, *b)] = columns[(*unknown, column)]);
        }
        all
    }
}

/// The derivative of ξ = β − Ad(B⁻¹ A) α by (α, β).
fn between(motion: &Transform<Camera, Camera>) -> SMatrix<f64, 6, 12> {
    let mut by = SMatrix::<f64, 6, 12>::zeros();
    by.fixed_view_mut::<6, 6>(0, 0).copy_from(&-motion.inverse().adjoint());
    by.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
    by
}
