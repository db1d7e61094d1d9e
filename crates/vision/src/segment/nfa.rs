//! The number of false alarms of a rectangle of aligned gradients.

/// The logarithm to base 10 of `tests` · P(at least k of n places are aligned), each with probability `p`.
///
/// The tail of the binomial distribution is summed from k on, until a term no longer changes it.
///
/// Source: Desolneux, Moisan and Morel, *Meaningful alignments*, IJCV 2000.
pub(super) fn log_nfa(log_tests: f64, n: f64, k: f64, p: f64) -> f64 {
    if !(k > 0.0 && n > 0.0) {
        return log_tests;
    }
    let (n, k) = (n.ceil().max(k), k.min(n.ceil()));
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
}
