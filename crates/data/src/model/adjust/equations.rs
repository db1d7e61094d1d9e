//! The normal equations of an adjustment.

use faer::{
    Mat,
    sparse::{SparseColMat, Triplet},
};
use nalgebra::{Matrix3, Matrix3x6, Matrix4, Matrix4x3, Matrix4x6, Matrix6, Vector3, Vector4, Vector6};
use seafix_geometry::{Camera, Point, StereoPixels, StereoRig, Transform, World, right_jacobian_inverse, so3::skew};

use super::observation::{Motion, Observation};

/// The linearised residual of an observation: measured minus expected pixels, and its derivatives.
pub(super) struct Linearised {
    /// Measured minus expected (u left, v left, u right, v right) (px).
    pub(super) residual: Vector4<f64>,
    /// The derivative of the expected pixels by ξ of `world_from_camera · Exp(ξ)`.
    pub(super) by_pose: Matrix4x6<f64>,
    /// The derivative of the expected pixels by the point (px/m).
    pub(super) by_point: Matrix4x3<f64>,
}

/// The poses and points at which the equations are linearised; the first pose is fixed.
pub(super) struct State<'a> {
    pub(super) rig: &'a StereoRig,
    pub(super) poses: &'a [Transform<World, Camera>],
    pub(super) points: &'a [Point<World>],
}

impl State<'_> {
    /// The expected pixels of an observation; `None` if a camera cannot see the point.
    pub(super) fn expected(&self, observation: &Observation) -> Option<StereoPixels> {
        self.rig.project(&(self.poses[observation.view].inverse() * self.points[observation.point]))
    }

    pub(super) fn linearise(&self, observation: &Observation) -> Option<Linearised> {
        let camera_from_world = self.poses[observation.view].inverse();
        let at = camera_from_world * self.points[observation.point];
        let (expected, by_camera) = self.rig.project_with_jacobian(&at)?;
        // Exp(−ξ) p ≈ p + [p]× φ − ρ.
        let mut of_pose = Matrix3x6::zeros();
        of_pose.fixed_columns_mut::<3>(0).copy_from(&skew(&at.coords));
        of_pose.fixed_columns_mut::<3>(3).copy_from(&-Matrix3::identity());
        Some(Linearised {
            residual: observation.pixels.at.coordinates() - expected.coordinates(),
            by_pose: by_camera * of_pose,
            by_point: by_camera * camera_from_world.rotation_matrix(),
        })
    }

    /// The residual log(Z⁻¹ A⁻¹ B) of a motion Z between the poses A and B.
    pub(super) fn motion_residual(&self, motion: &Motion) -> Vector6<f64> {
        let moved = self.poses[motion.from].inverse() * self.poses[motion.to];
        motion.motion.motion.error_to(&moved)
    }

    /// The first unknown of a pose; `None` for the fixed one.
    pub(super) fn pose_unknown(&self, pose: usize) -> Option<usize> {
        pose.checked_sub(1).map(|pose| 6 * pose)
    }

    /// The first unknown of a point.
    pub(super) fn point_unknown(&self, point: usize) -> usize {
        6 * (self.poses.len() - 1) + 3 * point
    }

    /// The number of unknowns.
    pub(super) fn unknowns(&self) -> usize {
        self.point_unknown(self.points.len())
    }
}

/// The normal equations: the lower triangle of the matrix, and the right-hand side.
pub(super) struct Equations {
    pub(super) normal: SparseColMat<usize, f64>,
    pub(super) pull: Mat<f64>,
}

/// Builds the equations with the information of each observation and motion; `damping` enlarges the diagonal.
///
/// An observation of zero information does not enter. `None` if a point that enters is not in view.
pub(super) fn equations(
    state: &State<'_>,
    observations: &[(Observation, Matrix4<f64>)],
    motions: &[(Motion, Matrix6<f64>)],
    damping: f64,
) -> Option<Equations> {
    let mut pull = Mat::zeros(state.unknowns(), 1);
    let mut of_poses = vec![Matrix6::zeros(); state.poses.len()];
    let mut of_points = vec![Matrix3::zeros(); state.points.len()];
    let mut entries = Vec::new();
    for (observation, information) in observations.iter().filter(|(_, information)| *information != Matrix4::zeros()) {
        let Linearised { residual, by_pose, by_point } = state.linearise(observation)?;
        let (weighted_pose, weighted_point) = (information * by_pose, information * by_point);
        let row = state.point_unknown(observation.point);
        of_points[observation.point] += by_point.transpose() * weighted_point;
        let gradient: Vector3<f64> = weighted_point.transpose() * residual;
        (0..3).for_each(|k| pull[(row + k, 0)] += gradient[k]);
        let Some(column) = state.pose_unknown(observation.view) else { continue };
        of_poses[observation.view] += by_pose.transpose() * weighted_pose;
        let gradient: Vector6<f64> = weighted_pose.transpose() * residual;
        (0..6).for_each(|k| pull[(column + k, 0)] += gradient[k]);
        let across: Matrix3x6<f64> = by_point.transpose() * weighted_pose;
        entries.extend((0..18).map(|k| Triplet::new(row + k / 6, column + k % 6, across[(k / 6, k % 6)])));
    }
    for (motion, information) in motions {
        let residual = state.motion_residual(motion);
        let slope = right_jacobian_inverse(&residual);
        // With A Exp(α) and B Exp(β), the residual of Z⁻¹ A⁻¹ B is r + J_r(r)⁻¹ (β − Ad(B⁻¹ A) α).
        let back = state.poses[motion.to].inverse() * state.poses[motion.from];
        let sides = [(motion.from, -slope * back.adjoint()), (motion.to, slope)];
        for (pose, by) in &sides {
            let Some(column) = state.pose_unknown(*pose) else { continue };
            of_poses[*pose] += by.transpose() * information * by;
            let gradient = by.transpose() * (information * residual);
            (0..6).for_each(|k| pull[(column + k, 0)] -= gradient[k]);
        }
        let [(a, by_a), (b, by_b)] = &sides;
        if let (Some(first), Some(second)) = (state.pose_unknown(*a), state.pose_unknown(*b)) {
            let across = by_b.transpose() * information * by_a;
            let (row, column, across) =
                if second > first { (second, first, across) } else { (first, second, across.transpose()) };
            entries.extend((0..36).map(|k| Triplet::new(row + k / 6, column + k % 6, across[(k / 6, k % 6)])));
        }
    }
    for (pose, block) in of_poses.iter().enumerate() {
        let Some(first) = state.pose_unknown(pose) else { continue };
        let lower = (0..6).flat_map(|j| (j..6).map(move |i| (i, j)));
        entries.extend(lower.map(|(i, j)| Triplet::new(first + i, first + j, damped(block[(i, j)], i == j, damping))));
    }
    for (point, block) in of_points.iter().enumerate() {
        let first = state.point_unknown(point);
        let lower = (0..3).flat_map(|j| (j..3).map(move |i| (i, j)));
        entries.extend(lower.map(|(i, j)| Triplet::new(first + i, first + j, damped(block[(i, j)], i == j, damping))));
    }
    let unknowns = state.unknowns();
    Some(Equations { normal: SparseColMat::try_new_from_triplets(unknowns, unknowns, &entries).ok()?, pull })
}

/// The entry of a damped matrix (Marquardt's scaling of the diagonal).
fn damped(entry: f64, diagonal: bool, damping: f64) -> f64 {
    if diagonal { entry * (1.0 + damping) } else { entry }
}
