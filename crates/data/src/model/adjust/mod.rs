//! Bundle adjustment of stereo pairs: all poses and all points of an object together.
//!
//! An observation has four residuals, the pixels of a point in both images, with their 4×4 covariance. An odometry adds
//! the motion between two pairs. The first pose is fixed; the object's frame is chosen afterwards ([`super::frame`]).
//!
//! Source: Triggs, McLauchlan, Hartley and Fitzgibbon, *Bundle adjustment — a modern synthesis*, 2000.

mod calibration;
mod descent;
mod equations;
mod excess;
mod observation;
mod switch;

use faer::{Mat, Side, linalg::solvers::Solve};
use nalgebra::{DMatrix, Matrix3, Matrix4, Matrix6, Vector4};
use seafix_geometry::{Camera, Point, StereoRig, Transform, World};

use self::{
    descent::descend,
    equations::{Linearised, State, equations},
    switch::{FINAL, graduated},
};

pub use calibration::CalibrationSigma;
pub(super) use excess::Excess;
pub(super) use observation::{Motion, Observation};

/// The unknowns and the measurements of an adjustment.
#[derive(Debug, Clone)]
pub(super) struct Adjustment<'a> {
    /// The rig.
    pub(super) rig: &'a StereoRig,
    /// The poses of the pairs; the first is fixed.
    pub(super) poses: Vec<Transform<World, Camera>>,
    /// The points.
    pub(super) points: Vec<Point<World>>,
    /// The observations, at most one of a point in a pair.
    pub(super) observations: Vec<Observation>,
    /// The motions by odometry.
    pub(super) motions: Vec<Motion>,
}

/// An adjustment without a solution: the measurements leave a motion or a point undetermined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Undetermined;

