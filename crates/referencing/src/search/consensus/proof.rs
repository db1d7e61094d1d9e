//! The proof that no admissible set is likelier.

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

/// Evidence that differs by less (nats) is equal: fits end somewhere near their maximum.
const EQUAL: f64 = 1e-3;
/// What second order may add to a variance, as a share of it.
const CURVED: f64 = 0.2;
/// The least set that a pose can come from.
const MIN: usize = 3;
/// What a fit and each of its members cost, and each pair that is compared with a pose, in words read.
const COST_OF_A_FIT: u64 = 512;
const COST_OF_A_MEMBER: u64 = 64;
const COST_OF_A_PAIR: u64 = 32;

/// What is proved.
pub(in crate::search) struct Proved {
    /// No coherent set has more evidence than this (nats).
    pub(in crate::search) bound: f64,
    /// Work done.
    pub(in crate::search) pair_tests: u64,
}

/// Branch and bound over all coherent sets, each met once: at its first pair, its second, and so on.
///
/// A set that is begun by some pairs has no more evidence than
///
/// Σ gains − c + max_k [ln B(k) + min (v(k), v)],
///
/// over its pairs and the best of each model point among their later common neighbours: c what the residuals of the pairs cost under
/// their own pose, and more than that under any other; v the volume of the posterior of these pairs against that of the
/// prior, of which more pairs leave less, where the pose is known well; v(k) that of any k pairs ([`ln_posterior_volume`]). What a neighbour's residual costs in
/// addition is at least what it costs by itself: those with which the bound falls short join no set of interest.
///
/// Where the pose of the pairs is fitted, the maximum that the fit comes to is taken for the greatest, and volumes for equal under
/// poses that differ by the noise.
struct Prover<'a> {
    climb: Climb<'a>,
    bounds: Bounds<'a>,
    best: Mode,
    /// Likelier poses than the first, as they were met.
    better: Vec<Mode>,
    /// Whether a set was met of which it is not known how likely it is.
    unsettled: bool,
    budget: u64,
    spent: u64,
    members: Vec<usize>,
    levels: Vec<Level>,
}

/// The first pairs of a set.
#[derive(Clone, Copy, Default)]
struct Begun {
    /// What they gain, without residuals.
    gains: f64,
    /// What they bring to a bound.
    bring: f64,
    /// What their residuals cost at least.
    cost: f64,
    /// The pose that they give; `None` where they leave it open.
    known: Option<LaplacePosterior>,
}

/// What is left to choose from at one depth.
#[derive(Default)]
struct Level {
    common: Vec<u64>,
    held: Vec<Held>,
    after: Vec<After>,
    row: Vec<u64>,
    /// What each that is left costs beside the members, and what of that is its share beside all others; nothing where that was not
    /// worked out.
    costs: Vec<(f64, f64)>,
    /// What each model point brings at most, its costs taken off.
    top: Vec<f64>,
}

