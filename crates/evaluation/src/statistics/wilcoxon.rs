//! Comparison of two methods by paired errors.

use statrs::distribution::{ContinuousCDF, Normal};

/// Maximum number of differences for the exact distribution of the rank sum.
const EXACT: usize = 60;

/// The result of [`signed_rank`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedRank {
    /// Number of pairs with different members; ties are excluded.
    pub differing: usize,
    /// Two-sided p-value of the hypothesis that the differences are symmetric about zero.
    pub p: f64,
    /// Matched-pairs rank-biserial correlation (Kerby, 2014): (W₋ − W₊) / (W₋ + W₊), with the rank sums W of first −
    /// second.
    ///
    /// 1: the first is smaller in every pair; −1: the second is; 0: neither, or all pairs are ties.
    pub effect: f64,
}

/// Wilcoxon's signed rank test (Individual comparisons by ranking methods, 1945) on pairs (first, second).
///
/// A failure has an infinite error: against a number it is the largest difference, against another failure a tie. Pairs
/// with NaN are excluded, as ties are. Equal differences share their mean rank. The test is exact up to 60 differences,
/// ties included, by enumeration of all signs; beyond that it uses the normal approximation with tie and continuity
/// corrections.
///
/// ```
/// use seafix_evaluation::signed_rank;
/// let found = signed_rank(&[(1.0, 2.0), (1.0, 3.0), (2.0, 5.0), (1.0, f64::INFINITY)]);
/// assert_eq!((found.differing, found.p, found.effect), (4, 0.125, 1.0));
/// ```
pub fn signed_rank(pairs: &[(f64, f64)]) -> SignedRank {
    let mut differences: Vec<f64> =
        pairs.iter().filter(|(a, b)| a != b).map(|(a, b)| a - b).filter(|d| !d.is_nan()).collect();
    differences.sort_unstable_by(|a, b| a.abs().total_cmp(&b.abs()));
    let n = differences.len();
    // Doubled ranks are integers even if ties share a mean rank.
    let mut doubled = vec![0_u64; n];
    let (mut begin, mut ties) = (0, 0.0);
    while begin < n {
        let equal = differences[begin..].iter().take_while(|d| d.abs() == differences[begin].abs()).count();
        let end = begin + equal;
        doubled[begin..end].fill((begin + 1 + end) as u64);
        ties += (equal as f64).powi(3) - equal as f64;
        begin = end;
    }
    let sum = |sign: fn(f64) -> bool| -> u64 {
        differences.iter().zip(&doubled).filter(|(d, _)| sign(**d)).map(|(_, rank)| rank).sum()
    };
    let (above, below) = (sum(|d| d > 0.0), sum(|d| d < 0.0));
    let all = above + below;
    if n == 0 {
        return SignedRank { differing: 0, p: 1.0, effect: 0.0 };
    }
    let min = above.min(below);
    let p = if n <= EXACT { counted(&doubled, min) } else { approximate(n, ties, min) };
    SignedRank { differing: n, p, effect: (below as f64 - above as f64) / all as f64 }
}

/// Twice the fraction of all 2ⁿ sign combinations with a doubled rank sum of at most `min`.
fn counted(doubled: &[u64], min: u64) -> f64 {
    let mut paths = vec![0.0; min as usize + 1];
    paths[0] = 1.0;
    for &rank in doubled {
        for sum in (rank as usize..paths.len()).rev() {
            paths[sum] += paths[sum - rank as usize];
        }
    }
    let fraction = paths.iter().sum::<f64>() / 2_f64.powi(doubled.len() as i32);
    (2.0 * fraction).min(1.0)
}

fn approximate(n: usize, ties: f64, min: u64) -> f64 {
    let n = n as f64;
    let mean = n * (n + 1.0) / 4.0;
    let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - ties / 48.0;
    let z = (mean - min as f64 / 2.0 - 0.5).max(0.0) / variance.sqrt();
    (2.0 * Normal::standard().sf(z)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test hangs if pairs with NaN are counted.
    #[test]
    fn what_is_no_number_states_nothing() {
        let pairs = [(1.0, 2.0), (1.0, 3.0), (2.0, 5.0)];
        let with = [&pairs[..], &[(f64::NAN, 1.0), (2.0, f64::NAN), (f64::NAN, f64::NAN)]].concat();
        assert_eq!(signed_rank(&with), signed_rank(&pairs));
    }

    #[test]
    fn pairs_have_the_textbook_value() {
        // Darwin's maize, crossed and self-fertilised (R: wilcox.test(…, paired = TRUE)$p.value = 0.04126).
        let crossed =
            [23.5, 12.0, 21.0, 22.0, 19.125, 21.5, 22.125, 20.375, 18.25, 21.625, 23.25, 21.0, 22.125, 23.0, 12.0];
        let own =
            [17.375, 20.375, 20.0, 20.0, 18.375, 18.625, 18.625, 15.25, 16.5, 18.0, 16.25, 18.0, 12.75, 15.5, 18.0];
        let pairs: Vec<(f64, f64)> = crossed.into_iter().zip(own).collect();
        let found = signed_rank(&pairs);
        assert!((found.p - 0.041_26).abs() < 2e-3, "{}", found.p);
        assert!(found.effect < -0.5);
        let other: Vec<(f64, f64)> = pairs.iter().map(|&(a, b)| (b, a)).collect();
        assert_eq!(signed_rank(&other), SignedRank { effect: -found.effect, ..found });
    }

    #[test]
    fn the_count_and_the_approximation_meet() {
        let values: Vec<f64> = (0..EXACT).map(|i| ((i * 37) % 61) as f64 - 27.3).collect();
        let pairs: Vec<(f64, f64)> = values.iter().map(|&d| (d, 0.0)).collect();
        let mut order: Vec<f64> = values.clone();
        order.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let below: usize = order.iter().enumerate().filter(|(_, d)| **d < 0.0).map(|(i, _)| 2 * (i + 1)).sum();
        let min = below.min(EXACT * (EXACT + 1) - below) as u64;
        let (exact, near) = (signed_rank(&pairs).p, approximate(EXACT, 0.0, min));
        assert!((exact - near).abs() < 0.02 * exact + 1e-4, "{exact} {near}");
    }

    #[test]
    fn two_failures_are_a_tie() {
        let infinite = f64::INFINITY;
        assert_eq!(signed_rank(&[(infinite, infinite), (1.0, 1.0)]).p, 1.0);
        assert_eq!(signed_rank(&[(infinite, 1.0)]).effect, -1.0);
    }
}
