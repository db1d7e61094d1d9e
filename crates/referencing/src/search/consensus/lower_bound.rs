//! What some pairs cost at least, and the pose under which they do.

use nalgebra::{Cholesky, Matrix6, U6};

use super::{
    Motion,
    fit::Linear,
    likelihood::{Terms, ln_volume},
    prior_terms::PriorTerms,
};

/// Steps of a fit at most: from the pose of all members but the last a few suffice, from that of a wide prior not always.
pub(super) const ROUNDS: usize = 30;
/// A fit that would gain less by its next step (nats) has come to its end.
const CONVERGED: f64 = 1e-2;
/// Of a step that leads nowhere lower so many times the half is tried.
const HALVES: i32 = 6;
/// Where pairs contradict each other a fit is slow or ends where no step leads lower: its end is no lower than this (nats).
const SLOW: f64 = 1.0;
/// Poses known better than this (rad, the root of the sum of the variances) put their points where the first order has them.
const FIRST_ORDER: f64 = 0.1;

/// What some pairs say of the pose together.
#[derive(Clone, Copy)]
pub(super) struct LaplacePosterior {
    pub(super) motion: Motion,
    /// Of η about the motion: the inverse of the information.
    pub(super) covariance: Matrix6<f64>,
    /// ln of the share of the prior that it fills.
    pub(super) ln_posterior_volume: f64,
}

impl LaplacePosterior {
    fn of(motion: Motion, information: &Cholesky<f64, U6>, prior_terms: &PriorTerms) -> Self {
        let ln_posterior_volume = (prior_terms.ln_peak + ln_volume(information)).min(0.0);
        Self { motion, covariance: information.inverse(), ln_posterior_volume }
    }

    /// Whether the pose is known so well that turns within its error are small.
    pub(super) fn is_of_first_order(&self) -> bool {
        let turn: f64 = (0..3).map(|i| self.covariance[(i, i)]).sum();
        turn <= FIRST_ORDER * FIRST_ORDER
    }
}

/// Fits of some pairs that end where no step leads lower.
///
/// Costs are those of residuals and prior, ½ χ² (nats), against pairs in their places and the likeliest pose of the prior.
#[derive(Clone, Copy)]
pub(super) struct Fits<'a> {
    pub(super) terms: &'a Terms,
    pub(super) prior_terms: &'a PriorTerms,
    pub(super) members: &'a [usize],
}

impl Fits<'_> {
    /// What the members cost at least near a pose that is known well, and that pose.
    pub(super) fn refined(&self, near: &Motion) -> Option<(f64, LaplacePosterior)> {
        let Self { terms, prior_terms, members } = *self;
        // Two steps: what one foretells may be some hundredths of a nat too much, and then it is no bound.
        let motion = Linear::at(terms, prior_terms, members, near)?.moved();
        let linear = Linear::at(terms, prior_terms, members, &motion)?;
        let cost = self.cost(&motion) - linear.gained();
        Some((cost, LaplacePosterior::of(linear.moved(), linear.factor(), prior_terms)))
    }

    /// The least that the members cost under a pose, from that of the members before and from that of three of them, and that pose.
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

    /// What the members cost at least (nats) where steps that each lower it lead to, and that pose.
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

    /// What residuals and prior cost the members under a motion (nats).
    pub(super) fn cost(&self, motion: &Motion) -> f64 {
        let Self { terms, prior_terms, members } = *self;
        let pairs = members.iter().map(|&v| &terms.pairs[v]);
        let residuals: f64 = pairs.map(|pair| 0.5 * pair.distance(&(pair.cloud - motion.apply(&pair.model)))).sum();
        residuals + prior_terms.ln_peak - prior_terms.ln_density(motion)
    }

    /// A pose of the last member and of two others that fix one with it.
    fn of_any_three(&self) -> Option<Motion> {
        let (&last, others) = self.members.split_last()?;
        let of = |v: usize| &self.terms.pairs[v];
        let mut pairs = (1..others.len()).flat_map(|i| (0..i).map(move |k| (others[k], others[i])));
        pairs
            .find_map(|(a, b)| Motion::of_three([a, b, last].map(|v| &of(v).model), [a, b, last].map(|v| &of(v).cloud)))
    }
}
