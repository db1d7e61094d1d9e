//! The exclusion of badly measured pairs from sets that fail the residual test.

use std::collections::BTreeSet;

use crate::ablation::AcceptanceTest;

use super::{hypothesis::Hypothesis, judge::Judge};

/// Number of pairs per excluded pair.
const EXCLUDABLE: usize = 5;
/// Maximum number of sets, the best first, that are thinned.
const MAX_SETS: usize = 64;
/// Maximum number of pairs of a thinned set; each exclusion requires one fit of all other pairs.
const MAX_POINTS: usize = 50;

impl Judge<'_> {
    /// The subsets of failed sets that pass without their worst pairs; `fallen` is ordered by falling score.
    ///
    /// A pair may agree with the distances of the others and still be badly measured, for example a corner in front of
    /// a distant background. The smallest number of pairs is excluded that passes the residual test, at most one in
    /// five, so that at least four points remain. Every choice of the last excluded pair that passes is returned, and
    /// each is tested for false alarms again: their poses, and those of complete sets, may contradict each other.
    /// Exclusion serves the residual test only.
    pub(super) fn thinned(&self, fallen: &[Hypothesis]) -> Vec<Hypothesis> {
        if !self.acceptance.with(AcceptanceTest::Exclusion) {
            return Vec::new();
        }
        let mut known = BTreeSet::new();
        let sets = fallen
            .iter()
            .filter(|hypothesis| hypothesis.pairs.len() + hypothesis.edges.len() <= MAX_POINTS)
            .take(MAX_SETS);
        let thinned: Vec<Hypothesis> = sets.flat_map(|hypothesis| self.without_worst(hypothesis)).collect();
        thinned
            .into_iter()
            .filter(|hypothesis| known.insert((hypothesis.pairs.clone(), hypothesis.edges.clone())))
            .collect()
    }

    fn without_worst(&self, set: &Hypothesis) -> Vec<Hypothesis> {
        let (mut kept, mut edges) = (set.pairs.clone(), set.edges.clone());
        for _ in 0..(kept.len() + edges.len()) / EXCLUDABLE {
            let without = |out: usize| {
                let (mut fewer, mut fewer_edges) = (kept.clone(), edges.clone());
                match out.checked_sub(fewer.len()) {
                    None => fewer.remove(out),
                    Some(out) => fewer_edges.remove(out),
                };
                self.hypothesis_of(&fewer, &fewer_edges).ok()
            };
            let all: Vec<Hypothesis> = (0..kept.len() + edges.len()).filter_map(without).collect();
            let Some(best) = all.iter().min_by(|a, b| a.likelihood.cost.total_cmp(&b.likelihood.cost)) else {
                break;
            };
            kept.clone_from(&best.pairs);
            edges.clone_from(&best.edges);
            if self.size(&kept, &edges).is_err() {
                break;
            }
            let mut fitting: Vec<Hypothesis> = all.into_iter().filter(|fewer| self.residuals(fewer).is_ok()).collect();
            if !fitting.is_empty() {
                fitting.retain(|fewer| self.a_contrario(&fewer.pairs, &fewer.edges).is_ok());
                return fitting;
            }
        }
        Vec::new()
    }
}
