//! Odometry factors of the pose graph whose errors are correlated over several edges.

use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

use super::graph::NoCovariance;
use crate::{
    correlated_error::{CORRELATED, CorrelatedCovariance, CorrelatedError, CorrelatedSensitivities},
    odometry_trajectory::RelativeMotion,
};

/// Dimension of a motion's error together with the correlated errors at its end.
const BOTH: usize = 6 + CORRELATED;

pub(super) type Square = SMatrix<f64, CORRELATED, CORRELATED>;
pub(super) type Numbers = SVector<f64, CORRELATED>;

/// The standard deviations that normalise the correlated errors; 0 for absent ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Units(Numbers);

impl Units {
    fn of(spread: &Square) -> Self {
        Self(spread.diagonal().map(f64::sqrt))
    }

    /// The cross-covariance E\[ξ mᵀ\] from its normalised form E\[ξ nᵀ\].
    pub(super) fn own(&self, sensitivities: &CorrelatedSensitivities) -> CorrelatedSensitivities {
        CorrelatedSensitivities::from_fn(|row, k| sensitivities[(row, k)] * self.0[k])
    }
}

/// The fraction of every variance that counts as additional independent noise.
///
/// A constant scale error would make the equations singular. Over a thousand edges this noise changes it by less than a
/// thousandth of its standard deviation.
const MIN: f64 = 1e-9;

/// The units of the correlated errors and their prior information in these units.
///
/// # Errors
/// [`NoCovariance`] if the covariance is not positive semidefinite.
pub(super) fn prior(spread: &CorrelatedCovariance) -> Result<(Units, Square), NoCovariance> {
    let spread = spread.matrix();
    let units = Units::of(&spread);
    let information = normal(&spread, &units).cholesky().ok_or(NoCovariance)?.inverse();
    Ok((units, information))
}

/// The matrix in normalised units; an absent error has variance one and no correlation.
fn normal(spread: &Square, units: &Units) -> Square {
    Square::from_fn(|i, j| match (units.0[i] * units.0[j], i == j) {
        (unit, _) if unit > 0.0 => spread[(i, j)] / unit + if i == j { MIN } else { 0.0 },
        (_, true) => 1.0,
        (_, false) => 0.0,
    })
}

/// The conditional distribution of a motion's error ξ and the final correlated errors n′.
///
/// Given the initial errors n it is (ξ, n′) = F n + w, with w of information Λ (from the Schur complement of the joint
/// covariance).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Drift {
    by: SMatrix<f64, BOTH, CORRELATED>,
    information: SMatrix<f64, BOTH, BOTH>,
}

/// The number of unknowns of a factor: both poses, n and n′.
pub(super) const SIDES: usize = 12 + 2 * CORRELATED;

impl Drift {
    /// The factor of a motion, and the units of the correlated errors at its end.
    ///
    /// # Errors
    /// [`NoCovariance`] if the correlated errors contradict the covariance of the motion.
    pub(super) fn of(motion: &RelativeMotion, correlated: &CorrelatedError) -> Result<(Self, Units), NoCovariance> {
        let (before, after) = (correlated.before.matrix(), correlated.after.matrix());
        let (from, to) = (Units::of(&before), Units::of(&after));
        let mut by = SMatrix::<f64, BOTH, CORRELATED>::zeros();
        by.fixed_view_mut::<6, CORRELATED>(0, 0).copy_from(&from.own(&correlated.by));
        let mut all = SMatrix::<f64, BOTH, BOTH>::zeros();
        all.fixed_view_mut::<6, 6>(0, 0).copy_from(&motion.covariance.matrix);
        all.fixed_view_mut::<CORRELATED, CORRELATED>(6, 6).copy_from(&normal(&after, &to));
        for k in (0..CORRELATED).filter(|k| to.0[*k] > 0.0) {
            by[(6 + k, k)] = correlated.keep[k] * from.0[k] / to.0[k];
            for row in 0..6 {
                let common = correlated.with[(row, k)] / to.0[k];
                (all[(row, 6 + k)], all[(6 + k, row)]) = (common, common);
            }
        }
        let mut rest = all - by * normal(&before, &from) * by.transpose();
        (0..BOTH).for_each(|k| rest[(k, k)] += 2.0 * MIN * all[(k, k)]);
        let information = rest.cholesky().ok_or(NoCovariance)?.inverse();
        Ok((Self { by, information }, to))
    }

    /// The residual (ξ, n′) − F n.
    fn residual(&self, r: &Vector6<f64>, before: &Numbers, after: &Numbers) -> SVector<f64, BOTH> {
        let mut all = -self.by * before;
        for (k, value) in r.iter().chain(after.iter()).enumerate() {
            all[k] += value;
        }
        all
    }

    /// The squared Mahalanobis norm of the residual.
    pub(super) fn disagreement(&self, r: &Vector6<f64>, before: &Numbers, after: &Numbers) -> f64 {
        let all = self.residual(r, before, after);
        all.dot(&(self.information * all))
    }

    /// The normal equations JᵀΛJ and JᵀΛr; `poses` are the derivatives of ξ by the two poses.
    pub(super) fn equations(
        &self,
        r: &Vector6<f64>,
        poses: [&Matrix6<f64>; 2],
        before: &Numbers,
        after: &Numbers,
    ) -> (SMatrix<f64, SIDES, SIDES>, SVector<f64, SIDES>) {
        let mut slope = SMatrix::<f64, BOTH, SIDES>::zeros();
        slope.fixed_view_mut::<6, 6>(0, 0).copy_from(poses[0]);
        slope.fixed_view_mut::<6, 6>(0, 6).copy_from(poses[1]);
        slope.fixed_view_mut::<BOTH, CORRELATED>(0, 12).copy_from(&-self.by);
        slope.fixed_view_mut::<CORRELATED, CORRELATED>(6, 12 + CORRELATED).copy_from(&Square::identity());
        let weighted = slope.transpose() * self.information;
        (weighted * slope, weighted * self.residual(r, before, after))
    }
}