/// Proves that no coherent set has more evidence than the likeliest pose, as far as so much work does; likelier poses that it meets join
/// the others. Sets with a point that their pose hides, or puts too far off or out of the prior's box, are none. `None` where there is
/// no pose.
pub(in crate::search) fn prove(
    model: &[ModelPoint],
    (terms, prior_terms, graph): (&Terms, &PriorTerms, &ConsistencyGraph),
    swept: &mut Swept,
    budget: u64,
) -> Option<Proved> {
    let none = BTreeSet::new();
    let mut prover = Prover::of(model, (terms, prior_terms, graph), &none, swept.modes.first()?, budget);
    // By how much the bounds that prune may be below those that prove.
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

    /// What a set must have to be of interest.
    fn enough(&self) -> f64 {
        self.best.ln_evidence + EQUAL
    }

    fn ended(&self) -> bool {
        self.unsettled || self.spent > self.budget
    }

    /// Looks at the sets that begin with the pairs that were left when all were known, each with a bound that is no more than this below
    /// one that holds. The greatest bound of what was left open.
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

    /// Looks at the sets that begin with each pair.
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

    /// No pairs, and what the prior says.
    fn start(&self) -> Begun {
        let known = self.climb.prior_terms.known.as_ref().map(|known| LaplacePosterior {
            motion: known.motion,
            covariance: Matrix6::identity(),
            ln_posterior_volume: 0.0,
        });
        Begun { known, ..Begun::default() }
    }

    /// One member joins; of what its residual costs, no more is known yet than the distances of the first three say.
    fn join(&mut self, begun: &Begun, v: usize) -> Begun {
        let terms = self.climb.terms;
        let of = |v: usize| &terms.pairs[v];
        // Of three the distances hang together, but by the first order alone.
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

    /// The bound of so many pairs that bring so much, the first of which are begun.
    fn bound(&self, begun: &Begun, (k, bring): (usize, f64)) -> f64 {
        // How much a pose leaves open depends on its attitude, where the noise does.
        let of_begun = begun
            .known
            .filter(LaplacePosterior::is_of_first_order)
            .map_or(f64::INFINITY, |known| self.climb.terms.ln_fraction[k] + known.ln_posterior_volume);
        bring - begun.cost + self.bounds.of_number(k).min(of_begun)
    }

    /// Looks at all sets that begin with the members and go on among `later`; whether none is likelier than the best.
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

    /// The same where a set of interest is in reach.
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

    /// With the pose of the members and what they cost under it, where they give one; the members by themselves are looked at then.
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
        // Pairs that leave the pose open are no set of interest by themselves.
        let Some((cost, known)) = fitted else { return *begun };
        self.meet(begun.gains - cost + terms.ln_fraction[count] + known.ln_posterior_volume, &known.motion);
        Begun { cost, known: Some(known), ..*begun }
    }

    fn fits(&self) -> Fits<'_> {
        Fits { terms: self.climb.terms, prior_terms: self.climb.prior_terms, members: &self.members }
    }

    /// Leaves out of the later ones from a rank on those with which the bound of all falls short. How many may be in reach of those that
    /// are left, and what these bring less what they cost.
    ///
    /// The residuals of m pairs more cost Σ_v c_v at least, c_v what one costs beside the members if these say an m-th of what
    /// they say: Σ d² = Σ_v (d_P²/m + d_v²), each no less than its own minimum.
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
                    // What has no covariance is in no set of interest.
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

    /// Meets a set that by itself has so much evidence: where it has more than the best, it or the pose that it leads to is the best from
    /// here on.
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

