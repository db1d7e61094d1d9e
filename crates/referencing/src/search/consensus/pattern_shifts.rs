//! The shifts of an object within a repeated pattern, and the phase of the pattern.

use std::collections::{BTreeSet, VecDeque};

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::{
    edge_terms::EdgeTerms, gaussian::HALF_LN_2PI, joined::Joined, likelihood::Mode, local_maxima::Climb,
    motion::Motion, prior_terms::PriorTerms, repeated_pattern::Pattern, seeds::MARGIN,
};
use crate::{parts::Parts, problem::Problem};

/// Maximum number of shifts examined: any two decide that the pose is ambiguous, the rest is for the reader.
const MAX_SHIFTS: usize = 64;

impl Pattern {
    /// The poses of the object shifted within its pattern whose evidence is comparable with a mode's.
    ///
    /// A translation that maps the pattern onto itself moves the object's points onto other points of the pattern. Each
    /// shift is a hypothesis with the prior density of its own pose and the likelihood of its own seen and unseen
    /// points. The pruned search may miss shifts, since their triples are among the most numerous; here they are
    /// reached from the mode, step by step, as long as a neighbour is comparable.
    pub(in crate::search) fn shifts(
        &self,
        problem: &Problem<'_>,
        climb: &Climb<'_>,
        edges: Option<&EdgeTerms<'_>>,
        mode: &Mode,
    ) -> Vec<Mode> {
        let parts = (climb.terms, climb.prior_terms, climb.graph);
        let of = |mode: &Mode| self.continued(problem, parts, edges, mode, &self.beyond);
        let none = BTreeSet::new();
        let near = |start: &Motion| match edges {
            Some(edges) => Joined { climb, edges, taken: &none }.near(start, None, f64::NEG_INFINITY),
            None => climb.near(start),
        };
        let (first, half) = (of(mode), mode.members.len() / 2);
        let evidence = mode.ln_evidence.max(first.around);
        let comparable = |shifted: &Mode, by: &Vector3<f64>| {
            let other = of(shifted);
            shifted.ln_evidence.max(other.around) >= evidence - MARGIN
                || shifted.members.len() > half
                    && other.against(&first) >= -MARGIN
                    && self.goes_on_to(problem, parts, mode, by)
        };
        let mut found = Vec::new();
        let mut known: BTreeSet<[i32; 3]> = BTreeSet::from([[0; 3]]);
        let mut open = VecDeque::from([[0; 3]]);
        while let Some(from) = open.pop_front() {
            for (axis, step) in (0..self.basis.len()).flat_map(|axis| [(axis, 1), (axis, -1)]) {
                let mut to: [i32; 3] = from;
                to[axis] += step;
                if known.len() > MAX_SHIFTS || !known.insert(to) {
                    continue;
                }
                let by = self.basis.iter().zip(to).map(|(step, times)| step * f64::from(times)).sum::<Vector3<f64>>();
                let start = Motion { translation: mode.motion.apply(&by), ..mode.motion };
                let Some(shifted) = near(&start).filter(|shifted| comparable(shifted, &by)) else { continue };
                // A weak shift slides back to the place of a neighbour.
                if found.iter().chain([mode]).all(|other: &Mode| other.members != shifted.members) {
                    found.push(shifted);
                    open.push_back(to);
                }
            }
        }
        found
    }
}

/// ln of the prior probability that the object is one step away in its pattern, against its being here; zero without a
/// prior.
///
/// Σ p(T_s)/(p(T) + Σ p(T_s)) over the next shifts s, with the prior density p.
pub(super) fn ln_shifted(basis: &[Vector3<f64>], prior_terms: &PriorTerms, motion: &Motion) -> f64 {
    if prior_terms.known.is_none() {
        return 0.0;
    }
    let here = prior_terms.ln_density(motion);
    let there = |by: Vector3<f64>| {
        let shifted = Motion { translation: motion.apply(&by), ..*motion };
        libm::exp((prior_terms.ln_density(&shifted) - here).min(700.0))
    };
    let others: f64 = basis.iter().flat_map(|step| [*step, -step]).map(there).sum();
    libm::log((others / (1.0 + others)).max(f64::MIN_POSITIVE))
}

/// ln of the density of a pattern's phase, relative to that of the pose under the prior.
///
/// A pattern of m steps repeats in m directions. Its phase is uniform over a cell, the parallelepiped of its steps. The
/// prior's density of the model's centroid in the span of the steps is a Gaussian there; without a prior it is uniform
/// over the cloud's parts, of volume V, and counts as V^(−m/3).
pub(super) fn ln_phase(basis: &[Vector3<f64>], prior_terms: &PriorTerms, motion: &Motion) -> f64 {
    let m = basis.len();
    let steps = DMatrix::from_fn(3, m, |row, column| basis[column][row]);
    let gram = steps.transpose() * &steps;
    let ln_cell = 0.5 * libm::log(gram.determinant().max(f64::MIN_POSITIVE));
    let Some(known) = &prior_terms.known else {
        let ln_volume = prior_terms.parts.as_ref().map_or(0.0, Parts::ln_volume);
        return m as f64 / 3.0 * ln_volume - ln_cell;
    };
    let Some(covariance) = known.information.try_inverse() else { return -ln_cell };
    let eta = prior_terms.step_to(known, motion);
    // Orthonormal directions of the span in camera axes.
    let across = DMatrix::from_fn(3, m, |row, column| (known.motion.rotation * basis[column])[row]).qr().q();
    let of_centroid: Matrix3<f64> = covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let spread = across.transpose() * DMatrix::from_fn(3, 3, |i, k| of_centroid[(i, k)]) * &across;
    let off: DVector<f64> = across.transpose() * DVector::from_fn(3, |i, _| eta[3 + i]);
    let Some(chol) = spread.cholesky() else { return -ln_cell };
    let ln_det: f64 = 2.0 * chol.l_dirty().diagonal().iter().map(|&x| libm::log(x)).sum::<f64>();
    let ln_density = -(m as f64) * HALF_LN_2PI - 0.5 * ln_det - 0.5 * off.dot(&chol.solve(&off));
    -ln_cell - ln_density
}

#[cfg(test)]
mod tests;
