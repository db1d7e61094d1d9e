//! The proof that no admissible set has more evidence than the best pose.

use std::{cell::Cell, collections::BTreeSet};

use nalgebra::{Matrix3, Matrix6, Vector3};

use super::{
    Motion,
    bits::{Held, intersect},
    bound::{After, Bounds},
    distance_residual::residual_of_two,
    fit::fit,
    graph::ConsistencyGraph,
    likelihood::{Mode, Terms},
    local_maxima::Climb,
    lower_bound::{Fits, LaplacePosterior, ROUNDS},
    posterior_volume::ln_posterior_volume,
    prior_terms::{PriorTerms, spread},
    seeds::Swept,
};
use crate::{ModelPoint, lanes::ones_of};

/// Evidence difference (nats) below which two sets are equal, since a fit ends only near its maximum.
const EQUAL: f64 = 1e-3;
/// Relative allowance for second-order terms in a variance.
const CURVED: f64 = 0.2;
/// Minimum number of pairs that determine a pose.
const MIN: usize = 3;
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
    (terms, prior_terms, graph): (&Terms, &PriorTerms, &ConsistencyGraph),
    swept: &mut Swept,
    budget: u64,
) -> Option<Proved> {
    let none = BTreeSet::new();
    let mut prover = Prover::of(model, (terms, prior_terms, graph), &none, swept.modes.first()?, budget);
    // Maximum amount by which the pruning bounds may be below the strict ones.
    let below = prover.bounds.above(&Bounds::of((terms, prior_terms, graph), MIN), prover.best.ln_evidence);
    let listed = swept.complete && swept.looked_for <= prover.best.ln_evidence - below;
    let open = if listed { prover.of_pairs(swept, below) } else { prover.of_each() };
    swept.insert(prover.better);
    Some(Proved { bound: open.max(prover.best.ln_evidence), pair_tests: prover.spent })
}

