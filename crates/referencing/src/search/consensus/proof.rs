//! The proof that no admissible set has more evidence than the best pose.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Matrix6, Vector3};

use super::{
    bits::{Held, intersect},
    bound::{After, Bounds},
    distance_residual::residual_of_two,
    fit::fit,
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms},
    local_maxima::Climb,
    lower_bound::{Fits, LaplacePosterior, ROUNDS},
    motion::Motion,
    posterior_volume::ln_posterior_volume,
    prior_terms::{PriorTerms, spread},
    seeds::Swept,
};
use crate::{lanes::ones_of, search::limits::NEEDED, site::model::ModelPoint};

/// Evidence difference (nats) below which two sets are equal, since a fit ends only near its maximum.
const EQUAL: f64 = 1e-3;
/// Relative allowance for second-order terms in a variance.
const CURVED: f64 = 0.2;
/// Costs, in words read: a fit, each of its members, each pair compared with a pose.
const COST_OF_A_FIT: u64 = 512;
const COST_OF_A_MEMBER: u64 = 64;
const COST_OF_A_PAIR: u64 = 32;

/// The result of a proof.
pub(in crate::search) struct Proved {
    /// Upper bound of the evidence (nats) of a coherent set.
    pub(in crate::search) bound: f64,
    /// Work done.
    pub(in crate::search) pair_tests: u64,
}

/// Depth-first branch and bound over all coherent sets, each visited once from its first pair on.
///
/// A set that begins with given pairs has at most the evidence
///
/// Σ gains − c + max_k [ln B(k) + min (v(k), v)],
///
/// summed over its pairs and the best pair of each model point among their later common neighbours. c is the residual
/// cost of the given pairs under their own pose, the minimum over all poses. v is the log volume of their posterior
/// relative to the prior; further pairs only shrink it if the pose is well determined. v(k) is the same for any k pairs
/// ([`ln_posterior_volume`]). The additional residual cost of a neighbour is at least its cost by itself: a neighbour
/// whose bound falls short is in no set of interest.
///
/// Limits: the maximum that a fit reaches is taken for the global one, and posterior volumes are taken for equal under
/// poses that differ by the noise.
struct Prover<'a> {
    climb: Climb<'a>,
    bounds: Bounds<'a>,
    best: Mode,
    /// Poses better than the first, in the order found.
    better: Vec<Mode>,
    /// Whether the evidence of some set could not be computed.
    unsettled: bool,
    budget: u64,
    spent: u64,
    members: Vec<usize>,
    levels: Vec<Level>,
}

/// The first pairs of a set.
#[derive(Clone, Copy, Default)]
struct Begun {
    /// Sum of their gains, without residuals.
    gains: f64,
    /// Their contribution to a bound.
    bring: f64,
    /// Lower bound of their residual cost.
    cost: f64,
    /// The pose of these pairs; `None` if they do not determine one.
    known: Option<LaplacePosterior>,
}

/// The remaining choices at one depth.
#[derive(Default)]
struct Level {
    common: Vec<u64>,
    held: Vec<Held>,
    after: Vec<After>,
    row: Vec<u64>,
    /// Cost of each remaining pair by itself beside the members, and its fraction beside all others; may be empty.
    costs: Vec<(f64, f64)>,
    /// Maximum contribution of each model point, less its cost.
    top: Vec<f64>,
}

/// Proves, within the budget, that no coherent set has more evidence than the best pose.
///
/// Better poses found on the way join the others. Sets with a point that their pose hides, puts too far off, or puts
/// outside the prior's box are excluded. `None` without a pose.
pub(in crate::search) fn prove(
    model: &[ModelPoint],
    (terms, prior_terms, graph): (&PairTerms, &PriorTerms, &ConsistencyGraph),
    swept: &mut Swept,
    budget: u64,
) -> Option<Proved> {
    let none = BTreeSet::new();
    let mut prover = Prover::of(model, (terms, prior_terms, graph), &none, swept.modes.first()?, budget);
    // Maximum amount by which the pruning bounds may be below the strict ones.
    let below = prover.bounds.above(&Bounds::of((terms, prior_terms, graph), NEEDED), prover.best.ln_evidence);
    let listed = swept.complete && swept.looked_for <= prover.best.ln_evidence - below;
    let open = if listed { prover.of_pairs(swept, below) } else { prover.of_each() };
    swept.insert(prover.better);
    Some(Proved { bound: open.max(prover.best.ln_evidence), pair_tests: prover.spent })
}