/// rᵀ Σ⁻¹ r.
fn distance(covariance: &Matrix3<f64>, r: &Vector3<f64>) -> f64 {
    // By the adjugate: such sums are well conditioned, and it is done for every pair that is left.
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
    /// Work without an end.
    const FREE: u64 = u64::MAX / 4;

    /// Some of the points of an object, each as far off as it is known, and clutter; the true pose, and how well each is known.
    fn scene(rng: &mut ChaCha8Rng) -> (Vec<ModelPoint>, Vec<MeasuredPoint>, Motion) {
        let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        let model: Vec<ModelPoint> = (0..POINTS).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
        let turn = Rotation3::from_scaled_axis(place(0.3)).into_inner();
        let motion = Motion { rotation: turn, translation: Vector3::new(0.0, 0.0, 3.0) + place(0.2) };
        let seen = if place(1.0).x > 0.0 { 4 } else { 5 };
        let measured = |at: Vector3<f64>, off: Vector3<f64>| {
            // Depth is known three times worse.
            let deep = Matrix3::from_diagonal(&Vector3::new(0.03, 0.03, 0.09));
            let position = UncertainPoint { at: (at + deep * off).into(), covariance: deep * deep };
            MeasuredPoint { position, pixels: None }
        };
        let mut cloud: Vec<MeasuredPoint> =
            model[..seen].iter().map(|point| measured(motion.apply(&point.at.coords), place(1.7))).collect();
        cloud.extend((0..12).map(|_| measured(motion.translation + place(1.3), Vector3::zeros())));
        (model, cloud, motion)
    }

    /// The evidence of some pairs under their own pose; `None` where they have none.
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
            // From a bad start a fit is slow; away from its end a pose is not that of the pairs, and leaves more open.
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

    /// Calls `each` with every coherent set of three pairs or more that begins with some.
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

    /// What ten pairs of an object cost beside the first four of them, and the shares of the six in that.
    ///
    /// Seen to fail where each share is what a pair costs by itself: all pay for the pose of the four.
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
            // Whatever is looked at is less likely: nothing is met.
            let other = Mode { members: Vec::new(), motion, ln_evidence: 1e9, ln_even: 1e9, ln_clutter_density: 0.0 };
            let mut prover = Prover::of(&model, (&terms, &prior_terms, &graph), &none, &other, 0);
            let begun = (0..4).fold(Begun::default(), |begun, v| prover.join(&begun, v));
            let begun = prover.fitted(&begun);
            prover.best.ln_evidence = -1e9;
            let mut level = Level { common: vec![!0 << 4 & ((1 << 10) - 1)], ..Level::default() };
            prover.leave_out(&begun, (10, 0.0), 4, &mut level).expect("four points fix a pose");
            let fractions: f64 = level.costs.iter().map(|(_, fraction)| fraction).sum();
            prover.members.extend(4..10);
            let (motion, _) = fit(&terms, &prior_terms, &prover.members, &motion, 8).expect("ten points");
            let max = prover.fits().cost(&motion) - begun.cost;
            assert!(level.costs.len() == 6 && fractions <= max + 0.01, "{fractions} of {max}");
            greatest = greatest.max(fractions / max);
        }
        assert!(greatest > 0.5, "{greatest}");
    }

    /// Of every coherent set of small problems: none has more evidence than the bound, whether the work sufficed or not, and whether the
    /// search had found the likeliest or is taken to have missed all but the least likely of what it found.
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
                    "round {round}: {} above {best} is left open",
                    reported.bound
                );
                let prover = Prover::of(&model, parts, &none, &swept.modes[0], 0);
                coherent(&graph, &mut Vec::new(), &mut |set| {
                    sets += 1;
                    // Whatever its pose.
                    let gains: f64 = set.iter().map(|&v| terms.pairs[v].gain).sum();
                    if gains + terms.ln_fraction[set.len()] > reported.bound {
                        let max = evidence(&prover, set).unwrap_or(f64::NEG_INFINITY);
                        assert!(
                            max <= reported.bound + 0.01,
                            "round {round}: {set:?} has {max}, bound {}",
                            reported.bound
                        );
                    }
                });
            }
        }
        assert!(sets > 100 * rounds && 3 * proved > rounds && 5 * open > rounds, "{sets}, {proved}, {open}");
        assert!(10 * found_again > rounds, "{found_again}");
    }

    /// Seen to fail where members cost twice what they do, where what another costs is not spread by what their pose leaves open, where
    /// their posterior fills less, and where bounds that prune are taken for bounds that hold.
    #[test]
    fn no_coherent_set_is_more_probable_than_the_bound() {
        // Each problem takes 0.1 s: forty, or as many as `PROPTEST_CASES` asks for beyond them.
        let asked = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok());
        compare(asked.unwrap_or(0).max(40));
    }

    /// The long form: `cargo test --release -p seafix-referencing --lib -- --ignored more_probable`.
    ///
    /// Seen to fail where what one step foretells is taken for the end of a fit (its 7435th problem), and where a set whose fit is slow
    /// is passed over (the 13 623rd).
    #[test]
    #[ignore = "20 000 problems; some minutes"]
    fn no_coherent_set_of_many_problems_is_more_probable_than_the_bound() {
        compare(20_000);
    }
}
