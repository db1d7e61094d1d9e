//! What a motion and the errors that last through it say of each other.

use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

use super::NoCovariance;
use crate::{
    CorrelatedError, RelativeMotion,
    correlated_error::{CORRELATED, CorrelatedCovariance, CorrelatedSensitivities},
};

/// Numbers of a motion's error and of what lasts at its end.
const BOTH: usize = 6 + CORRELATED;

pub(super) type Square = SMatrix<f64, CORRELATED, CORRELATED>;
pub(super) type Numbers = SVector<f64, CORRELATED>;

/// The standard deviations in which errors that last are counted; 0 for those that are not there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Units(Numbers);

impl Units {
    fn of(spread: &Square) -> Self {
        Self(spread.diagonal().map(f64::sqrt))
    }

    /// What shares C = E\[ξ nᵀ\] in these units are in their own.
    pub(super) fn own(&self, sensitivities: &CorrelatedSensitivities) -> CorrelatedSensitivities {
        CorrelatedSensitivities::from_fn(|row, k| sensitivities[(row, k)] * self.0[k])
    }
}

/// A share of so much of every variance is noise whatever is measured: a scale that never changes would make its equations
/// singular. Over a thousand legs it may wander by a thousandth of its standard deviation.
const MIN: f64 = 1e-9;

/// The spread of errors that last, in units of their own, and what they are known to before anything is measured.
///
/// # Errors
/// [`NoCovariance`].
pub(super) fn prior(spread: &CorrelatedCovariance) -> Result<(Units, Square), NoCovariance> {
    let spread = spread.matrix();
    let units = Units::of(&spread);
    let information = normal(&spread, &units).cholesky().ok_or(NoCovariance)?.inverse();
    Ok((units, information))
}

/// M in units: what is not there stands alone with variance one, and touches nothing.
fn normal(spread: &Square, units: &Units) -> Square {
    Square::from_fn(|i, j| match (units.0[i] * units.0[j], i == j) {
        (unit, _) if unit > 0.0 => spread[(i, j)] / unit + if i == j { MIN } else { 0.0 },
        (_, true) => 1.0,
        (_, false) => 0.0,
    })
}

/// A motion's error ξ and the errors n′ that last at its end, given those n at its beginning:
///
/// (ξ, n′) = F n + w, w with the information Λ.
///
/// It is what remains of their covariance once n is known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Drift {
    by: SMatrix<f64, BOTH, CORRELATED>,
    information: SMatrix<f64, BOTH, BOTH>,
}

/// A drift's residual and its derivatives by the pose where the motion begins, by that where it ends, by n and by n′.
pub(super) const SIDES: usize = 12 + 2 * CORRELATED;

impl Drift {
    /// Of a motion; the units of what lasts at its end.
    ///
    /// # Errors
    /// [`NoCovariance`].
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

    /// (ξ, n′) − F n.
    fn residual(&self, r: &Vector6<f64>, before: &Numbers, after: &Numbers) -> SVector<f64, BOTH> {
        let mut all = -self.by * before;
        for (k, value) in r.iter().chain(after.iter()).enumerate() {
            all[k] += value;
        }
        all
    }

    /// Its square in standard deviations.
    pub(super) fn disagreement(&self, r: &Vector6<f64>, before: &Numbers, after: &Numbers) -> f64 {
        let all = self.residual(r, before, after);
        all.dot(&(self.information * all))
    }

    /// JᵀΛJ and JᵀΛr of the four sides, ξ having these derivatives by the two poses.
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
