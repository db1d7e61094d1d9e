//! Lower bounds of the residual cost of a set of pairs, with the pose that attains them.

use nalgebra::{Cholesky, Matrix6, U6};

use super::{
    fit::Linear,
    likelihood::{PairTerms, ln_volume},
    motion::Motion,
    prior_terms::PriorTerms,
};

/// Maximum number of steps of a fit: a few suffice from the pose of all members but the last, not always from a wide
/// prior.
pub(super) const ROUNDS: usize = 30;
/// Gain of the next step (nats) below which a fit has converged.
const CONVERGED: f64 = 1e-2;
/// Maximum number of times a step that does not descend is halved.
const HALVES: i32 = 6;
/// Allowance (nats) for a fit that ends without a descending step or is slow, as for contradicting pairs.
const SLOW: f64 = 1.0;
/// Rotation uncertainty (rad, root of the sum of the variances) up to which first order holds for the points.
const FIRST_ORDER: f64 = 0.1;

/// Laplace's approximation of the posterior of some pairs.
#[derive(Clone, Copy)]
pub(super) struct LaplacePosterior {
    pub(super) motion: Motion,
    /// Covariance of η about the motion: the inverse of the information.
    pub(super) covariance: Matrix6<f64>,
    /// ln of the posterior volume relative to the prior.
    pub(super) ln_posterior_volume: f64,
}

impl LaplacePosterior {
    fn of(motion: Motion, information: &Cholesky<f64, U6>, prior_terms: &PriorTerms) -> Self {
        let ln_posterior_volume = (prior_terms.ln_peak + ln_volume(information)).min(0.0);
        Self { motion, covariance: information.inverse(), ln_posterior_volume }
    }

    /// Whether rotations within the error of the pose are small.
    pub(super) fn is_of_first_order(&self) -> bool {
        let turn: f64 = (0..3).map(|i| self.covariance[(i, i)]).sum();
        turn <= FIRST_ORDER * FIRST_ORDER
    }
}

/// Fits of some pairs by damped Gauss–Newton steps.
///
/// Costs are those of residuals and prior, ½ χ² (nats), relative to zero residuals and the mode of the prior.
#[derive(Clone, Copy)]
pub(super) struct Fits<'a> {
    pub(super) terms: &'a PairTerms,
    pub(super) prior_terms: &'a PriorTerms,
    pub(super) members: &'a [usize],
}

impl Fits<'_> {
    /// Lower bound of the members' cost near a well-known pose, and the pose that attains it.
    pub(super) fn refined(&self, near: &Motion) -> Option<(f64, LaplacePosterior)> {
        let Self { terms, prior_terms, members } = *self;
        // Two steps: the prediction of one may be some hundredths of a nat too high and would be no bound.
        let motion = Linear::at(terms, prior_terms, members, near)?.moved();
        let linear = Linear::at(terms, prior_terms, members, &motion)?;
        let cost = self.cost(&motion) - linear.gained();
        Some((cost, LaplacePosterior::of(linear.moved(), linear.factor(), prior_terms)))
    }

    /// Minimum cost of the members under a pose.
    ///
    /// The fit starts from the pose of the previous members and from that of three members.
    pub(super) fn min_cost(&self, before: Option<Motion>) -> Option<(f64, LaplacePosterior)> {
        let mut min: Option<(f64, LaplacePosterior)> = None;
        for start in before.into_iter().chain(self.of_any_three()) {
            let found = self.descended(start)?;
            if min.as_ref().is_none_or(|(known, _)| found.0 < *known) {
                min = Some(found);
            }
        }
        min
    }

    /// The minimum cost (nats) reached by descending steps, and its pose.
    fn descended(&self, start: Motion) -> Option<(f64, LaplacePosterior)> {
        let Self { terms, prior_terms, members } = *self;
        let (mut motion, mut cost, mut left) = (start, self.cost(&start), ROUNDS);
        loop {
            let linear = Linear::at(terms, prior_terms, members, &motion)?;
            let gained = linear.gained();
            let end = |less: f64| Some((cost - less, LaplacePosterior::of(motion, linear.factor(), prior_terms)));
            if gained < CONVERGED {
                return end(gained);
            }
            let halves = (0..=HALVES).map(|half| linear.moved_by(0.5f64.powi(half)));
            let lower = halves.map(|to| (to, self.cost(&to))).find(|(_, of)| left > 0 && *of < cost);
            let Some(lower) = lower else { return end(SLOW) };
            (motion, cost) = lower;
            left -= 1;
        }
    }

    /// The cost of residuals and prior of the members under a motion (nats).
    pub(super) fn cost(&self, motion: &Motion) -> f64 {
        let Self { terms, prior_terms, members } = *self;
        let pairs = members.iter().map(|&v| &terms.pairs[v]);
        let residuals: f64 = pairs.map(|pair| 0.5 * pair.distance(&(pair.cloud - motion.apply(&pair.model)))).sum();
        residuals + prior_terms.ln_peak - prior_terms.ln_density(motion)
    }

    /// A pose from the last member and two others that determine one with it.
    fn of_any_three(&self) -> Option<Motion> {
        let (&last, others) = self.members.split_last()?;
        let of = |v: usize| &self.terms.pairs[v];
        let mut pairs = (1..others.len()).flat_map(|i| (0..i).map(move |k| (others[k], others[i])));
        pairs
            .find_map(|(a, b)| Motion::of_three([a, b, last].map(|v| &of(v).model), [a, b, last].map(|v| &of(v).cloud)))
    }
}
