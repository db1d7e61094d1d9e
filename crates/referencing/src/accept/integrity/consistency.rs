//! The consistency of an object's parts: the evidence for a displaced part, and the levels that cover one.

use nalgebra::{Matrix6, Vector3};
use seafix_geometry::{Camera, Covariance6, Object, Transform};

use super::{
    parts::parts,
    protection::{Protection, apart, semi_axes},
};
use crate::solve::likelihood::{
    leave_out::Deletions,
    moved_part::{Displaced, MovedPart},
};

/// The evidence that a part of the object is displaced against the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Consistency {
    /// The Bayes factor of a displaced part against an object as modelled, averaged over all parts and displacements.
    ///
    /// Its expectation is one for an object as modelled, so that it exceeds x with a probability of at most 1/x
    /// (Markov's inequality), however many parts are compared.
    pub bayes_factor: f64,
    /// The number of points of the most probable displaced part.
    pub moved: usize,
    /// The displacement of that part (m), at its centroid.
    pub shift: f64,
    /// The standard deviation of the displacement (m), over the three axes together.
    pub sigma: f64,
}

/// The hypotheses of a displaced part.
///
/// Each of the [`parts`] may be displaced, with equal probability, and with equal probability at each of the scales a,
/// a/3, a/9, …: a the alert limit, down to the error that the noise of the points gives the transferred model points.
/// Larger displacements are plainly visible or change the answer to another one; smaller ones are within the noise.
/// Solution separation covers any one displaced part: the error of the fix is at most the step to the pose under the
/// hypothesis, plus the error of that pose (Blanch and others, *Baseline advanced RAIM user algorithm*, 2015). Every
/// hypothesis is weighted by its posterior probability (Pervan, Pullen and Christie, *A multiple hypothesis approach to
/// satellite navigation integrity*, 1998).
pub(super) struct Hypotheses {
    of_parts: Vec<(Vec<usize>, MovedPart)>,
    /// The index of the part, and the estimate of its displacement.
    under: Vec<(usize, Displaced)>,
    /// The posterior probability of each hypothesis if some part is displaced.
    weights: Vec<f64>,
    ln_bayes: f64,
}

/// The ratio of successive scales.
const RATIO: f64 = 3.0;
/// Maximum number of scales.
const MAX_SCALES: usize = 6;