impl<'a> Prover<'a> {
    fn of(
        model: &'a [ModelPoint],
        (terms, prior_terms, graph): (&'a PairTerms, &'a PriorTerms, &'a ConsistencyGraph),
        taken: &'a BTreeSet<usize>,
        best: &Mode,
        budget: u64,
    ) -> Self {
        Self {
            climb: Climb::new(model, (terms, prior_terms, graph), taken),
            bounds: Bounds::proved((terms, graph), &ln_posterior_volume(model, (terms, prior_terms, graph))),
            best: best.clone(),
            better: Vec::new(),
            unsettled: false,
            budget,
            spent: 0,
            members: Vec::new(),
            levels: Vec::new(),
        }
    }

    /// Minimum evidence of a set of interest.
    fn enough(&self) -> f64 {
        self.best.ln_evidence + EQUAL
    }

    fn ended(&self) -> bool {
        self.unsettled || self.spent > self.budget
    }

    /// Examines the sets that begin with the recorded pairs, whose bounds are at most `below` under the strict ones.
    /// Returns the greatest bound of the sets left open.
    fn of_pairs(&mut self, swept: &Swept, below: f64) -> f64 {
        let graph = self.climb.graph;
        let mut open = f64::NEG_INFINITY;
        let mut common = vec![0; graph.lasts.len()];
        for &(bound, a, b) in &swept.pairs {
            let bound = f64::from(bound) + below;
            if bound <= self.enough() {
                continue;
            }
            if self.ended() {
                open = open.max(bound);
                continue;
            }
            let (a, b) = (a as usize, b as usize);
            let next = graph.starts[graph.rank[b] as usize + 1];
            self.spent += 1 + (graph.lasts.len() - next / 64) as u64;
            intersect(graph.row(a), graph.row(b), &graph.lasts, next, &mut common);
            self.members.clear();
            let begun = self.start();
            let begun = self.join(&begun, a);
            let begun = self.join(&begun, b);
            if !self.joined_by(&begun, &common) {
                open = open.max(bound);
            }
        }
        open
    }

    /// Examines the sets that begin with each vertex. Returns the greatest bound of the sets left open.
    fn of_each(&mut self) -> f64 {
        let graph = self.climb.graph;
        let mut open = f64::NEG_INFINITY;
        for a in 0..graph.vertices.len() {
            self.members.clear();
            let begun = self.start();
            let begun = self.join(&begun, a);
            let from = graph.rank[a] as usize + 1;
            let reach = self.bounds.joined((1, begun.bring), graph.row(a), from);
            self.spent += graph.row(a).len() as u64;
            let bound = self.bound(&begun, reach);
            if bound > self.enough() && (self.ended() || !self.joined_by(&begun, graph.row(a))) {
                open = open.max(bound);
            }
        }
        open
    }

    /// The empty set with the prior's pose.
    fn start(&self) -> Begun {
        let known = self.climb.prior_terms.known.as_ref().map(|known| LaplacePosterior {
            motion: known.motion,
            covariance: Matrix6::identity(),
            ln_posterior_volume: 0.0,
        });
        Begun { known, ..Begun::default() }
    }

    /// The set with one more member; its cost includes the distance residuals of the first three only.
    fn join(&mut self, begun: &Begun, v: usize) -> Begun {
        let terms = self.climb.terms;
        let of = |v: usize| &terms.pairs[v];
        // The distances of three pairs are correlated, but only to first order: their maximum is a safe bound.
        let distance_residual = match self.members[..] {
            [a] => residual_of_two(of(a), of(v)),
            [a, b] => residual_of_two(of(a), of(v)).max(residual_of_two(of(b), of(v))),
            _ => 0.0,
        };
        self.members.push(v);
        Begun {
            gains: begun.gains + terms.pairs[v].gain,
            bring: begun.bring + self.bounds.gain(v),
            cost: begun.cost.max(distance_residual),
            known: begun.known,
        }
    }

    /// The bound of k pairs with the contribution `bring`, the first of which are given.
    fn bound(&self, begun: &Begun, (k, bring): (usize, f64)) -> f64 {
        // The posterior volume depends on the attitude if the noise is anisotropic.
        let of_begun = begun
            .known
            .filter(LaplacePosterior::is_of_first_order)
            .map_or(f64::INFINITY, |known| self.climb.terms.ln_fraction[k] + known.ln_posterior_volume);
        bring - begun.cost + self.bounds.of_number(k).min(of_begun)
    }

    /// Examines all sets that begin with the members and continue among `later`; true if none exceeds the best.
    fn joined_by(&mut self, begun: &Begun, later: &[u64]) -> bool {
        let graph = self.climb.graph;
        let count = self.members.len();
        let next = graph.rank[self.members[count - 1]] as usize + 1;
        let reach = self.bounds.joined((count, begun.bring), later, next);
        if self.bound(begun, reach) <= self.enough() {
            return true;
        }
        if self.ended() {
            return false;
        }
        let begun = self.fitted(begun);
        if self.bound(&begun, reach) <= self.enough() {
            return true;
        }
        if self.levels.len() <= count {
            self.levels.resize_with(count + 1, Level::default);
        }
        let mut level = std::mem::take(&mut self.levels[count]);
        let none = self.each_of(&begun, reach, later, &mut level);
        self.levels[count] = level;
        none && !self.unsettled
    }

    /// The recursive step of [`Self::joined_by`], if the bound reaches a set of interest.
    fn each_of(&mut self, begun: &Begun, reach: (usize, f64), later: &[u64], level: &mut Level) -> bool {
        let graph = self.climb.graph;
        let count = self.members.len();
        let next = graph.rank[self.members[count - 1]] as usize + 1;
        level.common.clear();
        level.common.extend_from_slice(later);
        level.costs.clear();
        level.top.clear();
        if let Some(reach) = self.leave_out(begun, reach, next, level)
            && self.bound(begun, reach) <= self.enough()
        {
            return true;
        }
        Held::list(&level.common, graph.starts[next], &mut level.held);
        let top = if level.top.is_empty() { self.bounds.tops() } else { &level.top };
        self.bounds.list_of(&level.held, top, &mut level.after);
        level.row.resize(later.len(), 0);
        for (place, v) in level.held.iter().flat_map(Held::ones).enumerate() {
            let rank = graph.rank[v] as usize;
            let mut with = self.join(begun, v);
            let (alone, shared) = level.costs.get(place).copied().unwrap_or_default();
            let reach = level.after[rank].with((count + 1, with.bring - shared));
            let mut none = true;
            if self.bound(&with, reach) > self.enough() {
                with.cost = with.cost.max(begun.cost + alone);
                self.spent += (graph.lasts.len() - graph.starts[rank + 1] / 64) as u64 + 1;
                intersect(&level.common, graph.row(v), &graph.lasts, graph.starts[rank + 1], &mut level.row);
                none = self.joined_by(&with, &level.row);
            }
            self.members.pop();
            if !none {
                return false;
            }
        }
        true
    }

    /// Adds the pose and the residual cost of the members and examines them as a set.
    ///
    /// Nothing is added if they do not determine a pose.
    fn fitted(&mut self, begun: &Begun) -> Begun {
        let Climb { terms, .. } = self.climb;
        let count = self.members.len();
        if count < NEEDED {
            return *begun;
        }
        self.spent += COST_OF_A_FIT + COST_OF_A_MEMBER * count as u64;
        let fitted = match &begun.known {
            Some(known) if count > NEEDED && known.is_of_first_order() => self.fits().refined(&known.motion),
            known => self.fits().min_cost(known.map(|known| known.motion)),
        };
        // Pairs that do not determine a pose are no set of interest by themselves.
        let Some((cost, known)) = fitted else { return *begun };
        self.meet(begun.gains - cost + terms.ln_fraction[count] + known.ln_posterior_volume, &known.motion);
        Begun { cost, known: Some(known), ..*begun }
    }

    fn fits(&self) -> Fits<'_> {
        Fits { terms: self.climb.terms, prior_terms: self.climb.prior_terms, members: &self.members }
    }

