//! The probability of a number of seen points, with all fractions equally probable.

/// ln B(k), k = 0…n.
pub(in crate::search) fn fractions(n: usize) -> Vec<f64> {
    // B(0) = 1/(n + 1); B(k) = B(k − 1) · k/(n − k + 1).
    let mut fractions = vec![-libm::log((n + 1) as f64)];
    for k in 1..=n {
        let last = fractions[k - 1];
        fractions.push(last + libm::log(k as f64 / (n - k + 1) as f64));
    }
    fractions
}

/// ln B(k) for n points.
pub(in crate::search) fn ln_fraction(k: usize, n: usize) -> f64 {
    let ln_factorial = |k: usize| libm::lgamma(k as f64 + 1.0);
    ln_factorial(k) + ln_factorial(n - k) - ln_factorial(n + 1)
}
