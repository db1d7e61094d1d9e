//! Upper bounds of the evidence of a set, from the common neighbours of its first members.

use super::{
    bits::{Held, each_held, groups, shared},
    graph::ConsistencyGraph,
    likelihood::PairTerms,
    prior_terms::PriorTerms,
};

/// Allowance (nats) for a set whose information is below that of as many average points.
const SLACK: f64 = 3.0;
/// Maximum residual cost (nats) assumed by the pruning bounds.
///
/// The residuals of larger sets cost more. But among twenty true pairs some two differ by more than the tolerance, and
/// a bound by common neighbours does not see that. With the full cost, the pose of 26 pairs is lost to another of 23 in
/// one of 252 frames of a self-similar model; with six nats, one pair of twelve is lost in one of 252 frames of fifty
/// points.
const DISTORTION: f64 = 4.0;
/// Relative rounding error of a sum.
const ROUNDING: f64 = 1e-12;

/// The choices after a model point of a set: their number and their maximum contribution.
#[derive(Clone, Copy, Default)]
pub(in crate::search) struct After {
    more: u32,
    bring: f64,
}

impl After {
    /// The total number and contribution, with the pairs before.
    pub(in crate::search) fn with(&self, (k, gains): (usize, f64)) -> (usize, f64) {
        (k + self.more as usize, gains + self.bring)
    }
}

/// Upper bounds of the evidence of sets.
///
/// A set has one pair for each model point, with at most that point's greatest gain, the probability B(k) of its
/// number, and the posterior volume of k average points, less the residual cost of k true pairs. The bound grows with
/// every model point that may join.
pub(in crate::search) struct Bounds<'a> {
    graph: &'a ConsistencyGraph,
    terms: &'a PairTerms,
    /// Greatest gain of each model point by rank, at least `grows`.
    top: Vec<f64>,
    /// Minimum gain of a pair for which the bound still grows.
    grows: f64,
    /// Greatest gain of all model points.
    greatest: f64,
    /// Whether every model point has one candidate; pairs are then counted instead of model points.
    single: bool,
    /// The term added to the gains of k pairs.
    of_number: Vec<f64>,
    /// Minimum size of a set of interest.
    pub(in crate::search) min: usize,
}

impl<'a> Bounds<'a> {
    /// Pruning bounds, from the properties of average sets.
    pub(in crate::search) fn of(
        (terms, prior_terms, graph): (&'a PairTerms, &PriorTerms, &'a ConsistencyGraph),
        min: usize,
    ) -> Self {
        let of_number =
            |k: usize| terms.ln_fraction[k] + prior_terms.ln_peak + terms.ln_volume[k] + SLACK - distortion(k);
        Self::with((terms, graph), min, of_number)
    }

    /// Strict bounds, from upper bounds of the posterior volumes.
    ///
    /// `ln_posterior_volume` (k) is an upper bound of the log posterior volume of k pairs relative to the prior.
    pub(in crate::search) fn proved(
        (terms, graph): (&'a PairTerms, &'a ConsistencyGraph),
        ln_posterior_volume: &[f64],
    ) -> Self {
        let mut bounds = Self::with((terms, graph), 0, |k| terms.ln_fraction[k] + ln_posterior_volume[k]);
        // A smaller set may exceed a larger one that contains it by its volume: the bound covers both.
        for k in 1..bounds.of_number.len() {
            bounds.of_number[k] = bounds.of_number[k].max(bounds.of_number[k - 1] - bounds.grows);
        }
        bounds
    }

    fn with(
        (terms, graph): (&'a PairTerms, &'a ConsistencyGraph),
        min: usize,
        of_number: impl Fn(usize) -> f64,
    ) -> Self {
        let ranks = graph.starts.len() - 1;
        let grows = libm::log(terms.ln_fraction.len() as f64) + 1.0;
        let of_rank = |i: usize| &terms.pairs[graph.starts[i]..graph.starts[i + 1]];
        let top: Vec<f64> = (0..ranks).map(|i| of_rank(i).iter().map(|pair| pair.gain).fold(grows, f64::max)).collect();
        Self {
            graph,
            terms,
            grows,
            greatest: top.iter().copied().fold(grows, f64::max),
            single: graph.vertices.len() == ranks,
            top,
            min,
            of_number: (0..=ranks).map(of_number).collect(),
        }
    }

    /// The contribution of a model point with a pair of this gain.
    pub(in crate::search) fn brings(&self, gain: f64) -> f64 {
        gain.max(self.grows)
    }

    /// The maximum contribution of one pair.
    pub(in crate::search) fn gain(&self, v: usize) -> f64 {
        self.brings(self.terms.pairs[v].gain)
    }

    /// The maximum contribution of each model point, by rank.
    pub(in crate::search) fn tops(&self) -> &[f64] {
        &self.top
    }

    /// The maximum contribution of a model point.
    pub(in crate::search) fn gain_of_rank(&self, rank: usize) -> f64 {
        self.top[rank]
    }

