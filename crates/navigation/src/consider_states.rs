//! Errors that fixes have in common.

use std::collections::BTreeMap;

use nalgebra::{Matrix6, SMatrix};

/// What something errs by for each standard deviation of three numbers: 6×3, a column each.
pub type Sensitivity = SMatrix<f64, 6, 3>;

/// Three numbers that err once and are met again by every fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Source {
    /// The place of a model's point: the object, and which of its points.
    Point(usize, usize),
    /// One half of the six numbers by which the survey errs in placing an object.
    Survey(usize, Half),
}

/// A survey errs by six numbers, its columns 0 to 2 and 3 to 5.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Half {
    First,
    Second,
}

/// What a pose's error has in common with the errors of models and surveys.
///
/// A fix errs by what is drawn anew with every image, its pixels, and by what the model has wrong, which is the same in
/// every fix of that object: ξ_fix = w + Σ H_j e_j, the errors e_j of the model's points scaled to unit covariance. A pose that
/// passes from object to object takes up the errors of two surveys in the same way. These errors are *considered*: they
/// are not estimated, but a pose of error ξ keeps C_j = E\[ξ e_jᵀ\] beside its covariance, of a fix C_j = H_j. Two poses then
/// have E\[ξ_a ξ_bᵀ\] = Σ C_aj C_bjᵀ in common where one of them is a fix, and the gain knows it.
///
/// Source: Schmidt, *Application of state-space methods to navigation problems*, 1966.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ConsiderStates(BTreeMap<Source, Sensitivity>);

impl ConsiderStates {
    /// What a fix owes to the model of `object`: for each of its points that the fix rests on, by its place in the model, H.
    pub fn of_model(object: usize, points: impl IntoIterator<Item = (usize, Sensitivity)>) -> Self {
        Self(points.into_iter().map(|(point, sensitivity)| (Source::Point(object, point), sensitivity)).collect())
    }

    /// What it owes to the survey of `object`, `lever` times the survey's error of this covariance.
    pub(crate) fn of_survey(object: usize, lever: &Matrix6<f64>, covariance: &Matrix6<f64>) -> Self {
        let all = lever * root(covariance);
        let half = |first: usize| all.fixed_columns::<3>(first).into_owned();
        Self(BTreeMap::from([
            (Source::Survey(object, Half::First), half(0)),
            (Source::Survey(object, Half::Second), half(3)),
        ]))
    }

    /// That of A ξ.
    #[must_use]
    pub(crate) fn carried(&self, a: &Matrix6<f64>) -> Self {
        Self(self.0.iter().map(|(source, sensitivity)| (*source, a * sensitivity)).collect())
    }

    /// That of the sum of two errors.
    #[must_use]
    pub(crate) fn plus(mut self, other: &Self) -> Self {
        for (source, sensitivity) in &other.0 {
            *self.0.entry(*source).or_insert_with(Sensitivity::zeros) += sensitivity;
        }
        self
    }

    /// Σ C_a C_bᵀ over what both have.
    pub(crate) fn common(&self, other: &Self) -> Matrix6<f64> {
        let both = self.0.iter().filter_map(|(source, a)| Some((a, other.0.get(source)?)));
        both.fold(Matrix6::zeros(), |sum, (a, b)| sum + a * b.transpose())
    }
}

/// The R with R Rᵀ = Σ, symmetric; of nought nought.
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
