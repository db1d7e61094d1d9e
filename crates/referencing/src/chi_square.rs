//! Quantiles of the χ² distribution.

use std::{cell::RefCell, collections::VecDeque};

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// The quantile of χ² with `dof` degrees of freedom.
///
/// Bisection computes it, and few arguments recur: each thread caches the last ones.
pub(crate) fn chi_square(dof: usize, confidence: f64) -> f64 {
    const REMEMBERED: usize = 64;
    thread_local! {
        static KNOWN: RefCell<VecDeque<(usize, f64, f64)>> = const { RefCell::new(VecDeque::new()) };
    }
    let same = |&&(n, c, _): &&(usize, f64, f64)| n == dof && c == confidence;
    if let Some((_, _, known)) = KNOWN.with_borrow(|known| known.iter().find(same).copied()) {
        return known;
    }
    let quantile = ChiSquared::new(dof as f64).expect("degrees of freedom are positive").inverse_cdf(confidence);
    KNOWN.with_borrow_mut(|known| {
        known.truncate(REMEMBERED - 1);
        known.push_front((dof, confidence, quantile));
    });
    quantile
}