    /// The term added to the gains of `k` pairs.
    pub(in crate::search) fn of_number(&self, k: usize) -> f64 {
        self.of_number[k]
    }

    /// The maximum excess (nats) of these bounds over others of the same problem, among sets that reach `enough`.
    pub(in crate::search) fn above(&self, other: &Self, enough: f64) -> f64 {
        let reaching = (other.min..self.of_number.len()).filter(|&k| self.reach(0, 0.0, k) > enough);
        reaching.map(|k| self.of_number[k] - other.of_number[k]).fold(0.0, f64::max)
    }

    /// The bound of `k` pairs with the contribution `gains`.
    pub(in crate::search) fn of_set(&self, k: usize, gains: f64) -> f64 {
        gains + self.of_number[k]
    }

    /// The bound of `own` pairs with the contribution `gains` and `more` pairs of the greatest gain.
    pub(in crate::search) fn reach(&self, own: usize, gains: f64, more: usize) -> f64 {
        self.of_set(own + more, gains + self.greatest * more as f64)
    }

    /// The number of pairs in reach of `own` ones and their bound, if they reach `min`.
    ///
    /// The pairs have the contribution `gains`; further ones come from `common`, from rank `from` on, with at most
    /// `count` model points. A coarse bound is returned if it falls short already.
    pub(in crate::search) fn with_common(
        &self,
        (own, gains): (usize, f64),
        (common, count): (&[u64], usize),
        from: usize,
        (min, enough): (usize, f64),
    ) -> (usize, f64) {
        let starts = &self.graph.starts;
        let max = count.min(starts.len() - 1 - from);
        if own + max < min {
            return (own + max, f64::NEG_INFINITY);
        }
        let reach = self.reach(own, gains, max);
        if self.single || reach < enough {
            return (own + max, reach);
        }
        let (k, sum) = self.joined((own, gains), common, from);
        (k, if k < min { f64::NEG_INFINITY } else { self.of_set(k, sum) })
    }

    /// The number and contribution of `own` pairs with the best pair of each further model point.
    ///
    /// The further model points are those of `common` from rank `from` on.
    pub(in crate::search) fn joined(&self, (own, gains): (usize, f64), common: &[u64], from: usize) -> (usize, f64) {
        let (mut k, mut sum, mut last) = (own, gains, u32::MAX);
        each_held(common, self.graph.starts[from], |begin, word| {
            let mut rest = groups(word, self.graph.lasts[begin / 64]);
            let mut v = begin;
            while rest != 0 {
                // Two at a time by selection, since branches on the number in a word are unpredictable.
                for _ in 0..2 {
                    v = if rest == 0 { v } else { begin + rest.trailing_zeros() as usize };
                    rest &= rest.wrapping_sub(1);
                    // A model point whose pairs continue in the next word counts once.
                    let rank = self.graph.rank[v];
                    let (one, top) = if rank == last { (0, 0.0) } else { (1, self.top[rank as usize]) };
                    (k, sum, last) = (k + one, sum + top, rank);
                }
            }
        });
        (k, sum)
    }

