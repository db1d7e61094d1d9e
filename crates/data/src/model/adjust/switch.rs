//! The switch of an observation.

/// The 99 % quantile of χ² with four degrees of freedom: a consistent observation keeps its weight.
pub(super) const FINAL: f64 = 13.276_704;

/// The factor of the residual: dynamic covariance scaling s = min(1, 2Φ/(Φ + χ²)).
///
/// Source: Agarwal et al., *Robust map optimization using dynamic covariance scaling*, ICRA 2013.
pub(super) fn switch(chi2: f64, threshold: f64) -> f64 {
    if chi2 > threshold { 2.0 * threshold / (threshold + chi2) } else { 1.0 }
}

/// The cost ρ(χ²) = s² χ² + (1 − s)² Φ of a switched observation.
pub(super) fn cost(chi2: f64, threshold: f64) -> f64 {
    let s = switch(chi2, threshold);
    if s < 1.0 { s * s * chi2 + (1.0 - s) * (1.0 - s) * threshold } else { chi2 }
}

/// The falling thresholds before the final one, for a largest disagreement `worst`.
///
/// The threshold halves from half of the worst disagreement, so that right observations of poor initial poses keep
/// their weight (graduated non-convexity; Yang, Antonante, Tzoumas and Carlone 2020).
pub(super) fn graduated(worst: f64) -> impl Iterator<Item = f64> {
    // Disagreements of 10⁹ standard deviations are out of every view; doubling beyond them changes nothing.
    let first = 0.5 * worst.min(1e18);
    std::iter::successors(Some(first), |threshold| Some(0.5 * threshold)).take_while(|threshold| *threshold > FINAL)
}
