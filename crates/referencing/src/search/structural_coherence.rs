//! Structural coherence: the paper's search, in the paper's order.

use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    association::vertices,
    grow::so_far,
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, NEEDED},
    orientation::{mirrored, quadruples, wholly_mirrored},
};
use crate::problem::{Correspondence, Problem};

/// The kind of samples of q model points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Samples {
    /// The paper's ordered samples A_n^q: each set of points q! times.
    #[default]
    Permutations,
    /// Each set of points once.
    Combinations,
}

/// The paper's Stage 2: enumeration of ordered samples, the longest first.
///
/// For q from n down to 3, for each sample of q model points in lexicographic order, for each choice of one candidate a
/// point, all q(q − 1)/2 distances are compared. The first sample whose distances all agree is the answer.
///
/// There are Σ_q n!/(n − q)! m^q choices of m candidates a point, with combinations q! times fewer. The answer is
/// exact, but its cost is prohibitive beyond some ten points: the budget ends the search, and the rejection states the
/// best set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct StructuralCoherence {
    /// Kind of samples.
    pub samples: Samples,
    /// Whether mirror images are rejected; `false` compares distances only, as in the paper.
    pub orientation: bool,
    /// Maximum number of pair tests.
    pub budget: u64,
}

impl Default for StructuralCoherence {
    fn default() -> Self {
        Self { samples: Samples::default(), orientation: true, budget: BUDGET }
    }
}

impl Component for StructuralCoherence {
    const NAME: &'static str = "structural-coherence";
    const SUMMARY: &'static str = "the enumeration of ordered samples of Bobkov et al. 2021, longest first";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of \
                                  autonomous underwater vehicles to man-made objects using stereo images, 2021, Sec. 2.2";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the number of model points in the first coherent sample, longest samples first, candidates from the gates",
        ),
        ("exact", "within its budget, for coherence alone"),
        ("time", "Σ_q n!/(n − q)! m^q choices of m candidates a point; with combinations q! times fewer"),
    ];

    fn check(&self) -> Result<(), String> {
        in_range(self.budget > 0, "budget", self.budget, "1 or more pair tests")
    }
}

impl Search for StructuralCoherence {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        let with_candidates = problem.candidates.with_candidates();
        if with_candidates < NEEDED {
            return Err(Rejected::TooFew { with_candidates, needed: NEEDED });
        }
        // Sorted by coordinates: the answer does not depend on the order of the points. A model point without
        // candidates contributes no choice: skipping it changes no answer.
        let vertices = vertices(problem);
        let choices: Vec<usize> = vertices.iter().map(|pair| pair.cloud).collect();
        let mut lists = Vec::new();
        let mut rest = choices.as_slice();
        for same in vertices.chunk_by(|a, b| a.model == b.model) {
            let (list, later) = rest.split_at(same.len());
            lists.push((same[0].model, list));
            rest = later;
        }
        Enumeration::of(problem, lists, self.samples, self.orientation, self.budget).run(with_candidates)
    }
}

/// The budget is spent.
struct Spent;

/// The result of a sample's choices.
enum Product {
    /// The first coherent choice.
    Coherent(Vec<Correspondence>),
    /// No coherent choice; no point after this place of the sample was examined.
    Rejected { deepest: usize },
}

/// The rejection of all samples that begin with the same points.
struct RejectedSamples {
    /// The last of these points; no later one is examined.
    deepest: usize,
    /// Cost for one choice of candidates of the later points: pair tests, and sampling.
    pair_tests: u64,
    sampled: u64,
}

/// Divisor of the cost of a sample: a sample of q points costs q²/256 pair tests. That is nothing at the paper's scale,
/// but exceeds the tests among hundreds of points, the first two of which usually disagree.
const DRAWING: u64 = 256;

