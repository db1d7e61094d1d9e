//! Area under the recall curve.

/// The normalised area under the recall curve up to `bound`: 1/a·∫₀ᵃ P(e ≤ x) dx, the mean of max(0, 1 − e/a).
///
/// A failure has an infinite error and adds nothing; NaN without errors.
///
/// ```
/// let errors = [0.0, 0.01, 0.08, f64::INFINITY];
/// assert_eq!(seafix_evaluation::recall_area(&errors, 0.02), (1.0 + 0.5) / 4.0);
/// assert!(seafix_evaluation::recall_area(&[], 0.02).is_nan());
/// ```
pub fn recall_area(errors: &[f64], bound: f64) -> f64 {
    errors.iter().map(|error| (1.0 - error / bound).max(0.0)).sum::<f64>() / errors.len() as f64
}
