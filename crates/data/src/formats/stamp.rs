//! Stamps as decimal seconds.

/// Decimal seconds as nanoseconds, digit by digit: a double has a resolution of 238 ns for current times.
pub(crate) fn nanoseconds(word: &str) -> Option<u64> {
    if word.contains(['e', 'E']) {
        let seconds: f64 = word.parse().ok()?;
        return (seconds.is_finite() && (0.0..1.8e10).contains(&seconds)).then(|| (seconds * 1e9).round() as u64);
    }
    let (integer, fraction) = word.split_once('.').unwrap_or((word, ""));
    if !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let nanos: u64 = format!("{:0<9.9}", fraction).parse().ok()?;
    integer.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nanos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_keep_their_nanoseconds() {
        assert_eq!(nanoseconds("1700000000.123456789"), Some(1_700_000_000_123_456_789));
        assert_eq!(nanoseconds("1.5e0"), Some(1_500_000_000));
        assert_eq!(nanoseconds("-1"), None);
    }
}
