//! Best-first enumeration of the coherent triples that may lead to a pose of interest.

mod elsewhere;
pub(in crate::search) mod guided;
mod queue;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::{
    bits::{Held, intersect, is_set, ones, shared},
    bound::{After, Bounds},
    distance_residual::{Side, lost_to, residual_of_three},
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms},
    local_maxima::Climb,
    motion::Motion,
    prior_terms::PriorTerms,
};
use crate::{lanes::ones_of, site::model::ModelPoint};
use queue::Pair;
use queue::{Queue, order};

/// Evidence (nats) below the best at which a pose is not searched for.
pub(in crate::search) const MARGIN: f64 = 10.0;
/// Gate (standard deviations of a pair) about the pose of three noisy points.
const LOOSE: f64 = 3.5;
/// Number of modes that a new triple is compared with before it is followed.
const COMPARED: usize = 16;
/// Approximate number of vertices at which pairs are counted.
const COUNTED: usize = 256;
/// Maximum number of modes kept.
const KEPT: usize = 256;
/// Maximum numbers of pairs to follow, and of pairs that lead to parts of sets (12 bytes each).
const MAX_PAIRS: usize = 8_000_000;
const MAX_PARTS: usize = 2_000_000;
/// Costs, in words read: a pose from three points, the ascent to its mode, each pair compared during the ascent.
const COST_OF_A_POSE: u64 = 16;
const COST_OF_A_MODE: u64 = 64;
const COST_OF_A_PAIR: u64 = 4;

/// The result of a search for modes.
pub(in crate::search) struct Swept {
    /// The modes, the best first.
    pub(in crate::search) modes: Vec<Mode>,
    /// Whether every triple that could lead to a pose of interest was followed.
    pub(in crate::search) complete: bool,
    /// The pairs that remained to be followed when all were known, each with the bound of its sets.
    pub(in crate::search) pairs: Vec<Pair>,
    /// The threshold (nats) of these bounds.
    pub(in crate::search) looked_for: f64,
    /// Whether every triple was examined and followed that could lead to a part of a set.
    pub(in crate::search) parts: bool,
    /// Work done.
    pub(in crate::search) pair_tests: u64,
}

impl Swept {
    /// The result where there is nothing to search.
    pub(in crate::search) fn nothing() -> Self {
        Self { modes: Vec::new(), complete: true, pairs: Vec::new(), looked_for: 0.0, parts: true, pair_tests: 0 }
    }

    /// Adds modes found later; they replace known modes of the same members.
    pub(in crate::search) fn insert(&mut self, modes: Vec<Mode>) {
        for mode in modes {
            self.modes.retain(|known| known.members != mode.members || known.edges != mode.edges);
            insert(&mut self.modes, mode);
        }
    }
}

/// Inserts a mode in order, unless it is known.
fn insert(modes: &mut Vec<Mode>, mode: Mode) {
    if modes.iter().any(|known| known.members == mode.members && known.edges == mode.edges) {
        return;
    }
    let place = modes.partition_point(|known| known.by_evidence(&mode).is_lt());
    modes.insert(place, mode);
    modes.truncate(KEPT);
}

/// The limits of the search for parts: sets of fewer pairs than the complete object.
struct Parts {
    /// Number of pairs from which a set is no part.
    full: usize,
    /// Decimation factor of the pairs that lead only to parts.
    every: usize,
    /// Maximum work on parts once all pairs are known, and the total work at which it ends.
    follow: u64,
    until: u64,
    /// Whether pairs were dropped for lack of memory.
    dropped: bool,
}

impl Parts {
    /// No parts, and no limits.
    fn none(min: usize) -> Self {
        Self { full: min, every: 1, follow: u64::MAX, until: u64::MAX, dropped: false }
    }
}

/// Best-first branch and bound over the coherent triples (a, b, c).
///
/// Every set is visited at its first three members in the order of the graph. Its other members are later common
/// neighbours of these, so that the model points among the later common neighbours bound its evidence ([`Bounds`]).
/// Pairs (a, b) are followed in descending order of their bound, down to the threshold of interest.
pub(in crate::search) struct Seeds<'a> {
    climb: Climb<'a>,
    bounds: Bounds<'a>,
    budget: u64,
    parts: Parts,
    /// Work done: words read, or equivalent.
    spent: u64,
    /// The modes, the best first.
    modes: Vec<Mode>,
    /// Minimum evidence (nats) of a pose.
    floor: f64,
    /// Greatest bound of a pair followed early.
    scouted: f64,
    /// The vertices of the search, one bit each.
    free: Vec<u64>,
    /// The free neighbours of one vertex, and of two.
    row: Vec<u64>,
    common: Vec<u64>,
    /// The members of the best modes that hold both vertices of a pair.
    again: Vec<u64>,
    /// Memory: free neighbours of one or two vertices, choices after each model point, neighbours of three.
    held: Vec<Held>,
    after: Vec<After>,
    of_three: Vec<usize>,
    /// The current set, and the sets from which an ascent started: they would lead to the same mode again.
    members: Vec<usize>,
    climbed: BTreeSet<Vec<usize>>,
    /// Maximum work of guided seeds; none without.
    guided: u64,
    /// Whether the guided seeds suffice.
    sampled: bool,
}

