//! How likely it is that proposed pairs name model points that are only like the true ones.

use std::collections::BTreeSet;

use statrs::function::beta::beta_reg;

use super::{hypothesis::Hypothesis, judge::Judge};
use crate::{Correspondence, search::fraction};

impl Judge<'_> {
    /// How likely the proposed pairs are where `other`, which reads the points of `own` as other model points, is right, over how likely
    /// where `own` is.
    ///
    /// Who proposes pairs by appearance takes a model point for its like with a probability μ that nobody knows, less than ½. Let a of
    /// the points of `own` be proposed for it alone, and b others agree with `other` alone. Then the proposals have
    /// ∫ μᵇ (1 − μ)ᵃ dμ by the one and ∫ μᵃ (1 − μ)ᵇ dμ by the other over 0…½, of which the ratio is
    ///
    /// I½(a + 1, b + 1)/I½(b + 1, a + 1), I the regularised incomplete beta function:
    ///
    /// one where both are proposed alike, 2⁻⁹ of eight points against none, a tenth of six against two.
    pub(super) fn mislabeled(&self, own: &Hypothesis, other: &Hypothesis) -> f64 {
        let lists = &self.problem.candidates.lists;
        let listed = |pair: &&Correspondence| lists[pair.model].binary_search(&pair.cloud).is_ok();
        let both: BTreeSet<usize> = other.pairs.iter().filter(listed).map(|pair| pair.cloud).collect();
        let a = own.pairs.iter().filter(|pair| !both.contains(&pair.cloud)).count();
        if a == 0 {
            return 1.0;
        }
        let own_clouds: BTreeSet<usize> = own.pairs.iter().map(|pair| pair.cloud).collect();
        let agrees = |model: usize, cloud: usize| {
            !own_clouds.contains(&cloud) && fraction(self.problem, &other.pose, Correspondence { model, cloud }) <= 1.0
        };
        let b = (0..lists.len()).filter(|&model| lists[model].iter().any(|&cloud| agrees(model, cloud))).count();
        odds(a, b)
    }
}

/// I½(a + 1, b + 1)/I½(b + 1, a + 1).
fn odds(a: usize, b: usize) -> f64 {
    let (a, b) = (a as f64 + 1.0, b as f64 + 1.0);
    beta_reg(a, b, 0.5) / beta_reg(b, a, 0.5)
}

#[cfg(test)]
mod tests {
    use super::odds;

    /// I½(a + 1, b + 1) is the share of the outcomes of a + b + 1 tosses that have more than a heads: of nine all nine, one of 512; of
    /// nine seven or more, 36 + 9 + 1 of 512.
    #[test]
    fn proposals_have_the_odds_of_tossed_coins() {
        for (a, b, expected) in [(4, 4, 1.0), (8, 0, 1.0 / 511.0), (6, 2, 46.0 / 466.0), (0, 8, 511.0)] {
            assert!((odds(a, b) / expected - 1.0).abs() < 1e-9, "{a} against {b}: {}", odds(a, b));
        }
    }
}
