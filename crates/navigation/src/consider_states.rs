//! Errors that several fixes share: Schmidt–Kalman consider states.

use std::collections::BTreeMap;

use nalgebra::{Matrix6, SMatrix};

/// The derivative of a pose error by three errors of unit variance: 6×3, one column for each error.
pub type Sensitivity = SMatrix<f64, 6, 3>;

/// The source of three constant errors, which every fix from the same source repeats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Source {
    /// The position of a model point: index of the object, index of the point.
    Point(usize, usize),
    /// One half of the six errors of an object's surveyed placement.
    Survey(usize, Half),
}

/// The half of a survey's six errors: components 0 to 2, or 3 to 5.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Half {
    First,
    Second,
}

/// The sensitivity of a pose error to the errors of models and surveys (Schmidt–Kalman).
///
/// The error of a fix has two parts: pixel noise w, independent for each image, and the errors e_j of the model's
/// points, the same in every fix of that object: ξ_fix = w + Σ H_j e_j, with e_j scaled to unit covariance. A pose that
/// is transferred from one object to another acquires the errors of two surveys in the same manner. The errors e_j are
/// *considered*: they are not estimated, but each pose keeps its cross-covariances C_j = E\[ξ e_jᵀ\] beside its
/// covariance; for a fix, C_j = H_j. Two poses then have the cross-covariance E\[ξ_a ξ_bᵀ\] = Σ C_aj C_bjᵀ, if one of
/// them is a fix, and the gain of the fusion accounts for it.
///
/// Source: Schmidt, *Application of state-space methods to navigation problems*, 1966.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ConsiderStates(BTreeMap<Source, Sensitivity>);

impl ConsiderStates {
    /// The consider states of a fix: for each model point used, its index in the model of `object` and its sensitivity
    /// H.
    pub fn of_model(object: usize, points: impl IntoIterator<Item = (usize, Sensitivity)>) -> Self {
        Self(points.into_iter().map(|(point, sensitivity)| (Source::Point(object, point), sensitivity)).collect())
    }

    /// The consider states of the survey of `object`: `lever` times an error with the covariance of the survey.
    pub(crate) fn of_survey(object: usize, lever: &Matrix6<f64>, covariance: &Matrix6<f64>) -> Self {
        let all = lever * root(covariance);
        let half = |first: usize| all.fixed_columns::<3>(first).into_owned();
        Self(BTreeMap::from([
            (Source::Survey(object, Half::First), half(0)),
            (Source::Survey(object, Half::Second), half(3)),
        ]))
    }

    /// The consider states of the error A ξ.
    #[must_use]
    pub(crate) fn carried(&self, a: &Matrix6<f64>) -> Self {
        Self(self.0.iter().map(|(source, sensitivity)| (*source, a * sensitivity)).collect())
    }

    /// The consider states of the sum of two errors.
    #[must_use]
    pub(crate) fn plus(mut self, other: &Self) -> Self {
        for (source, sensitivity) in &other.0 {
            *self.0.entry(*source).or_insert_with(Sensitivity::zeros) += sensitivity;
        }
        self
    }

    /// The cross-covariance Σ C_a C_bᵀ over the sources that both poses share.
    pub(crate) fn common(&self, other: &Self) -> Matrix6<f64> {
        let both = self.0.iter().filter_map(|(source, a)| Some((a, other.0.get(source)?)));
        both.fold(Matrix6::zeros(), |sum, (a, b)| sum + a * b.transpose())
    }
}

/// A square root R of a positive semidefinite covariance: R Rᵀ = Σ.
fn root(covariance: &Matrix6<f64>) -> Matrix6<f64> {
    if let Some(factor) = covariance.cholesky() {
        return factor.l();
    }
    let eigen = covariance.symmetric_eigen();
    let size = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix6::from_diagonal(&size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_survey_of_any_rank_is_rooted() {
        let full = Matrix6::from_fn(|i, j| if i == j { 2.0 } else { 0.1 });
        let mut flat = full;
        flat.row_mut(2).fill(0.0);
        flat.column_mut(2).fill(0.0);
        for covariance in [full, flat, Matrix6::zeros()] {
            let one = ConsiderStates::of_survey(0, &Matrix6::identity(), &covariance);
            assert!((one.common(&one) - covariance).amax() < 1e-12);
        }
    }

    #[test]
    fn what_two_objects_err_by_is_not_common() {
        let a = ConsiderStates::of_model(0, [(0, Sensitivity::identity())]);
        let b = ConsiderStates::of_model(1, [(0, Sensitivity::identity())]);
        assert_eq!(a.common(&b), Matrix6::zeros());
        assert_eq!(a.clone().plus(&b).common(&b), b.common(&b));
    }
}