impl Hypotheses {
    /// The hypotheses for the points of `all`, which are at `places`; `None` if no part can be told from the rest.
    ///
    /// `alert` is the alert limit, `noise` the predicted error of the transferred model points (m, RMS).
    pub(super) fn of(all: &Deletions<'_>, places: &[Vector3<f64>], alert: f64, noise: f64) -> Option<Self> {
        let of_parts: Vec<(Vec<usize>, MovedPart)> =
            parts(places).into_iter().filter_map(|part| all.moved_part(&part).map(|moved| (part, moved))).collect();
        let scales: Vec<f64> =
            (0..MAX_SCALES as i32).map(|k| alert / RATIO.powi(k)).take_while(|scale| *scale >= noise).collect();
        // With noise above the alert limit a single scale remains.
        let scales = if scales.is_empty() { vec![alert] } else { scales };
        let under: Vec<(usize, Displaced)> = of_parts
            .iter()
            .enumerate()
            .flat_map(|(k, (_, moved))| scales.iter().filter_map(move |scale| Some((k, moved.displaced(*scale)?))))
            .collect();
        let max = under.iter().map(|(_, under)| under.ln_bayes).max_by(f64::total_cmp)?;
        let mut weights: Vec<f64> = under.iter().map(|(_, under)| libm::exp(under.ln_bayes - max)).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= sum);
        Some(Self { ln_bayes: max + libm::log(sum / under.len() as f64), of_parts, under, weights })
    }

    /// The evidence for a displaced part.
    pub(super) fn consistency(&self) -> Consistency {
        let best =
            (0..self.weights.len()).fold(0, |best, k| if self.weights[k] > self.weights[best] { k } else { best });
        let (k, under) = &self.under[best];
        let (part, moved) = &self.of_parts[*k];
        Consistency {
            bayes_factor: libm::exp(self.ln_bayes),
            moved: part.len(),
            shift: under.shift.norm(),
            sigma: moved.shift_sigma(under),
        }
    }

    /// The probability that a part is displaced, if it is `rate` before the measurement.
    fn probability(&self, rate: f64) -> f64 {
        let odds = rate / (1.0 - rate).max(f64::MIN_POSITIVE) * libm::exp(self.ln_bayes);
        if odds.is_finite() { odds / (1.0 + odds) } else { 1.0 }
    }

    /// Raises the levels so that displaced parts exceed each of them with at most the probability `budget`.
    pub(super) fn cover(
        &self,
        level: &mut Protection,
        all: &Deletions<'_>,
        fix: &Transform<Object, Camera>,
        rate: f64,
        budget: f64,
    ) {
        let probability = self.probability(rate);
        // All hypotheses left out together have a thousandth of the budget.
        let negligible = 1e-3 * budget / self.under.len() as f64;
        let likely = self.under.iter().zip(&self.weights).map(|(under, weight)| (under, weight * probability));
        let (mut position, mut attitude) = (Vec::new(), Vec::new());
        for ((k, under), weight) in likely.filter(|(_, weight)| !(*weight < negligible)) {
            let (moved, turned) = apart(fix, &all.pose().perturbed(&under.step));
            let (position_sigma, attitude_sigma) = semi_axes(&self.of_parts[*k].1.covariance(under));
            position.push(Tail { weight, shift: moved, sigma: position_sigma });
            attitude.push(Tail { weight, shift: turned, sigma: attitude_sigma });
        }
        level.position = quantile(&position, level.position, budget);
        level.attitude = quantile(&attitude, level.attitude, budget);
    }

    /// The increase of the covariance of `fix` by displaced parts: Σ P (Σ_part − Σ + ξ ξᵀ), ξ the step to the pose of
    /// the hypothesis.
    pub(super) fn spread(
        &self,
        all: &Deletions<'_>,
        fix: &Transform<Object, Camera>,
        own: &Covariance6<Object, Camera>,
        rate: f64,
    ) -> Matrix6<f64> {
        let probability = self.probability(rate);
        let of = |((k, under), weight): (&(usize, Displaced), &f64)| {
            let xi = fix.error_to(&all.pose().perturbed(&under.step));
            (self.of_parts[*k].1.covariance(under).matrix - own.matrix + xi * xi.transpose()) * (weight * probability)
        };
        self.under.iter().zip(&self.weights).map(of).sum()
    }
}

/// An error of at most `shift` plus a three-dimensional normal vector of deviation `sigma`, with a probability.
struct Tail {
    weight: f64,
    shift: f64,
    sigma: f64,
}

/// The smallest level from `min` on that all tails together exceed with at most the probability `budget`.
fn quantile(tails: &[Tail], min: f64, budget: f64) -> f64 {
    let beyond =
        |level: f64| -> f64 { tails.iter().map(|tail| tail.weight * exceeds((level - tail.shift) / tail.sigma)).sum() };
    if !(beyond(min) > budget) {
        return min;
    }
    let (mut low, mut high) = (min, 2.0 * min);
    while beyond(high) > budget && high.is_finite() {
        (low, high) = (high, 2.0 * high);
    }
    // To a relative 1e-6.
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        *(if beyond(middle) > budget { &mut low } else { &mut high }) = middle;
    }
    high
}

/// The probability with which a three-dimensional standard normal vector is longer than `x`.
fn exceeds(x: f64) -> f64 {
    match x {
        x if x <= 0.0 => 1.0,
        _ => {
            libm::erfc(x * std::f64::consts::FRAC_1_SQRT_2)
                + (2.0 / std::f64::consts::PI).sqrt() * x * libm::exp(-0.5 * x * x)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chi_square::chi_square;

    #[test]
    fn tails_are_those_of_chi_square() {
        for p in [0.5, 0.1, 1e-3, 1e-6] {
            let found = exceeds(chi_square(3, 1.0 - p).sqrt());
            assert!((found / p - 1.0).abs() < 1e-5, "{p} {found}");
        }
    }

    #[test]
    fn a_level_is_the_quantile_of_its_tails() {
        let tails = [Tail { weight: 0.3, shift: 0.0, sigma: 1.0 }, Tail { weight: 0.01, shift: 5.0, sigma: 2.0 }];
        let level = quantile(&tails, 1e-3, 1e-4);
        let beyond = 0.3 * exceeds(level) + 0.01 * exceeds((level - 5.0) / 2.0);
        assert!((beyond / 1e-4 - 1.0).abs() < 1e-3, "{level} {beyond}");
        assert_eq!(quantile(&tails, 100.0, 1e-4), 100.0);
    }
}
