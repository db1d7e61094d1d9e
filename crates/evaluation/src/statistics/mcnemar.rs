//! Comparison of two success rates over the same trials.

use statrs::distribution::{Binomial, DiscreteCDF};

/// The exact two-sided p-value of McNemar's test (1947): two methods succeed equally often.
///
/// `first` is the number of trials in which only the first method succeeded, `second` that of the second. The p-value
/// is twice the smaller tail of a binomial distribution with probability 1/2.
///
/// ```
/// assert_eq!(seafix_evaluation::mcnemar(0, 0), 1.0);
/// assert!((seafix_evaluation::mcnemar(5, 0) - 0.0625).abs() < 1e-12);
/// ```
pub fn mcnemar(first: usize, second: usize) -> f64 {
    let n = (first + second) as u64;
    if n == 0 {
        return 1.0;
    }
    let coin = Binomial::new(0.5, n).expect("one half is a probability");
    (2.0 * coin.cdf(first.min(second) as u64)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_have_the_textbook_value() {
        // R: binom.test(2, 12)$p.value
        assert!((mcnemar(2, 10) - 0.038_574).abs() < 1e-6);
        assert_eq!(mcnemar(2, 10), mcnemar(10, 2));
        assert_eq!(mcnemar(4, 4), 1.0);
    }
}
