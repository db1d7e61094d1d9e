//! The likelihood ratio of proposed pairs under mislabelled model points.

use std::collections::BTreeSet;

use statrs::function::beta::beta_reg;

use super::{hypothesis::Hypothesis, judge::Judge};
use crate::{problem::Correspondence, search::pose::fraction};

impl Judge<'_> {
    /// The likelihood ratio of the proposed pairs: `other` correct over `own` correct.
    ///
    /// `other` assigns the measured points of `own` to other model points. A proposer by appearance confuses similar
    /// model points with an unknown probability μ < ½. Let a points of `own` be proposed for it alone, and let b other
    /// points agree with `other` alone. The marginal likelihoods are ∫ μᵇ (1 − μ)ᵃ dμ for `own` and ∫ μᵃ (1 − μ)ᵇ dμ
    /// for `other`, both over 0…½. Their ratio is
    ///
    /// I½(a + 1, b + 1)/I½(b + 1, a + 1),
    ///
    /// with I the regularised incomplete beta function. It is one for a = b, about 2⁻⁹ for eight points against none,
    /// and a tenth for six against two.
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

    /// I½(a + 1, b + 1) is the probability of more than a heads in a + b + 1 tosses: 1/512 for nine of nine, (36 + 9 +
    /// 1)/512 for seven or more of nine.
    #[test]
    fn proposals_have_the_odds_of_tossed_coins() {
        for (a, b, expected) in [(4, 4, 1.0), (8, 0, 1.0 / 511.0), (6, 2, 46.0 / 466.0), (0, 8, 511.0)] {
            assert!((odds(a, b) / expected - 1.0).abs() < 1e-9, "{a} against {b}: {}", odds(a, b));
        }
    }
}
