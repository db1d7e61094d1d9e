//! How likely a set can be at best, from what its first members have in common.

use nalgebra::Matrix6;

use super::{
    bits::{any, ones},
    graph::Graph,
    likelihood::{Terms, ln_volume},
    rough::Rough,
};

/// What the information of a set may fall short of that of as many average points (nats).
const SLACK: f64 = 3.0;

/// Bounds of the evidence of sets.
///
/// A set has one pair a model point, each with that point's greatest gain at most, the share B(k) of its number, and
/// a volume of the posterior about that of k average points. Its bound grows with every model point that may
/// join it.
pub(in crate::search) struct Bounds<'a> {
    graph: &'a Graph,
    terms: &'a Terms,
    /// Greatest gain of each model point by rank, at least `grows`.
    top: Vec<f64>,
    /// What a pair must gain so that the bound grows by it.
    grows: f64,
    /// The greatest gain of all.
    greatest: f64,
    /// Whether every model point has one candidate: then pairs are counted instead of model points.
    single: bool,
    /// What is added to the gains of k pairs.
    of_number: Vec<f64>,
    /// Smaller sets are of no interest.
    pub(in crate::search) least: usize,
}

impl<'a> Bounds<'a> {
    pub(in crate::search) fn of((terms, rough, graph): (&'a Terms, &Rough, &'a Graph), least: usize) -> Self {
        let ranks = graph.starts.len() - 1;
        let grows = libm::log(terms.ln_share.len() as f64) + 1.0;
        let gains = |i: usize| &terms.gain[graph.starts[i]..graph.starts[i + 1]];
        let top: Vec<f64> = (0..ranks).map(|i| gains(i).iter().copied().fold(grows, f64::max)).collect();
        let volume = volumes(terms, rough, ranks);
        let share = &terms.ln_share;
        Self {
            graph,
            terms,
            grows,
            greatest: top.iter().copied().fold(grows, f64::max),
            single: graph.vertices.len() == ranks,
            top,
            least,
            of_number: (0..=ranks).map(|k| share[k] + rough.ln_peak + volume[k] + SLACK).collect(),
        }
    }

    /// What one pair brings at most.
    pub(in crate::search) fn gain(&self, v: usize) -> f64 {
        self.terms.gain[v].max(self.grows)
    }

    /// What a model point brings at most.
    pub(in crate::search) fn gain_of_rank(&self, rank: usize) -> f64 {
        self.top[rank]
    }

    /// The bound of `k` pairs that bring `gains`.
    pub(in crate::search) fn of_set(&self, k: usize, gains: f64) -> f64 {
        gains + self.of_number[k]
    }

    /// The bound of `own` pairs that bring `gains` and `more` of the best.
    pub(in crate::search) fn reach(&self, own: usize, gains: f64, more: usize) -> f64 {
        self.of_set(own + more, gains + self.greatest * more as f64)
    }

    /// Whether the bound of [`with_common`](Self::with_common), of three pairs or more, is `enough`: known before all of it is,
    /// since it grows with every model point.
    pub(in crate::search) fn is_enough(
        &self,
        (own, gains): (usize, f64),
        common: &[u64],
        count: usize,
        from: usize,
        enough: f64,
    ) -> bool {
        let starts = &self.graph.starts;
        let most = count.min(starts.len() - 1 - from);
        if own + most < self.least || self.reach(own, gains, most) < enough {
            return false;
        }
        if self.single {
            return true;
        }
        let (mut k, mut sum) = (own, gains);
        if k >= self.least && self.of_set(k, sum) >= enough {
            return true;
        }
        let mut last = u32::MAX;
        let first = starts[from] / 64;
        for (word, &bits) in common.iter().enumerate().skip(first) {
            let mut rest = if word == first { bits & (!0 << (starts[from] % 64)) } else { bits };
            while rest != 0 {
                let rank = self.graph.rank[word * 64 + rest.trailing_zeros() as usize];
                rest &= rest - 1;
                if rank != last {
                    (k, sum, last) = (k + 1, sum + self.top[rank as usize], rank);
                    if k >= self.least && self.of_set(k, sum) >= enough {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// The bound of `own` pairs that bring `gains` and of the model points among the `count` pairs of `common`
    /// from rank `from` on; where even a rough bound is below `enough`, the rough one.
    pub(in crate::search) fn with_common(
        &self,
        (own, gains): (usize, f64),
        common: &[u64],
        count: usize,
        from: usize,
        enough: f64,
    ) -> f64 {
        let starts = &self.graph.starts;
        let most = count.min(starts.len() - 1 - from);
        if own + most < self.least {
            return f64::NEG_INFINITY;
        }
        let reach = self.reach(own, gains, most);
        if self.single || reach < enough {
            return reach;
        }
        let (mut k, mut sum) = (own, gains);
        // Few bits are looked at one by one, many by model point.
        if count < 2 * most {
            let mut last = usize::MAX;
            for rank in ones(common, starts[from]).map(|v| self.graph.rank[v] as usize) {
                if rank != last {
                    (k, sum, last) = (k + 1, sum + self.top[rank], rank);
                }
            }
        } else {
            for rank in (from..starts.len() - 1).filter(|&rank| any(common, starts[rank], starts[rank + 1])) {
                (k, sum) = (k + 1, sum + self.top[rank]);
            }
        }
        if k < self.least { f64::NEG_INFINITY } else { self.of_set(k, sum) }
    }
}

/// ln of the volumes that the posterior of 0…n points fills, taken for points that lie and are known as the
/// candidates are on average: 3 ln 2π − ½ ln det (P + k H₁).
fn volumes(terms: &Terms, rough: &Rough, n: usize) -> Vec<f64> {
    let of = |h: Matrix6<f64>| h.cholesky().map_or(f64::INFINITY, |chol| ln_volume(&chol));
    match &rough.known {
        Some(known) => (0..=n).map(|k| of(known.information + terms.average * k as f64)).collect(),
        None => {
            let one = of(terms.average);
            (0..=n).map(|k| one - 3.0 * libm::log(k.max(1) as f64)).collect()
        }
    }
}
