//! The pairs on which a pose depends, and the probability that one of them is a wrong match.

use nalgebra::Vector3;

use super::{
    clutter_density::ClutterDensity,
    graph::ConsistencyGraph,
    likelihood::{Mode, Terms},
    prior_terms::{PriorTerms, spread},
};
use crate::{
    problem::{Correspondence, Problem},
    search::limits::NEEDED,
};

/// Maximum number of model points that stand for the object in the errors of a pose.
const MAX_ANCHORS: usize = 64;
/// Maximum number of pairs of which two are left out at once, for the time it takes: O(k³).
const MAX_TWICE: usize = 20;

/// One or two pairs of the best pose, and the pose without them.
#[derive(Debug, Clone, PartialEq)]
pub struct Hinge {
    /// The pairs, one or two.
    pub pairs: Vec<Correspondence>,
    /// ln of the odds that they are clutter and not the object's, if the others are the object's.
    pub ln_odds: f64,
    /// The distance (m, RMS over the model points) of the pose from the pose without them.
    pub shift: f64,
    /// The standard deviation (m, RMS over the model points) of the pose without them; infinite if the others determine
    /// none.
    pub sigma: f64,
}

impl Hinge {
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
pub(crate) fn misled(hinges: &[Hinge], limit: f64) -> (f64, Option<&Hinge>) {
    if let Some(indispensable) = hinges.iter().find(|hinge| hinge.ln_odds == f64::INFINITY) {
        return (1.0, Some(indispensable));
    }
    let max = hinges.iter().map(|hinge| hinge.ln_odds).fold(0.0, f64::max);
    let odds = |hinge: &Hinge| libm::exp(hinge.ln_odds - max);
    let all = libm::exp(-max) + hinges.iter().map(odds).sum::<f64>();
    let of = |hinge: &Hinge| odds(hinge) * hinge.beyond(limit);
    let worst = hinges.iter().max_by(|a, b| of(a).total_cmp(&of(b)));
    (hinges.iter().map(of).sum::<f64>() / all, worst)
}

/// The hinges of a mode of four points or more: each pair, and each two of five to [`MAX_TWICE`].
///
/// Some pairs S are the object's, or clutter near the places that the others predict. With the evidence Λ of a set and
/// the probability B of its number of points, the odds of clutter are
///
/// O_S = Λ(V \\ S) B(k − |S|) e^x / (Λ(V) B(k)),
///
/// x the excess density of clutter about the points; zero without `clutter_density`. Both sets have their own pose and
/// posterior volume: the worse the others determine the place of a point, the more clutter may lie there.
pub(in crate::search) fn hinges(
    problem: &Problem<'_>,
    parts: (&Terms, &PriorTerms, &ConsistencyGraph),
    clutter_density: Option<&mut ClutterDensity>,
    mode: &Mode,
) -> Vec<Hinge> {
    let (terms, prior_terms, graph) = parts;
    let all_anchors = problem.anchors();
    let anchors: Vec<Vector3<f64>> = all_anchors
        .iter()
        .step_by(all_anchors.len().div_ceil(MAX_ANCHORS).max(1))
        .map(|anchor| anchor.at.coords)
        .collect();
    let of = |members: &[usize]| {
        let (ln_evidence, motion, factor) = mode.refitted(terms, prior_terms, members)?;
        Some((ln_evidence + terms.ln_fraction[members.len()], motion, factor.inverse()))
    };
    let Some((all, pose, _)) = of(&mode.members) else { return Vec::new() };
    let even = || vec![0.0; mode.members.len()];
    let excess = clutter_density.map_or_else(even, |density| density.excesses(problem, parts, mode));
    let hinge = |out: &[usize]| {
        let kept = |at: &usize| !out.contains(at);
        let others: Vec<usize> = (0..mode.members.len()).filter(kept).map(|at| mode.members[at]).collect();
        let pairs = out.iter().map(|&at| graph.vertices[mode.members[at]]).collect();
        let Some((without, motion, covariance)) = of(&others) else {
            // A single indispensable pair counts, two are seldom wrong together.
            let indispensable = Hinge { pairs, ln_odds: f64::INFINITY, shift: 0.0, sigma: f64::INFINITY };
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
        Some(Hinge { pairs, ln_odds, shift: (shift / count).sqrt(), sigma: (variance / count).sqrt() })
    };
    let count = mode.members.len();
    let twice = if (NEEDED + 2..=MAX_TWICE).contains(&count) { count } else { 0 };
    let ones = (0..count).filter_map(|at| hinge(&[at]));
    ones.chain((0..twice).flat_map(|a| (a + 1..twice).map(move |b| [a, b])).filter_map(|two| hinge(&two))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hinge(ln_odds: f64, shift: f64, sigma: f64) -> Hinge {
        Hinge { pairs: vec![Correspondence { model: 0, cloud: 0 }], ln_odds, shift, sigma }
    }

    /// The closed form: erfc(1/√2) = 0.317 311 of normal errors are beyond one standard deviation.
    #[test]
    fn the_probability_is_that_of_the_odds_and_of_the_error() {
        const BEYOND: f64 = 0.317_310_507_862_914;
        let of = |hinges: &[Hinge]| misled(hinges, 0.1).0;
        assert_eq!(of(&[]), 0.0);
        assert!((of(&[hinge(0.0, 0.0, 0.1)]) - 0.5 * BEYOND).abs() < 1e-12);
        assert!((of(&[hinge(0.0, 0.05, 0.05)]) - 0.5 * BEYOND).abs() < 1e-12);
        // Beyond the limit by the shift alone; three cases of equal probability, one without a wrong match.
        assert!((of(&[hinge(0.0, 0.1, 0.01), hinge(0.0, 0.2, 0.01)]) - 2.0 / 3.0).abs() < 1e-12);
        assert!((of(&[hinge(-7.0, 0.2, 0.01)]) - 1.0 / (1.0 + 7f64.exp())).abs() < 1e-12);
        // Odds beyond the range of their exponential, and a pair without which there is no pose.
        assert!((of(&[hinge(800.0, 0.2, 0.01), hinge(0.0, 0.2, 0.01)]) - 1.0).abs() < 1e-12);
        assert_eq!(of(&[hinge(0.0, 0.0, 0.1), hinge(f64::INFINITY, 0.0, f64::INFINITY)]), 1.0);
    }

    #[test]
    fn the_worst_pairs_are_named() {
        let all = [hinge(-9.0, 0.2, 0.01), hinge(-3.0, 0.2, 0.01), hinge(-2.0, 0.0, 0.01)];
        assert_eq!(misled(&all, 0.1).1, Some(&all[1]));
        assert_eq!(misled(&[], 0.1).1, None);
    }
}