/// Samples of model points, longest first, with the choices of one candidate each.
pub(super) struct Enumeration<'a> {
    problem: &'a Problem<'a>,
    /// Model points and their candidates.
    lists: Vec<(usize, &'a [usize])>,
    samples: Samples,
    orientation: bool,
    budget: u64,
    pair_tests: u64,
    /// Cost of sampling so far, in pair tests.
    sampled: u64,
    /// Size of the largest coherent set so far, as the beginning of a longer sample.
    best: usize,
    /// Size of the first, hence largest, coherent sample that was entirely a mirror image.
    mirrored: Option<usize>,
}

impl<'a> Enumeration<'a> {
    pub(super) fn of(
        problem: &'a Problem<'a>,
        lists: Vec<(usize, &'a [usize])>,
        samples: Samples,
        orientation: bool,
        budget: u64,
    ) -> Self {
        Self { problem, lists, samples, orientation, budget, pair_tests: 0, sampled: 0, best: 0, mirrored: None }
    }

    /// The first coherent sample of at most `longest` points.
    pub(super) fn run(mut self, longest: usize) -> Result<Identification, Rejected> {
        for q in (NEEDED..=self.lists.len().min(longest)).rev() {
            match self.samples_of(q) {
                // Three points have no orientation: they are the remainder of a mirror image.
                Ok(Some(_)) if q == NEEDED && self.mirrored.is_some() => {
                    return Err(Rejected::Mirrored { best: self.mirrored.unwrap_or(q), proved: true });
                }
                Ok(Some(mut pairs)) => {
                    pairs.sort_unstable();
                    // A longer sample was a mirror image: its remainder is no fix.
                    let undecided = self.mirrored.map(|best| Rejected::Mirrored { best, proved: false });
                    return Ok(Identification {
                        optimal: true,
                        undecided,
                        posterior: None,
                        ..Identification::unproved(pairs, q, self.pair_tests)
                    });
                }
                Ok(None) => {}
                Err(Spent) => {
                    let (budget, best) = (self.budget, self.best);
                    let ended = Rejected::Budget { budget, best, bound: q, pair_tests: self.pair_tests };
                    return so_far(self.problem, self.orientation, ended);
                }
            }
        }
        // Two points that agree but begin no sample of three were not met.
        if self.best < 2 && self.lists.len() >= 2 {
            match self.samples_of(2) {
                Ok(Some(_)) => self.best = 2,
                Ok(None) => {}
                Err(Spent) => {
                    let (budget, best) = (self.budget, self.best);
                    return Err(Rejected::Budget { budget, best, bound: 2, pair_tests: self.pair_tests });
                }
            }
        }
        Err(Rejected::NoConsensus { best: self.best, needed: NEEDED })
    }

    /// The first coherent choice of candidates among the samples of length `q`.
    fn samples_of(&mut self, q: usize) -> Result<Option<Vec<Correspondence>>, Spent> {
        let mut sample: Vec<usize> = (0..q).collect();
        loop {
            let (pair_tests, sampled) = (self.pair_tests, self.sampled);
            let deepest = match self.product_of(&sample)? {
                Product::Coherent(found) => return Ok(Some(found)),
                Product::Rejected { deepest } => deepest,
            };
            // All later samples with the same beginning fail the same tests: they are counted without being made.
            let after = self.choices(&sample[deepest + 1..]);
            let fraction = |spent: u64| (u128::from(spent) / after) as u64;
            let rejected = RejectedSamples {
                deepest,
                pair_tests: fraction(self.pair_tests - pair_tests),
                sampled: fraction(self.sampled - sampled),
            };
            self.pass_over(&rejected, &mut sample)?;
            if !self.next(&mut sample, deepest) {
                return Ok(None);
            }
        }
    }

    /// The first coherent choice of one candidate for each of these model points.
    ///
    /// If a candidate disagrees with an earlier choice, so does every choice with the same beginning, after as many
    /// tests: these are counted together.
    fn product_of(&mut self, sample: &[usize]) -> Result<Product, Spent> {
        let q = sample.len();
        let mut after = vec![1_u128; q];
        for place in (0..q - 1).rev() {
            after[place] = after[place + 1].saturating_mul(self.lists[sample[place + 1]].1.len() as u128);
        }
        let mut choice = vec![0; q];
        let mut pairs: Vec<Correspondence> = Vec::with_capacity(q);
        let mut deepest = 0;
        loop {
            let place = pairs.len();
            let (model, list) = self.lists[sample[place]];
            let next = Correspondence { model, cloud: list[choice[place]] };
            deepest = deepest.max(place);
            match pairs.iter().position(|&before| !self.problem.coherent(next, before)) {
                Some(before) => self.count(q, all_pairs(place) + before as u64 + 1, after[place], place)?,
                None => pairs.push(next),
            }
            if pairs.len() == q {
                self.count(q, all_pairs(q), 1, q)?;
                if self.upright(&pairs)? {
                    return Ok(Product::Coherent(pairs));
                }
                pairs.pop();
            } else if pairs.len() > place {
                choice[place + 1] = 0;
                continue;
            }
            // The last point's candidate changes fastest.
            loop {
                let place = pairs.len();
                choice[place] += 1;
                if choice[place] < self.lists[sample[place]].1.len() {
                    break;
                }
                if pairs.pop().is_none() {
                    return Ok(Product::Rejected { deepest });
                }
            }
        }
    }

    /// Counts `choices` that each end after `pair_tests`.
    ///
    /// They belong to a sample of `q` points, the first `agree` of which were in agreement.
    fn count(&mut self, q: usize, pair_tests: u64, choices: u128, agree: usize) -> Result<(), Spent> {
        let drawing = (q * q) as u64 / DRAWING;
        let full = u128::from(self.left() / (drawing + pair_tests)).min(choices);
        // At most the budget.
        self.pair_tests += full as u64 * pair_tests;
        self.sampled += full as u64 * drawing;
        if full > 0 {
            self.best = self.best.max(agree);
        }
        if full == choices {
            return Ok(());
        }
        // The budget ends in the next choice.
        self.sampled += drawing;
        let last = self.left();
        self.pair_tests += last;
        let agreed = (1..=q).take_while(|&points| all_pairs(points) <= last).last();
        self.best = self.best.max(agreed.unwrap_or(0));
        Err(Spent)
    }

    /// The remaining budget.
    fn left(&self) -> u64 {
        self.budget.saturating_sub(self.pair_tests + self.sampled)
    }

    /// Whether no four of the pairs, which agree in all distances, are mirrored.
    fn upright(&mut self, pairs: &[Correspondence]) -> Result<bool, Spent> {
        if !self.orientation {
            return Ok(true);
        }
        for four in quadruples(pairs) {
            if self.left() == 0 {
                return Err(Spent);
            }
            self.pair_tests += 1;
            if mirrored(self.problem, four) {
                if self.mirrored.is_none() && wholly_mirrored(self.problem, pairs) {
                    self.mirrored = Some(pairs.len());
                }
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Counts the later samples with the same beginning, up to the deepest place examined.
    ///
    /// They are not examined, except the one in which the budget ends.
    fn pass_over(&mut self, rejected: &RejectedSamples, sample: &mut [usize]) -> Result<(), Spent> {
        if rejected.deepest + 1 == sample.len() {
            return Ok(());
        }
        // This sample is already counted among those that begin like it up to `place`.
        let (mut place, mut counted) = (rejected.deepest, self.choices(&sample[rejected.deepest + 1..]));
        let each = u128::from(rejected.pair_tests + rejected.sampled);
        loop {
            let left = u128::from(self.left());
            let more = self.continuations(sample, place, left.saturating_add(counted));
            let choices = more.saturating_mul(self.choices(&sample[rejected.deepest + 1..=place])) - counted;
            if choices.saturating_mul(each) <= left {
                self.pair_tests += choices as u64 * rejected.pair_tests;
                self.sampled += choices as u64 * rejected.sampled;
                if place == rejected.deepest {
                    return Ok(());
                }
                self.next(sample, place);
                counted = 0;
            } else if place + 1 < sample.len() {
                place += 1;
            } else {
                return self.product_of(sample).map(|_| ());
            }
        }
    }

    /// The number of choices of one candidate for each of these model points.
    fn choices(&self, sample: &[usize]) -> u128 {
        sample.iter().fold(1, |product, &place| product.saturating_mul(self.lists[place].1.len() as u128))
    }

    /// The number of choices of candidates after `place` in all samples with the same beginning: the sum of products
    /// over these samples. Exact up to `max`, and otherwise greater than `max`.
    fn continuations(&self, sample: &[usize], place: usize, max: u128) -> u128 {
        let (begun, q) = (&sample[..=place], sample.len() - place - 1);
        let follows = |point: &usize| match self.samples {
            Samples::Combinations => *point > begun[place],
            Samples::Permutations => !begun.contains(point),
        };
        let rest = (0..self.lists.len()).filter(follows).map(|point| self.lists[point].1.len() as u128);
        let rest: Vec<u128> = rest.collect();
        let sets = products(&rest, q, max);
        match self.samples {
            Samples::Combinations => sets,
            Samples::Permutations => (1..=q as u128).fold(sets, u128::saturating_mul),
        }
    }

    /// The next sample that differs at `place` or before; false after the last.
    fn next(&self, sample: &mut [usize], place: usize) -> bool {
        match self.samples {
            Samples::Combinations => next_combination(sample, place, self.lists.len()),
            Samples::Permutations => next_arrangement(sample, place, self.lists.len()),
        }
    }
}

/// The number of pairs of n points.
fn all_pairs(points: usize) -> u64 {
    (points * points.saturating_sub(1) / 2) as u64
}

/// The elementary symmetric polynomial: the sum of the products of all subsets of `k` of these positive numbers.
///
/// Exact up to `max`, and otherwise greater than `max`.
fn products(numbers: &[u128], k: usize, max: u128) -> u128 {
    let n = numbers.len();
    // The number of subsets is a lower bound: if it exceeds `max`, no sum is needed.
    let mut subsets = 1_u128;
    for i in 0..k.min(n - k) {
        subsets = subsets.saturating_mul((n - i) as u128) / (i as u128 + 1);
        if subsets > max {
            return u128::MAX;
        }
    }
    let mut sums = vec![0_u128; k + 1];
    sums[0] = 1;
    for (i, number) in numbers.iter().enumerate() {
        // Smaller subsets could no longer grow to k numbers.
        let min = (k + i + 1).saturating_sub(n).max(1);
        for size in (min..=k.min(i + 1)).rev() {
            sums[size] = sums[size].saturating_add(sums[size - 1].saturating_mul(*number));
        }
    }
    sums[k]
}

/// The next subset of `0..n` in lexicographic order that differs at `place` or before; false after the last.
fn next_combination(sample: &mut [usize], place: usize, n: usize) -> bool {
    let q = sample.len();
    let Some(place) = (0..=place).rev().find(|&place| sample[place] < n - q + place) else { return false };
    sample[place] += 1;
    for later in place + 1..q {
        sample[later] = sample[later - 1] + 1;
    }
    true
}

/// The next ordered sample of `0..n` without repetition that differs at `place` or before; false after the last.
///
/// The order is lexicographic.
fn next_arrangement(sample: &mut [usize], place: usize, n: usize) -> bool {
    for place in (0..=place).rev() {
        let next = (sample[place] + 1..n).find(|value| !sample[..place].contains(value));
        if let Some(value) = next {
            sample[place] = value;
            for later in place + 1..sample.len() {
                let min = (0..n).find(|value| !sample[..later].contains(value));
                sample[later] = min.expect("a sample is not longer than its population");
            }
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests;
