//! How much of the errors stays below a bound, in one number.

/// The area under the curve of recall up to `bound`, as a share of what it could be: 1/a·∫₀ᵃ P(e ≤ x) dx, which is the mean of
/// max(0, 1 − e/a).
///
/// A failure enters as infinity and adds nothing; NaN without errors.
///
/// ```
/// let errors = [0.0, 0.01, 0.08, f64::INFINITY];
/// assert_eq!(seafix_evaluation::recall_area(&errors, 0.02), (1.0 + 0.5) / 4.0);
/// assert!(seafix_evaluation::recall_area(&[], 0.02).is_nan());
/// ```
pub fn recall_area(errors: &[f64], bound: f64) -> f64 {
    errors.iter().map(|error| (1.0 - error / bound).max(0.0)).sum::<f64>() / errors.len() as f64
}