impl<'a> Seeds<'a> {
    /// A search over the vertices whose cloud point is not `taken`.
    ///
    /// Sets have at least `min` pairs and the evidence `floor` (nats).
    pub(in crate::search) fn new(
        model: &'a [ModelPoint],
        (terms, prior_terms, graph): (&'a PairTerms, &'a PriorTerms, &'a ConsistencyGraph),
        taken: &'a BTreeSet<usize>,
        (min, floor): (usize, f64),
        budget: u64,
    ) -> Self {
        let words = graph.vertices.len().div_ceil(64);
        let mut free = vec![0; words];
        let untaken = |v: &usize| !taken.contains(&graph.vertices[*v].cloud);
        (0..graph.vertices.len()).filter(untaken).for_each(|v| free[v / 64] |= 1 << (v % 64));
        Self {
            climb: Climb::new(model, (terms, prior_terms, graph), taken),
            bounds: Bounds::of((terms, prior_terms, graph), min),
            budget,
            parts: Parts::none(min),
            spent: 0,
            modes: Vec::new(),
            floor,
            scouted: f64::NEG_INFINITY,
            free,
            row: vec![0; words],
            common: vec![0; words],
            again: vec![0; words],
            held: Vec::new(),
            after: Vec::new(),
            of_three: Vec::new(),
            members: Vec::new(),
            climbed: BTreeSet::new(),
            guided: 0,
            sampled: false,
        }
    }

    /// Minimum evidence of interest.
    fn threshold(&self) -> f64 {
        let best = self.modes.first().map_or(f64::NEG_INFINITY, |mode| mode.ln_evidence);
        (best - MARGIN).max(self.floor)
    }

    pub(in crate::search) fn sweep(mut self) -> Swept {
        let found = self.guide();
        let (full_sets, parts, complete) = self.pairs();
        let until = self.spent.saturating_add(self.parts.follow);
        self.parts.until = until;
        let looked_for = self.threshold();
        let (pairs, followed) = self.follow_all(full_sets, self.budget);
        let complete = found || followed && complete || self.guide_the_rest();
        let followed = self.follow_all(parts, until).1 && self.spent <= until;
        let parts = followed && self.parts.every == 1 && !self.parts.dropped;
        Swept { modes: self.modes, complete, pairs, looked_for, parts, pair_tests: self.spent }
    }

    /// Follows the pairs in descending order of their bound until the work exceeds `max`. Returns the pairs, and
    /// whether all were followed.
    fn follow_all(&mut self, mut pairs: Vec<Pair>, max: u64) -> (Vec<Pair>, bool) {
        pairs.retain(|(bound, ..)| f64::from(*bound) >= self.threshold());
        let mut queue = Queue::of(pairs);
        while let Some((bound, a, b)) = queue.next() {
            if f64::from(bound) < self.threshold() {
                break;
            }
            if self.spent > max {
                return (queue.into_pairs(), false);
            }
            if self.spent > self.parts.until {
                self.bounds.min = self.parts.full;
            }
            self.follow_pair(a as usize, b as usize);
        }
        (queue.into_pairs(), true)
    }

    /// Adds the search for parts: sets of fewer than `full` pairs.
    ///
    /// The pairs that lead only to parts are decimated evenly to fit into the work `limit`, so that a part to which
    /// many of them lead is found all the same. Once all are known they are followed with at most the work `follow`,
    /// after the pairs that lead to complete sets. Both come on top of the budget.
    pub(in crate::search) fn with_parts(mut self, full: usize, limit: u64, follow: u64) -> Self {
        let graph = self.climb.graph;
        let some = (graph.vertices.len() / COUNTED).max(1);
        let edges: usize = ones(&self.free, 0).step_by(some).map(|a| some * shared(graph.row(a), &self.free, a)).sum();
        // Rows are read from the second vertex of a pair on: a third of them on average.
        let cost = edges as u64 * self.row.len() as u64 / 3;
        let every = cost.div_ceil(limit.max(1)).max(1) as usize;
        self.budget = self.budget.saturating_add(cost / every as u64).saturating_add(follow);
        self.parts = Parts { full, every, follow, ..self.parts };
        self
    }

    /// The pairs (a, b) that may begin a set of interest.
    ///
    /// Returns the pairs, the pairs that may only begin a part, and whether they are complete.
    fn pairs(&mut self) -> (Vec<Pair>, Vec<Pair>, bool) {
        let graph = self.climb.graph;
        let ranks = graph.starts.len() - 1;
        let (mut pairs, mut parts): (Vec<Pair>, Vec<Pair>) = (Vec::new(), Vec::new());
        let (mut begin, mut complete) = (0, true);
        for a in 0..graph.vertices.len() {
            if a > 0 && graph.rank[a] != graph.rank[a - 1] {
                self.scout(&pairs[begin..]);
                begin = pairs.len();
            }
            if self.free[a / 64] >> (a % 64) & 1 == 0 {
                continue;
            }
            let (rank, own) = (graph.rank[a] as usize, self.bounds.gain(a));
            self.spent += self.row.len() as u64;
            let count = intersect(graph.row(a), &self.free, &graph.lasts, 0, &mut self.row);
            let threshold = self.threshold();
            let asked = (self.bounds.min, threshold);
            let (max, bound) = self.bounds.with_common((1, own), (&self.row, count), rank + 1, asked);
            if bound < threshold {
                continue;
            }
            let leads_to_full = max >= self.parts.full;
            Held::list(&self.row, graph.starts[rank + 1], &mut self.held);
            self.bounds.list(&self.held, &mut self.after);
            for b in self.held.iter().flat_map(Held::ones) {
                let chosen = (a + b).is_multiple_of(self.parts.every);
                if !chosen && !leads_to_full {
                    continue;
                }
                let min = if chosen { self.bounds.min } else { self.parts.full };
                let gains = own + self.bounds.gain(b);
                let next = graph.rank[b] as usize + 1;
                if self.bounds.reach(2, gains, ranks - next) < threshold {
                    continue;
                }
                let asked = (min, threshold);
                self.spent += words_from(graph, next);
                if self.bounds.falls_short((2, gains), self.after[next - 1], asked) {
                    continue;
                }
                let count = intersect(&self.row, graph.row(b), &graph.lasts, graph.starts[next], &mut self.common);
                let (max, bound) = self.bounds.with_common((2, gains), (&self.common, count), next, asked);
                if bound >= threshold {
                    // Rounded up, so that it remains an upper bound.
                    let pair = ((bound as f32).next_up(), a as u32, b as u32);
                    if max >= self.parts.full { pairs.push(pair) } else { parts.push(pair) }
                }
            }
            if parts.len() > MAX_PARTS {
                // The pairs with the smallest bounds would hardly be followed.
                parts.select_nth_unstable_by_key(MAX_PARTS / 2, order);
                parts.truncate(MAX_PARTS / 2);
                self.parts.dropped = true;
            }
            if self.spent > self.budget || pairs.len() > MAX_PAIRS {
                complete = false;
                break;
            }
        }
        (pairs, parts, complete)
    }

    /// Follows the most promising pair of one model point at once: a good pose known early prunes the rest.
    fn scout(&mut self, pairs: &[Pair]) {
        let Some(&(bound, a, b)) = pairs.iter().min_by_key(|pair| order(pair)) else { return };
        if f64::from(bound) > self.scouted {
            self.scouted = f64::from(bound);
            self.follow_pair(a as usize, b as usize);
        }
    }

    fn follow_pair(&mut self, a: usize, b: usize) {
        let Climb { graph, terms, .. } = self.climb;
        let next = graph.rank[b] as usize + 1;
        self.spent += words_from(graph, next);
        intersect(graph.row(a), graph.row(b), &graph.lasts, graph.starts[next], &mut self.common);
        self.common.iter_mut().zip(&self.free).for_each(|(word, free)| *word &= free);
        let (mut common, mut later) = (std::mem::take(&mut self.held), std::mem::take(&mut self.after));
        Held::list(&self.common, graph.starts[next], &mut common);
        self.bounds.list(&common, &mut later);
        // Three members of a mode lead to it again.
        let likely = self.modes.iter().take(COMPARED).filter(|mode| mode.holds(a) && mode.holds(b));
        self.again.fill(0);
        likely.flat_map(|mode| &mode.members).for_each(|&v| self.again[v / 64] |= 1 << (v % 64));
        let gains = self.bounds.gain(a) + self.bounds.gain(b);
        let (first, second) = (&terms.pairs[a], &terms.pairs[b]);
        let side = Side::of(first, second);
        for (place, held) in common.iter().enumerate() {
            for c in held.ones() {
                if is_set(&self.again, c) {
                    continue;
                }
                let rank = graph.rank[c] as usize;
                let gains = gains + self.bounds.gain(c);
                self.spent += words_from(graph, rank + 1);
                let threshold = self.threshold();
                if self.bounds.falls_short((3, gains), later[rank], (self.bounds.min, threshold)) {
                    continue;
                }
                // The pairs of one model point may continue in the next words.
                let (row, from) = (graph.row(c), graph.starts[rank + 1]);
                let after = &common[place..];
                let enough = |gains| self.bounds.is_enough((3, gains), (&self.common, after), (row, from), threshold);
                if !enough(gains) {
                    continue;
                }
                let third = &terms.pairs[c];
                let sides = [&side, &Side::of(first, third), &Side::of(second, third)];
                let lost = lost_to(residual_of_three([first, second, third], sides));
                if (lost == 0.0 || enough(gains - lost)) && !self.known([a, b, c]) {
                    self.of_three.clear();
                    self.of_three.extend(after.iter().flat_map(|held| ones_of(held.begin(), held.and(row, from))));
                    self.follow([a, b, c], lost);
                }
            }
        }
        (self.held, self.after) = (common, later);
    }

    /// Whether one of the best modes holds all three.
    fn known(&self, three: [usize; 3]) -> bool {
        self.modes.iter().take(COMPARED).any(|mode| three.iter().all(|&v| mode.holds(v)))
    }

    /// Follows a triple with the distance residual `lost` (nats): its pose, the pairs within the gate, their mode.
    fn follow(&mut self, three: [usize; 3], lost: f64) {
        self.spent += COST_OF_A_POSE;
        let Climb { terms, graph, .. } = self.climb;
        let model = three.map(|v| &terms.pairs[v].model);
        let Some(motion) = Motion::of_three(model, three.map(|v| &terms.pairs[v].cloud)) else { return };
        let centre: Vector3<f64> = (model[0] + model[1] + model[2]) / 3.0;
        let altitude = altitude(model);
        let mut members = std::mem::take(&mut self.members);
        members.clear();
        members.extend(three);
        let mut gains = three.iter().map(|&v| self.bounds.gain(v)).sum::<f64>() - lost;
        // Rank and distance of the last member.
        let mut last = (usize::MAX, 0.0);
        for &v in &self.of_three {
            // The errors of the three points grow with the lever.
            let pair = &terms.pairs[v];
            let lever = 1.0 + (pair.model - centre).norm() / altitude;
            let d2 = pair.distance(&(pair.cloud - motion.apply(&pair.model))) / (lever * lever);
            let rank = graph.rank[v] as usize;
            let again = last.0 == rank;
            if d2 > LOOSE * LOOSE || (again && last.1 <= d2) {
                continue;
            }
            if again {
                members.pop();
            } else {
                gains += self.bounds.gain_of_rank(rank);
            }
            members.push(v);
            last = (rank, d2);
        }
        self.spent += 4 * members.len() as u64;
        if self.bounds.of_set(members.len(), gains) >= self.threshold() {
            self.spent += COST_OF_A_MODE;
            let threshold = self.threshold();
            let climbed = |set: &[usize]| !self.climbed.insert(set.to_vec());
            if let Some(mode) = self.climb.from(&members, &motion, threshold, climbed) {
                self.keep(mode);
            }
            self.spent += COST_OF_A_PAIR * self.climb.compared.take();
        }
        self.members = members;
    }

    fn keep(&mut self, mode: Mode) {
        if mode.members.len() >= self.bounds.min && mode.ln_evidence >= self.threshold() {
            insert(&mut self.modes, mode);
        }
    }
}

/// Words of a row from a rank on.
fn words_from(graph: &ConsistencyGraph, rank: usize) -> u64 {
    (graph.lasts.len().saturating_sub(graph.starts[rank] / 64) + 1) as u64
}

/// The minimum altitude of a triangle (m).
fn altitude([a, b, c]: [&Vector3<f64>; 3]) -> f64 {
    let area = (b - a).cross(&(c - a)).norm();
    let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
    (area / longest).max(1e-9)
}