impl Adjustment<'_> {
    /// Moves poses and points to the maximum-likelihood solution; `excess` is added to every observation's covariance.
    ///
    /// With `robust` every observation has a switch that takes the weight from one that contradicts all others.
    ///
    /// # Errors
    /// [`Undetermined`] if the normal equations are singular.
    pub(super) fn solve(&mut self, excess: &Excess, robust: bool) -> Result<(), Undetermined> {
        let motions = self.informed_motions()?;
        let observations = self.informed(excess)?;
        if robust {
            let worst = self.disagreements(excess)?.into_iter().fold(0.0, f64::max);
            for threshold in graduated(worst) {
                descend(self, &observations, &motions, threshold)?;
            }
            return descend(self, &observations, &motions, FINAL);
        }
        descend(self, &observations, &motions, f64::INFINITY)
    }

    fn state(&self) -> State<'_> {
        State { rig: self.rig, poses: &self.poses, points: &self.points }
    }

    /// The observations with their information matrices.
    fn informed(&self, excess: &Excess) -> Result<Vec<(Observation, Matrix4<f64>)>, Undetermined> {
        let informed = |observation: &Observation| {
            let covariance = excess.added_to(&observation.pixels.covariance);
            Ok((*observation, covariance.cholesky().ok_or(Undetermined)?.inverse()))
        };
        self.observations.iter().map(informed).collect()
    }

    fn informed_motions(&self) -> Result<Vec<(Motion, Matrix6<f64>)>, Undetermined> {
        let informed =
            |motion: &Motion| Ok((*motion, motion.motion.covariance.matrix.cholesky().ok_or(Undetermined)?.inverse()));
        self.motions.iter().map(informed).collect()
    }

    /// Measured minus expected pixels of each observation; `None` where a camera cannot see the point.
    pub(super) fn residuals(&self) -> Vec<Option<Vector4<f64>>> {
        let state = self.state();
        let residual = |observation: &Observation| {
            Some(observation.pixels.at.coordinates() - state.expected(observation)?.coordinates())
        };
        self.observations.iter().map(residual).collect()
    }

    /// The squared Mahalanobis norm of each observation's residual, infinite out of view.
    ///
    /// # Errors
    /// [`Undetermined`] for a covariance that is not positive definite.
    pub(super) fn disagreements(&self, excess: &Excess) -> Result<Vec<f64>, Undetermined> {
        let residuals = self.residuals();
        let informed = self.informed(excess)?;
        let norm = |((_, information), residual): (&(Observation, Matrix4<f64>), &Option<Vector4<f64>>)| {
            residual.map_or(f64::INFINITY, |r| r.dot(&(information * r)))
        };
        Ok(informed.iter().zip(&residuals).map(norm).collect())
    }

    /// The sum of the squared Mahalanobis norms of all motions.
    pub(super) fn disagreement_of_motions(&self) -> Result<f64, Undetermined> {
        let state = self.state();
        let norm = |(motion, information): &(Motion, Matrix6<f64>)| {
            let r = state.motion_residual(motion);
            r.dot(&(information * r))
        };
        Ok(self.informed_motions()?.iter().map(norm).sum())
    }

    /// The number of measurements minus the number of unknowns.
    pub(super) fn dof(&self) -> usize {
        (4 * self.observations.len() + 6 * self.motions.len()).saturating_sub(self.state().unknowns())
    }

    /// The information of each point (m⁻²) with all poses as exact; the observations without it are left out.
    pub(super) fn information_of_points(&self, excess: &Excess) -> Vec<Matrix3<f64>> {
        let state = self.state();
        let mut all = vec![Matrix3::zeros(); self.points.len()];
        for (observation, information) in self.informed(excess).unwrap_or_default() {
            if let Some(Linearised { by_point, .. }) = state.linearise(&observation) {
                all[observation.point] += by_point.transpose() * information * by_point;
            }
        }
        all
    }

    /// The covariance of the points at the solution, with the first pose as exact.
    ///
    /// # Errors
    /// [`Undetermined`] if the normal equations are singular.
    pub(super) fn spread(&self, excess: &Excess, calibration: &CalibrationSigma) -> Result<PointSpread, Undetermined> {
        let (observations, motions) = (self.informed(excess)?, self.informed_motions()?);
        let state = self.state();
        let normal = equations(&state, &observations, &motions, 0.0).ok_or(Undetermined)?.normal;
        let factor = normal.sp_cholesky(Side::Lower).map_err(|_| Undetermined)?;
        let (first, count) = (state.point_unknown(0), 3 * self.points.len());
        let parameters = calibration.parameters(self.rig);
        let mut given = Mat::zeros(state.unknowns(), count + parameters.len());
        (0..count).for_each(|k| given[(first + k, k)] = 1.0);
        for (observation, information) in &observations {
            let at = self.poses[observation.view].inverse() * self.points[observation.point];
            let Linearised { by_pose, by_point, .. } = state.linearise(observation).ok_or(Undetermined)?;
            for (column, parameter) in parameters.iter().enumerate() {
                let weighted = information * parameter.shift(self.rig, &at).ok_or(Undetermined)?;
                let row = state.point_unknown(observation.point);
                let gradient = by_point.transpose() * weighted;
                (0..3).for_each(|k| given[(row + k, count + column)] += gradient[k]);
                let Some(row) = state.pose_unknown(observation.view) else { continue };
                let gradient = by_pose.transpose() * weighted;
                (0..6).for_each(|k| given[(row + k, count + column)] += gradient[k]);
            }
        }
        let solved = factor.solve(&given);
        let block = |columns: std::ops::Range<usize>| {
            DMatrix::from_fn(count, columns.len(), |i, j| solved[(first + i, columns.start + j)])
        };
        let noise = block(0..count);
        let spread = PointSpread {
            noise: (&noise + noise.transpose()) * 0.5,
            calibration: block(count..count + parameters.len()),
        };
        let valid = (0..count).all(|k| spread.noise[(k, k)] > 0.0 && spread.noise[(k, k)].is_finite());
        if valid { Ok(spread) } else { Err(Undetermined) }
    }
}

/// The uncertainty of all points: 3n coordinates in the order of the points.
#[derive(Debug, Clone)]
pub(super) struct PointSpread {
    /// The covariance from the noise of the pixels and of the odometry (m²).
    pub(super) noise: DMatrix<f64>,
    /// The displacement by one standard deviation of each calibration parameter (m), one column each.
    pub(super) calibration: DMatrix<f64>,
}

impl PointSpread {
    /// The complete covariance (m²).
    pub(super) fn total(&self) -> DMatrix<f64> {
        &self.noise + &self.calibration * self.calibration.transpose()
    }
}

#[cfg(test)]
pub(super) mod tests;
