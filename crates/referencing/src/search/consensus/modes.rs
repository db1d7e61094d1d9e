//! From a rough motion to the maximum of the posterior near it.

use std::{cell::Cell, collections::BTreeSet};

use nalgebra::{Cholesky, U6};

use super::{
    Motion,
    bits::is_set,
    fit::{Linear, fit, fit_on},
    graph::Graph,
    likelihood::{Mode, Terms, ln_volume},
    rough::Rough,
};
use crate::ModelPoint;

/// Rounds of choosing pairs and fitting.
const ROUNDS: usize = 8;
/// What pairs may bring that join a set only when its motion is fitted (nats).
const JOINING: f64 = 8.0;
/// What turns that are not small may hide of a motion's worth (nats). More costs time, less loses modes: what the step foretells
/// is seldom a nat off.
const TURNING: f64 = 3.0;
/// The least set that a pose can come from.
const LEAST: usize = 3;

type Factor = Cholesky<f64, U6>;

/// Finds the modes of one problem.
pub(in crate::search) struct Climb<'a> {
    pub(in crate::search) model: &'a [ModelPoint],
    pub(in crate::search) terms: &'a Terms,
    pub(in crate::search) rough: &'a Rough,
    pub(in crate::search) graph: &'a Graph,
    /// Cloud points that no mode may use.
    pub(in crate::search) taken: &'a BTreeSet<usize>,
    /// Pairs compared with a motion so far.
    pub(in crate::search) compared: Cell<u64>,
}

impl Climb<'_> {
    /// Chooses pairs and fits in turn until the choice stands.
    ///
    /// `None` as soon as no evidence of `least` (nats) is in sight, or where the first choice is one that was `climbed` from before.
    pub(in crate::search) fn from(
        &self,
        members: &[usize],
        start: &Motion,
        least: f64,
        climbed: impl FnOnce(&[usize]) -> bool,
    ) -> Option<Mode> {
        // What fitted three noisy points roughly mostly fits no motion: that is seen at once.
        let first = Linear::at(self.terms, self.rough, members, start)?;
        if self.foreseen(members, &first) + TURNING < least {
            return None;
        }
        let (mut motion, factor) = fit_on(first, self.terms, self.rough, members, 2)?;
        if self.promise(members, &motion, &factor) < least {
            return None;
        }
        let mut chosen = self.choose(&motion);
        if chosen.len() < LEAST || climbed(&chosen) {
            return None;
        }
        let mut stands = chosen == members;
        for _ in 1..ROUNDS {
            if stands {
                break;
            }
            (motion, _) = fit(self.terms, self.rough, &chosen, &motion, 2)?;
            let next = self.choose(&motion);
            if next.len() < LEAST {
                return None;
            }
            stands = next == chosen;
            chosen = next;
        }
        let members = chosen;
        let (motion, factor) = fit(self.terms, self.rough, &members, &motion, 4)?;
        if !self.rough.holds(self.model, &motion, &factor) {
            return None;
        }
        let gains: f64 = members.iter().map(|&v| self.terms.residual_gain(v, &motion)).sum();
        let score = gains + self.terms.ln_share[members.len()] + self.rough.ln_density(&motion);
        let ln_evidence = score + ln_volume(&factor);
        ln_evidence.is_finite().then_some(Mode { members, motion, ln_evidence, ln_crowd: 0.0 })
    }

    /// About the evidence of those members that stay, and of one or two pairs that may join them.
    fn promise(&self, members: &[usize], motion: &Motion, factor: &Factor) -> f64 {
        let gains = members.iter().filter_map(|&v| self.terms.of_pair(v, motion));
        self.ln_share_of(gains) + self.rough.ln_density(motion) + ln_volume(factor) + JOINING
    }

    /// The same before the step is made.
    fn foreseen(&self, members: &[usize], linear: &Linear) -> f64 {
        let gains = members.iter().filter_map(|&v| linear.of_pair(self.terms, v));
        self.ln_share_of(gains) + linear.ln_density(self.rough) + linear.ln_volume() + JOINING
    }

    /// What pairs gain, with the share of their number; nothing where too few of them are left.
    fn ln_share_of(&self, gains: impl Iterator<Item = f64>) -> f64 {
        let (k, sum) = gains.fold((0, 0.0), |(k, sum), gain| (k + 1, sum + gain));
        if k < LEAST - 1 { f64::NEG_INFINITY } else { sum + self.terms.ln_share[k] }
    }

    /// The likeliest one-to-one set under a motion: of each model point its best pair, of pairs that share a
    /// cloud point the better, and of these as many as the likelihood gains by.
    fn choose(&self, motion: &Motion) -> Vec<usize> {
        self.compared.set(self.compared.get() + self.graph.vertices.len() as u64);
        let starts = &self.graph.starts;
        let mut best: Vec<(f64, usize)> = Vec::with_capacity(starts.len());
        // The image of a model has no sides.
        let camera = (motion.rotation.determinant() > 0.0).then(|| motion.origin());
        for i in 0..starts.len() - 1 {
            let point = &self.model[self.graph.vertices[starts[i]].model];
            if camera.is_some_and(|camera| !point.shows_itself(&camera)) {
                continue;
            }
            let place = motion.apply(&point.at.coords);
            let mut top: Option<(f64, usize)> = None;
            for v in starts[i]..starts[i + 1] {
                let pair = &self.terms.pairs[v];
                if let Some(gain) = pair.of_residual(&(pair.cloud - place))
                    && top.is_none_or(|(known, _)| gain > known)
                    && !self.taken.contains(&self.graph.vertices[v].cloud)
                {
                    top = Some((gain, v));
                }
            }
            best.extend(top);
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut used = vec![0; self.graph.clouds.div_ceil(64)];
        best.retain(|&(_, v)| {
            let cloud = self.graph.vertices[v].cloud;
            let first = !is_set(&used, cloud);
            used[cloud / 64] |= 1u64 << (cloud % 64);
            first
        });
        let (mut sum, mut most, mut keep) = (0.0, f64::NEG_INFINITY, LEAST.min(best.len()));
        for (k, (gain, _)) in best.iter().enumerate() {
            sum += gain;
            let total = sum + self.terms.ln_share[k + 1];
            if k + 1 >= LEAST && total > most {
                (most, keep) = (total, k + 1);
            }
        }
        let mut members: Vec<usize> = best[..keep].iter().map(|&(_, v)| v).collect();
        members.sort_unstable();
        members
    }
}
