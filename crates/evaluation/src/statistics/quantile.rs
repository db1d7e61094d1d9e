//! Quantiles.

/// The `p` quantile of `values`, linear between order statistics (Hyndman and Fan's type 7).
///
/// It sorts the values in place; NaN without values.
///
/// ```
/// assert_eq!(seafix_evaluation::quantile(&mut [3.0, 1.0, 2.0], 0.5), 2.0);
/// assert_eq!(seafix_evaluation::quantile(&mut [1.0, 2.0], 0.25), 1.25);
/// ```
pub fn quantile(values: &mut [f64], p: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_unstable_by(f64::total_cmp);
    let place = p.clamp(0.0, 1.0) * (values.len() - 1) as f64;
    let (below, fraction) = (place.floor() as usize, place.fract());
    match values.get(below + 1) {
        // An infinite neighbour (a failure) must not turn an exact order statistic into NaN.
        Some(above) if fraction > 0.0 => between(values[below], *above, fraction),
        _ => values[below],
    }
}

/// The median of `values`, by selection instead of sorting; NaN without values.
///
/// It reorders the values. It equals [`quantile`] at 0.5 if neither of the middle two values is infinite.
///
/// ```
/// assert_eq!(seafix_evaluation::median(&mut [3.0, 1.0, 2.0, f64::INFINITY]), 2.5);
/// ```
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    let odd = values.len() % 2 == 1;
    let (lower, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if odd {
        return upper;
    }
    let below = lower.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    between(below, upper, 0.5)
}

/// Linear interpolation: infinite between a number and an infinity, NaN between opposite infinities.
fn between(low: f64, high: f64, fraction: f64) -> f64 {
    if low == high || low == f64::NEG_INFINITY && high.is_finite() { low } else { low + fraction * (high - low) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_at_infinity_keep_the_median() {
        assert_eq!(quantile(&mut [f64::INFINITY, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(quantile(&mut [f64::INFINITY, f64::INFINITY], 0.5), f64::INFINITY);
        assert_eq!(quantile(&mut [1.0, f64::INFINITY], 0.5), f64::INFINITY);
        assert!(quantile(&mut [], 0.5).is_nan());
    }

    #[test]
    fn the_median_is_the_middle_quantile() {
        let values = [0.4, -1.0, 7.5, 2.0, 2.0, 9.0, -3.0];
        for n in 1..=values.len() {
            assert_eq!(median(&mut values[..n].to_vec()), quantile(&mut values[..n].to_vec(), 0.5));
        }
        assert!(median(&mut []).is_nan());
    }
}
