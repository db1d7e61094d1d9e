//! The number of false alarms of a rectangle of aligned gradients.

/// The logarithm to base 10 of `tests` · P(at least k of n places are aligned), each with probability `p`.
///
/// The tail of the binomial distribution is summed from k on, until a term no longer changes it. It is 1 for a k far
/// below the mean: a rectangle at the edge of a fisheye image may have 10⁹ undistorted places.
///
/// Source: Desolneux, Moisan and Morel, *Meaningful alignments*, IJCV 2000.
pub(super) fn log_nfa(log_tests: f64, n: f64, k: f64, p: f64) -> f64 {
    if !(k > 0.0 && n > 0.0) {
        return log_tests;
    }
    let (n, k) = (n.ceil().max(k), k.min(n.ceil()));
    if n * p - k > CERTAIN * (n * p * (1.0 - p)).sqrt() {
        return log_tests;
    }
    let choose = libm::lgamma(n + 1.0) - libm::lgamma(k + 1.0) - libm::lgamma(n - k + 1.0);
    let first = choose + k * libm::log(p) + (n - k) * libm::log(1.0 - p);
    let (mut term, mut sum, mut i) = (1.0, 1.0, k);
    while i < n {
        term *= (n - i) / (i + 1.0) * p / (1.0 - p);
        sum += term;
        i += 1.0;
        // Beyond the mean the terms fall.
        if i > n * p && term < 1e-12 * sum {
            break;
        }
    }
    log_tests + (first + libm::log(sum)) / std::f64::consts::LN_10
}

/// The number of standard deviations below the mean at which the tail is 1 to rounding.
const CERTAIN: f64 = 9.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_binomial_tail() {
        let choose = |n: u32, k: u32| (0..k).fold(1.0, |c, i| c * f64::from(n - i) / f64::from(i + 1));
        for (n, k) in [(20, 1), (20, 5), (20, 20), (7, 3)] {
            let tail: f64 =
                (k..=n).map(|i| choose(n, i) * 0.125_f64.powi(i as i32) * 0.875_f64.powi((n - i) as i32)).sum();
            let found = log_nfa(3.0, f64::from(n), f64::from(k), 0.125);
            assert!((found - 3.0 - tail.log10()).abs() < 1e-10, "{n} {k}: {found}");
        }
        assert_eq!(log_nfa(3.0, 20.0, 0.0, 0.125), 3.0);
    }

    /// Seen to take minutes when every term was summed.
    #[test]
    fn far_below_the_mean_the_tail_is_one() {
        assert_eq!(log_nfa(3.0, 1e12, 1e3, 0.125), 3.0);
        let [near, beyond] = [4160.0, 4155.0].map(|k| log_nfa(3.0, 40_000.0, k, 0.125));
        assert!((near - 3.0).abs() < 1e-12 && (beyond - 3.0).abs() < 1e-12, "{near} {beyond}");
    }
}