impl<'a> Prover<'a> {
    fn of(
        model: &'a [ModelPoint],
        (terms, prior_terms, graph): (&'a Terms, &'a PriorTerms, &'a ConsistencyGraph),
        taken: &'a BTreeSet<usize>,
        best: &Mode,
        budget: u64,
    ) -> Self {
        Self {
            climb: Climb { model, terms, prior_terms, graph, taken, compared: Cell::new(0) },
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
        if count < MIN {
            return *begun;
        }
        self.spent += COST_OF_A_FIT + COST_OF_A_MEMBER * count as u64;
        let fitted = match &begun.known {
            Some(known) if count > MIN && known.is_of_first_order() => self.fits().refined(&known.motion),
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
mod tests {
    use nalgebra::{Rotation3, UnitQuaternion};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{Covariance6, MeasuredPoint, Transform, UncertainPoint};

    use super::*;
    use crate::{
        Candidates, Prior, PriorBound, Problem, Tolerance,
        search::consensus::{Seeds, bits::is_set, likelihood::ln_volume},
    };

    const POINTS: usize = 6;
    /// An unlimited budget.
    const FREE: u64 = u64::MAX / 4;

    /// A scene of four or five object points with noise, and clutter; the model, the cloud and the true motion.
    fn scene(rng: &mut ChaCha8Rng) -> (Vec<ModelPoint>, Vec<MeasuredPoint>, Motion) {
        let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        let model: Vec<ModelPoint> = (0..POINTS).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
        let turn = Rotation3::from_scaled_axis(place(0.3)).into_inner();
        let motion = Motion { rotation: turn, translation: Vector3::new(0.0, 0.0, 3.0) + place(0.2) };
        let seen = if place(1.0).x > 0.0 { 4 } else { 5 };
        let measured = |at: Vector3<f64>, off: Vector3<f64>| {
            // The standard deviation of depth is three times that of the other axes.
            let deep = Matrix3::from_diagonal(&Vector3::new(0.03, 0.03, 0.09));
            let position = UncertainPoint { at: (at + deep * off).into(), covariance: deep * deep };
            MeasuredPoint { position, pixels: None }
        };
        let mut cloud: Vec<MeasuredPoint> =
            model[..seen].iter().map(|point| measured(motion.apply(&point.at.coords), place(1.7))).collect();
        cloud.extend((0..12).map(|_| measured(motion.translation + place(1.3), Vector3::zeros())));
        (model, cloud, motion)
    }

    /// The evidence of some pairs under their own pose; `None` without one.
    fn evidence(prover: &Prover<'_>, members: &[usize]) -> Option<f64> {
        let Climb { terms, prior_terms, .. } = prover.climb;
        let three = |i: usize, j: usize, k: usize| {
            let [a, b, c] = [members[i], members[j], members[k]].map(|v| &terms.pairs[v]);
            Motion::of_three([&a.model, &b.model, &c.model], [&a.cloud, &b.cloud, &c.cloud])
        };
        let count = members.len();
        let threes = (2..count).flat_map(|k| (1..k).flat_map(move |j| (0..j).map(move |i| (i, j, k))));
        let starts =
            threes.filter_map(|(i, j, k)| three(i, j, k)).chain(prior_terms.known.as_ref().map(|known| known.motion));
        let at = |start: Motion| {
            // A fit from a bad start is slow; short of its end the pose is not that of the pairs.
            let (motion, factor) = fit(terms, prior_terms, members, &start, 60)?;
            let gains: f64 = members.iter().map(|&v| terms.residual_gain(v, &motion)).sum();
            let filled = (prior_terms.ln_peak + ln_volume(&factor)).min(0.0);
            let ln_evidence =
                gains + terms.ln_fraction[count] + prior_terms.ln_density(&motion) - prior_terms.ln_peak + filled;
            let allowed =
                prover.climb.allows(members, &motion) && prior_terms.holds(prover.climb.model, &motion, &factor);
            allowed.then_some(ln_evidence)
        };
        starts.filter_map(at).fold(None, |max: Option<f64>, one| Some(max.map_or(one, |max| max.max(one))))
    }

    /// Calls `each` with every coherent set of three pairs or more that begins with `begun`.
    fn coherent(graph: &ConsistencyGraph, begun: &mut Vec<usize>, each: &mut impl FnMut(&[usize])) {
        if begun.len() >= MIN {
            each(begun);
        }
        let from = begun.last().map_or(0, |&v| graph.starts[graph.rank[v] as usize + 1]);
        for v in from..graph.vertices.len() {
            if begun.iter().all(|&member| is_set(graph.row(member), v)) {
                begun.push(v);
                coherent(graph, begun, each);
                begun.pop();
            }
        }
    }

    /// The cost of ten pairs beside their first four, and the fractions of the other six in it.
    ///
    /// Fails if each fraction is the cost of a pair by itself: all of them share the cost of the four's pose.
    #[test]
    fn fractions_are_no_more_than_what_all_cost() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut greatest: f64 = 0.0;
        for _ in 0..300 {
            let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
            let model: Vec<ModelPoint> = (0..10).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
            let ahead = Vector3::new(0.0, 0.0, 3.0);
            let seen =
                |point: &ModelPoint| UncertainPoint::isotropic((point.at.coords + ahead + place(0.015)).into(), 0.01);
            let cloud: Vec<MeasuredPoint> =
                model.iter().map(seen).map(|position| MeasuredPoint { position, pixels: None }).collect();
            let candidates = Candidates::from_pairs(10, (0..10).map(|i| (i, i)));
            let tolerance = Tolerance::Fixed(0.1);
            let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior: None };
            let prior_terms = PriorTerms::of(&problem).expect("a box");
            let graph = ConsistencyGraph::of(&problem, &prior_terms);
            let terms = Terms::of(&problem, &prior_terms, &graph);
            let none = BTreeSet::new();
            let motion = Motion { rotation: Matrix3::identity(), translation: ahead };
            // Every set examined has less evidence: none becomes the best.
            let other = Mode { members: Vec::new(), motion, ln_evidence: 1e9, ln_even: 1e9, ln_clutter_density: 0.0 };
            let mut prover = Prover::of(&model, (&terms, &prior_terms, &graph), &none, &other, 0);
            let begun = (0..4).fold(Begun::default(), |begun, v| prover.join(&begun, v));
            let begun = prover.fitted(&begun);
            prover.best.ln_evidence = -1e9;
            let mut level = Level { common: vec![!0 << 4 & ((1 << 10) - 1)], ..Level::default() };
            prover.leave_out(&begun, (10, 0.0), 4, &mut level).expect("four points determine a pose");
            let fractions: f64 = level.costs.iter().map(|(_, fraction)| fraction).sum();
            prover.members.extend(4..10);
            let (motion, _) = fit(&terms, &prior_terms, &prover.members, &motion, 8).expect("ten points");
            let max = prover.fits().cost(&motion) - begun.cost;
            assert!(level.costs.len() == 6 && fractions <= max + 0.01, "{fractions} of {max}");
            greatest = greatest.max(fractions / max);
        }
        assert!(greatest > 0.5, "{greatest}");
    }

    /// Checks the bound against every coherent set of small problems.
    ///
    /// The bound must hold with a sufficient and an insufficient budget, and with all poses found by the search or all
    /// but the worst removed.
    fn compare(rounds: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let [mut sets, mut proved, mut open, mut found_again] = [0; 4];
        for round in 0..rounds {
            let (model, cloud, truth) = scene(&mut rng);
            // All pairs, or half of them proposed.
            let proposed = |_: &(usize, usize)| round % 3 < 2 || rng.random_bool(0.5);
            let pairs = (0..POINTS).flat_map(|i| (0..cloud.len()).map(move |j| (i, j))).filter(proposed);
            let candidates = Candidates::from_pairs(POINTS, pairs.collect::<Vec<_>>());
            let at = Transform::new(UnitQuaternion::identity(), truth.translation).inverse();
            let bound = match round % 4 {
                0 => Some(PriorBound::Gaussian(Covariance6::isotropic(0.05, 0.1))),
                1 => Some(PriorBound::Box(0.5)),
                2 => Some(PriorBound::Gaussian(Covariance6::isotropic(0.5, 0.5))),
                _ => None,
            };
            let prior = bound.map(|bound| Prior { object_from_camera: at, bound });
            let (tolerance, prior) = (Tolerance::Fixed(0.3), prior.as_ref());
            let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior };
            let prior_terms = PriorTerms::of(&problem).expect("a box");
            let graph = ConsistencyGraph::of(&problem, &prior_terms);
            let terms = Terms::of(&problem, &prior_terms, &graph);
            let (parts, none) = ((&terms, &prior_terms, &graph), BTreeSet::new());
            for (missed, budget) in [(false, 200 * (round % 5)), (false, FREE), (true, 200 * (round % 5)), (true, FREE)]
            {
                let mut swept = Seeds::new(&model, parts, &none, (MIN, -3.0), FREE).sweep();
                if missed {
                    swept.modes.drain(..swept.modes.len().saturating_sub(1));
                }
                let before = swept.modes.first().map(|mode| mode.ln_evidence);
                let Some(reported) = prove(&model, parts, &mut swept, budget) else { continue };
                let best = swept.modes[0].ln_evidence;
                proved += u64::from(reported.bound == best);
                open += u64::from(reported.bound > best);
                found_again += u64::from(missed && before < Some(best));
                assert!(
                    budget < FREE || reported.bound == best,
                    "round {round}: sets up to {} are open above {best}",
                    reported.bound
                );
                let prover = Prover::of(&model, parts, &none, &swept.modes[0], 0);
                coherent(&graph, &mut Vec::new(), &mut |set| {
                    sets += 1;
                    // Under any pose.
                    let gains: f64 = set.iter().map(|&v| terms.pairs[v].gain).sum();
                    if gains + terms.ln_fraction[set.len()] > reported.bound {
                        let max = evidence(&prover, set).unwrap_or(f64::NEG_INFINITY);
                        assert!(
                            max <= reported.bound + 0.01,
                            "round {round}: {set:?} has evidence {max}, bound {}",
                            reported.bound
                        );
                    }
                });
            }
        }
        assert!(sets > 100 * rounds && 3 * proved > rounds && 5 * open > rounds, "{sets}, {proved}, {open}");
        assert!(10 * found_again > rounds, "{found_again}");
    }

    /// The proved bound holds for every coherent set of small problems.
    ///
    /// Fails if members cost twice their cost, if the cost of a further pair ignores the covariance of the pose, if the
    /// posterior volume is smaller, and if pruning bounds are taken for strict ones.
    #[test]
    fn no_coherent_set_is_more_probable_than_the_bound() {
        // Each problem takes 0.1 s: forty, or the number in `PROPTEST_CASES` if larger.
        let asked = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok());
        compare(asked.unwrap_or(0).max(40));
    }

    /// The long form: `cargo test --release -p seafix-referencing --lib -- --ignored more_probable`.
    ///
    /// Fails if the prediction of one step is taken for the end of a fit (problem 7435), and if a set whose fit is slow
    /// is skipped (problem 13 623).
    #[test]
    #[ignore = "20 000 problems; some minutes"]
    fn no_coherent_set_of_many_problems_is_more_probable_than_the_bound() {
        compare(20_000);
    }
}
