//! Influential observations: the pairs on which a pose depends, and the probability that they are wrong matches.
//!
//! Case deletion (Cook, *Detection of influential observation in linear regression*, 1977).

use nalgebra::Vector3;

use super::{
    clutter_density::ClutterDensity,
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms},
    prior_terms::{PriorTerms, spread},
};
use crate::{
    problem::{Correspondence, Problem},
    search::limits::NEEDED,
};

/// Maximum number of model points that stand for the object in the errors of a pose.
const MAX_ANCHORS: usize = 64;
/// Maximum number of points of a pose of which two are left out at once, for the time it takes: O(k³).
const MAX_TWICE: usize = 20;

/// One or two pairs of the best pose, and the pose without them (case deletion).
#[derive(Debug, Clone, PartialEq)]
pub struct InfluentialPairs {
    /// The pairs, one or two.
    pub pairs: Vec<Correspondence>,
    /// ln of the odds that they are clutter and not the object's, if the others are the object's.
    ///
    /// +∞ for a single pair without which the others determine no pose.
    pub ln_odds: f64,
    /// The distance (m, RMS over the model points) of the pose from the pose without them.
    pub shift: f64,
    /// The standard deviation (m, RMS over the model points) of the pose without them; infinite if the others determine
    /// none.
    pub sigma: f64,
}

impl InfluentialPairs {
    /// The probability that the pose is off by more than `limit` (m) if the pairs are wrong matches.
    ///
    /// The error of the pose is the shift plus that of the pose without them, at worst along one direction:
    /// P = erfc((L − d)/(√2 σ)).
    pub(crate) fn beyond(&self, limit: f64) -> f64 {
        let room = limit - self.shift;
        if room > 0.0 { libm::erfc(room / (std::f64::consts::SQRT_2 * self.sigma)) } else { 1.0 }
    }

    /// The error (m, RMS over the model points) of the pose if the pairs are wrong matches.
    pub(crate) fn error(&self) -> f64 {
        self.shift.hypot(self.sigma)
    }
}

/// The probability that wrong matches put the pose off by more than `limit` (m), if all others are the object's, and the
/// pairs that contribute most to it.
///
/// P = Σ_S O_S P_S / (1 + Σ_S O_S), with the odds O_S of each one or two pairs S.
pub(crate) fn misled(cases: &[InfluentialPairs], limit: f64) -> (f64, Option<&InfluentialPairs>) {
    if let Some(indispensable) = cases.iter().find(|case| case.ln_odds == f64::INFINITY) {
        return (1.0, Some(indispensable));
    }
    let max = cases.iter().map(|case| case.ln_odds).fold(0.0, f64::max);
    let odds = |case: &InfluentialPairs| libm::exp(case.ln_odds - max);
    let all = libm::exp(-max) + cases.iter().map(odds).sum::<f64>();
    let of = |case: &InfluentialPairs| odds(case) * case.beyond(limit);
    let worst = cases.iter().max_by(|a, b| of(a).total_cmp(&of(b)));
    (cases.iter().map(of).sum::<f64>() / all, worst)
}