    /// Removes the later pairs, from a rank on, whose bound falls short. Returns the number of pairs in reach of the
    /// rest and their contribution less their cost.
    ///
    /// The residuals of m further pairs cost at least Σ_v c_v. c_v is the cost of one pair beside the members with an
    /// m-th of their weight: Σ d² = Σ_v (d_P²/m + d_v²), each term at least its own minimum.
    fn leave_out(
        &mut self,
        begun: &Begun,
        reach: (usize, f64),
        next: usize,
        level: &mut Level,
    ) -> Option<(usize, f64)> {
        let known = begun.known.filter(LaplacePosterior::is_of_first_order)?;
        let Level { common, costs, top, .. } = level;
        let Climb { graph, terms, prior_terms, .. } = self.climb;
        let about = known.motion.apply(&prior_terms.centroid);
        let (enough, all, first) = (self.enough(), self.bound(begun, reach), graph.starts[next]);
        let more = (reach.0 - self.members.len()) as f64;
        let covariance = known.covariance * (1.0 + CURVED);
        top.resize(self.bounds.tops().len(), 0.0);
        let (mut k, mut bring, mut last) = (self.members.len(), begun.bring, usize::MAX);
        let mut compared = 0;
        for (place, word) in common.iter_mut().enumerate().skip(first / 64) {
            for v in ones_of(64 * place, *word).filter(|&v| v >= first) {
                compared += 1;
                let pair = &terms.pairs[v];
                let at = known.motion.apply(&pair.model);
                let Some(noise) = pair.weight.try_inverse() else {
                    // A pair without a covariance is in no set of interest.
                    *word &= !(1 << (v % 64));
                    continue;
                };
                let spread = spread(&covariance, &(at - about));
                let r = pair.cloud - at;
                let alone = 0.5 * distance(&(noise + spread), &r);
                let (rank, own) = (graph.rank[v] as usize, self.bounds.gain(v));
                if all - self.bounds.gain_of_rank(rank) + own - alone <= enough {
                    *word &= !(1 << (v % 64));
                    continue;
                }
                let shared = 0.5 * distance(&(noise + spread * more), &r);
                let brings = self.bounds.brings(pair.gain - shared);
                costs.push((alone, own - brings));
                if rank != last {
                    (k, bring, top[rank], last) = (k + 1, bring + brings, brings, rank);
                } else if brings > top[rank] {
                    (bring, top[rank]) = (bring + brings - top[rank], brings);
                }
            }
        }
        self.spent += COST_OF_A_PAIR * compared;
        Some((k, bring))
    }

