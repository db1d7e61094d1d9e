//! Sets that fit no rigid motion, without their badly measured pairs.

use std::collections::BTreeSet;

use super::{hypothesis::Hypothesis, judge::Judge};
use crate::Correspondence;

/// One pair in so many may be left out.
const EXCLUDABLE: usize = 5;
/// So many sets are thinned, the likeliest.
const MAX_SETS: usize = 64;
/// Larger sets are not thinned: every way of leaving out a pair is one fit of all the others.
const MAX_POINTS: usize = 50;

impl Judge<'_> {
    /// What is left of sets that fell at the residuals, the likeliest of which stand first, when
    /// their worst pairs are left out. A pair may agree with the distances of the others and still be
    /// badly measured: a corner before a distant ground, say.
    ///
    /// As few pairs are left out as let the residuals pass, at most one in five, so that at least
    /// four points bear witness. Every way of leaving out the last one that passes is given, each
    /// tested against chance anew: their poses, and those of the sets that passed whole, may
    /// contradict each other. No other test is helped by leaving pairs out.
    pub(super) fn thinned(&self, fallen: &[Hypothesis]) -> Vec<Hypothesis> {
        let mut known = BTreeSet::new();
        let sets = fallen.iter().filter(|hypothesis| hypothesis.pairs.len() <= MAX_POINTS).take(MAX_SETS);
        let thinned: Vec<Hypothesis> = sets.flat_map(|hypothesis| self.without_worst(&hypothesis.pairs)).collect();
        thinned.into_iter().filter(|hypothesis| known.insert(hypothesis.pairs.clone())).collect()
    }

    fn without_worst(&self, pairs: &[Correspondence]) -> Vec<Hypothesis> {
        let mut kept = pairs.to_vec();
        for _ in 0..pairs.len() / EXCLUDABLE {
            let without = |out: usize| {
                let mut fewer = kept.clone();
                fewer.remove(out);
                self.hypothesis(&fewer).ok()
            };
            let all: Vec<Hypothesis> = (0..kept.len()).filter_map(without).collect();
            let Some(best) = all.iter().min_by(|a, b| a.likelihood.cost.total_cmp(&b.likelihood.cost)) else {
                break;
            };
            kept.clone_from(&best.pairs);
            if self.size(&kept).is_err() {
                break;
            }
            let mut fitting: Vec<Hypothesis> = all.into_iter().filter(|fewer| self.residuals(fewer).is_ok()).collect();
            if !fitting.is_empty() {
                fitting.retain(|fewer| self.a_contrario(&fewer.pairs).is_ok());
                return fitting;
            }
        }
        Vec::new()
    }
}