/// The influential pairs of a mode of four points or more: each single pair, and each two of a mode of 5 to
/// [`MAX_TWICE`] points.
///
/// Some pairs S are the object's, or clutter near the places that the others predict. The odds of clutter are
///
/// O_S = Λ′(V \\ S) B(k − |S|) e^x / (Λ′(V) B(k)).
///
/// Λ′ is the evidence Λ of [`RigidConsensus`](crate::RigidConsensus) without its factor B, the probability of the
/// number of points. x is the excess density of clutter about the points; zero without `clutter_density`. ln O_S is +∞ for
/// a single pair without which the others determine no pose. Both sets have their own pose and posterior volume: the
/// worse the others determine the place of a point, the more clutter may lie there.
pub(in crate::search) fn influential_pairs(
    problem: &Problem<'_>,
    parts: (&PairTerms, &PriorTerms, &ConsistencyGraph),
    clutter_density: Option<&mut ClutterDensity>,
    mode: &Mode,
) -> Vec<InfluentialPairs> {
    let (terms, prior_terms, graph) = parts;
    let all_anchors = problem.anchors();
    let anchors: Vec<Vector3<f64>> = all_anchors
        .iter()
        .step_by(all_anchors.len().div_ceil(MAX_ANCHORS).max(1))
        .map(|anchor| anchor.at.coords)
        .collect();
    let refit = |members: &[usize]| {
        let (ln_evidence, motion, factor) = mode.refitted(terms, prior_terms, members)?;
        Some((ln_evidence + terms.ln_fraction[members.len()], motion, factor.inverse()))
    };
    let Some((all, pose, _)) = refit(&mode.members) else { return Vec::new() };
    let even = || vec![0.0; mode.members.len()];
    let excess = clutter_density.map_or_else(even, |density| density.excesses(problem, parts, mode, &[]));
    let deleted = |out: &[usize]| {
        let kept = |at: &usize| !out.contains(at);
        let others: Vec<usize> = (0..mode.members.len()).filter(kept).map(|at| mode.members[at]).collect();
        let pairs = out.iter().map(|&at| graph.vertices[mode.members[at]]).collect();
        let Some((without, motion, covariance)) = refit(&others) else {
            // A single indispensable pair counts, two are seldom wrong together.
            let indispensable = InfluentialPairs { pairs, ln_odds: f64::INFINITY, shift: 0.0, sigma: f64::INFINITY };
            return (out.len() == 1).then_some(indispensable);
        };
        let about = motion.apply(&prior_terms.centroid);
        let (mut shift, mut variance) = (0.0, 0.0);
        for anchor in &anchors {
            let place = motion.apply(anchor);
            shift += (place - pose.apply(anchor)).norm_squared();
            variance += spread(&covariance, &(place - about)).trace();
        }
        let count = anchors.len() as f64;
        let ln_odds = without - all + out.iter().map(|&at| excess[at]).sum::<f64>();
        Some(InfluentialPairs { pairs, ln_odds, shift: (shift / count).sqrt(), sigma: (variance / count).sqrt() })
    };
    let count = mode.members.len();
    let twice = if (NEEDED + 2..=MAX_TWICE).contains(&count) { count } else { 0 };
    let ones = (0..count).filter_map(|at| deleted(&[at]));
    ones.chain((0..twice).flat_map(|a| (a + 1..twice).map(move |b| [a, b])).filter_map(|two| deleted(&two))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(ln_odds: f64, shift: f64, sigma: f64) -> InfluentialPairs {
        InfluentialPairs { pairs: vec![Correspondence { model: 0, cloud: 0 }], ln_odds, shift, sigma }
    }

    /// The closed form: erfc(1/√2) = 0.317 311 of normal errors are beyond one standard deviation.
    #[test]
    fn the_probability_is_that_of_the_odds_and_of_the_error() {
        const BEYOND: f64 = 0.317_310_507_862_914;
        let of = |cases: &[InfluentialPairs]| misled(cases, 0.1).0;
        assert_eq!(of(&[]), 0.0);
        assert!((of(&[case(0.0, 0.0, 0.1)]) - 0.5 * BEYOND).abs() < 1e-12);
        assert!((of(&[case(0.0, 0.05, 0.05)]) - 0.5 * BEYOND).abs() < 1e-12);
        // Beyond the limit by the shift alone; three cases of equal probability, one without a wrong match.
        assert!((of(&[case(0.0, 0.1, 0.01), case(0.0, 0.2, 0.01)]) - 2.0 / 3.0).abs() < 1e-12);
        assert!((of(&[case(-7.0, 0.2, 0.01)]) - 1.0 / (1.0 + 7f64.exp())).abs() < 1e-12);
        // Odds beyond the range of their exponential, and a pair without which there is no pose.
        assert!((of(&[case(800.0, 0.2, 0.01), case(0.0, 0.2, 0.01)]) - 1.0).abs() < 1e-12);
        assert_eq!(of(&[case(0.0, 0.0, 0.1), case(f64::INFINITY, 0.0, f64::INFINITY)]), 1.0);
    }

    #[test]
    fn the_worst_pairs_are_named() {
        let all = [case(-9.0, 0.2, 0.01), case(-3.0, 0.2, 0.01), case(-2.0, 0.0, 0.01)];
        assert_eq!(misled(&all, 0.1).1, Some(&all[1]));
        assert_eq!(misled(&[], 0.1).1, None);
    }
}