    /// Examines a set of given evidence: if it exceeds the best, the set or the pose that it leads to becomes the best.
    fn meet(&mut self, ln_evidence: f64, motion: &Motion) {
        if ln_evidence <= self.enough() {
            return;
        }
        let Climb { terms, prior_terms, .. } = self.climb;
        let mut members = self.members.clone();
        members.sort_unstable();
        let Some((motion, factor)) = fit(terms, prior_terms, &members, motion, ROUNDS) else {
            self.unsettled = true;
            return;
        };
        let led = self.climb.from(&members, &motion, f64::NEG_INFINITY, |_| false);
        let allowed = self.climb.allows(&members, &motion);
        let own = allowed.then(|| self.climb.mode(members, motion, &factor)).flatten();
        let more_probable = |mode: &Mode| mode.ln_evidence > self.enough();
        let found =
            led.into_iter().chain(own).filter(more_probable).max_by(|a, b| a.ln_evidence.total_cmp(&b.ln_evidence));
        if let Some(mode) = found {
            self.best = mode.clone();
            self.better.push(mode);
        }
    }
}

/// The squared Mahalanobis distance rᵀ Σ⁻¹ r.
fn distance(covariance: &Matrix3<f64>, r: &Vector3<f64>) -> f64 {
    // The adjugate is accurate for this well-conditioned matrix, and fast: every remaining pair needs it.
    let (a, b, c) = (covariance.column(0), covariance.column(1), covariance.column(2));
    let bc = b.cross(&c);
    let across = Vector3::new(r.dot(&bc), r.dot(&c.cross(&a)), r.dot(&a.cross(&b)));
    r.dot(&across) / a.dot(&bc)
}

#[cfg(test)]
mod tests;