    /// Whether the bound of some pairs with their common neighbours reaches `enough`.
    ///
    /// The pairs are three or more; the neighbours are those in `row` from a bit on. The bound grows with every model
    /// point, so that the test ends early.
    pub(in crate::search) fn is_enough(
        &self,
        (own, gains): (usize, f64),
        (common, held): (&[u64], &[Held]),
        (row, from): (&[u64], usize),
        enough: f64,
    ) -> bool {
        if self.single {
            let count = shared(common, row, from);
            return own + count >= self.min && self.reach(own, gains, count) >= enough;
        }
        let joining =
            held.iter().map(|word| (word.begin(), groups(word.and(row, from), self.graph.lasts[word.place()])));
        let (mut k, mut sum, mut last) = (own, gains, u32::MAX);
        if k >= self.min && self.of_set(k, sum) >= enough {
            return true;
        }
        for (begin, mut rest) in joining {
            while rest != 0 {
                let rank = self.graph.rank[begin + rest.trailing_zeros() as usize];
                rest &= rest - 1;
                if rank != last {
                    (k, sum, last) = (k + 1, sum + self.top[rank as usize], rank);
                    if k >= self.min && self.of_set(k, sum) >= enough {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Lists the choices after each model point of a set, by rank; entries of other ranks are unchanged.
    pub(in crate::search) fn list(&self, set: &[Held], after: &mut Vec<After>) {
        self.list_of(set, &self.top, after);
    }

    /// The list with the contributions `top` of the ranks.
    pub(in crate::search) fn list_of(&self, set: &[Held], top: &[f64], after: &mut Vec<After>) {
        after.resize(self.top.len(), After::default());
        let (mut last, mut all) = (u32::MAX, After::default());
        for held in set.iter().rev() {
            let mut rest = groups(held.bits, self.graph.lasts[held.place()]);
            while rest != 0 {
                let bit = rest.ilog2() as usize;
                rest &= !(1 << bit);
                let rank = self.graph.rank[held.begin() + bit];
                if rank != last {
                    (after[rank as usize], last) = (all, rank);
                    all = After { more: all.more + 1, bring: all.bring + top[rank as usize] };
                }
            }
        }
    }

    /// Whether `own` pairs fall short even with all choices after the last of them.
    pub(in crate::search) fn falls_short(
        &self,
        (own, gains): (usize, f64),
        after: After,
        (min, enough): (usize, f64),
    ) -> bool {
        let (k, sum) = after.with((own, gains));
        // The order of summation differs from that of the deciding bounds.
        k < min || self.of_set(k, sum) + ROUNDING * (1.0 + sum.abs() + enough.abs()) < enough
    }
}

/// The mean residual cost of `k` true pairs under their own pose (nats): ½χ² of 3k − 6 degrees of freedom, limited to
/// [`DISTORTION`].
pub(super) fn distortion(k: usize) -> f64 {
    (1.5 * k as f64 - 3.0).clamp(0.0, DISTORTION)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{MeasuredPoint, UncertainPoint};

    use super::*;
    use crate::{
        candidates::Candidates,
        problem::{Problem, Tolerance},
        search::consensus::bits::{intersect, is_set, ones},
        site::model::ModelPoint,
    };

    /// The bound of some pairs and of those of a set from a rank on, computed pair by pair.
    fn one_by_one(bounds: &Bounds<'_>, own: &[usize], set: &[u64], from: usize) -> f64 {
        let gains: f64 = own.iter().map(|&v| bounds.gain(v)).sum();
        let joining = (0..bounds.graph.vertices.len()).filter(|&v| is_set(set, v));
        let mut ranks: Vec<usize> =
            joining.map(|v| bounds.graph.rank[v] as usize).filter(|&rank| rank >= from).collect();
        ranks.dedup();
        if own.len() + ranks.len() < bounds.min {
            return f64::NEG_INFINITY;
        }
        bounds.of_set(own.len() + ranks.len(), ranks.iter().fold(gains, |sum, &rank| sum + bounds.gain_of_rank(rank)))
    }

    /// Model points with one to ninety candidates, so that some continue in the next word.
    ///
    /// Fails if a model point counts once a word, and if the choices after a model point skip its neighbour.
    #[test]
    fn the_bounds_agree() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        let model: Vec<ModelPoint> = (0..8).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
        let each = [1, 3, 20, 40, 70, 80, 90, 90];
        let measured =
            |at: Vector3<f64>| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), 0.02), pixels: None };
        let cloud: Vec<MeasuredPoint> = (0..400).map(|_| measured(place(1.5))).collect();
        let pairs = each.iter().enumerate().flat_map(|(i, &count)| (0..count).map(move |j| (i, (37 * i + j) % 400)));
        let candidates = Candidates::from_pairs(model.len(), pairs);
        let tolerance = Tolerance::Fixed(0.5);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let prior_terms = PriorTerms::of(&problem).expect("a box");
        let graph = ConsistencyGraph::of(&problem, &prior_terms);
        let terms = PairTerms::of(&problem, &prior_terms, &graph);
        let bounds = Bounds::of((&terms, &prior_terms, &graph), 3);
        let (mut common, mut held, mut after) = (vec![0; graph.lasts.len()], Vec::new(), Vec::new());
        let (mut threes, mut spans) = (0, 0);
        for a in (0..graph.vertices.len()).step_by(7) {
            for b in ones(graph.row(a), graph.starts[graph.rank[a] as usize + 1]).step_by(5) {
                let next = graph.rank[b] as usize + 1;
                let count = intersect(graph.row(a), graph.row(b), &graph.lasts, graph.starts[next], &mut common);
                let gains = bounds.gain(a) + bounds.gain(b);
                let known = one_by_one(&bounds, &[a, b], &common, next);
                let all = (bounds.min, f64::NEG_INFINITY);
                assert_eq!(bounds.with_common((2, gains), (&common, count), next, all).1, known);
                Held::list(&common, graph.starts[next], &mut held);
                bounds.list(&held, &mut after);
                for c in held.iter().flat_map(Held::ones) {
                    let rank = graph.rank[c] as usize;
                    let (gains, from) = (gains + bounds.gain(c), graph.starts[rank + 1]);
                    let joining: Vec<u64> = common.iter().zip(graph.row(c)).map(|(x, y)| x & y).collect();
                    let known = one_by_one(&bounds, &[a, b, c], &joining, rank + 1);
                    for (enough, reached) in [(known - 1e-9, true), (known + 1e-9, false)] {
                        assert_eq!(
                            bounds.is_enough((3, gains), (&common, &held), (graph.row(c), from), enough),
                            reached
                        );
                        assert!(
                            !(reached && bounds.falls_short((3, gains), after[rank], (bounds.min, enough))),
                            "{known}"
                        );
                    }
                    threes += 1;
                    spans += usize::from(graph.starts[rank] / 64 != (from - 1) / 64);
                }
            }
        }
        assert!(threes > 1000 && spans > 100, "{threes} triples, {spans} of model points in two words");
    }
}
