//! The probability of absence that a number of false alarms (NFA) states.

/// The probability of absence by the number of false alarms alone, NFA/(1 + NFA).
///
/// The NFA bounds the probability that frames without the object show such a set. With even prior odds of absence, and
/// the set certain if the object is present, the odds of absence are at most the NFA. A NaN remains a NaN.
pub(crate) fn by_nfa(nfa: f64) -> f64 {
    // Not NFA/(1 + NFA): an infinite NFA has the probability one.
    1.0 / (1.0 + 1.0 / nfa)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails if the odds are not those of a prior of one half, and if no or infinitely many false alarms are undefined.
    #[test]
    fn the_odds_of_absence_are_the_number_of_false_alarms() {
        for nfa in [1e-300, 1e-9, 1e-3, 1.0, 1e9] {
            let p = by_nfa(nfa);
            assert!((p / (1.0 - p) / nfa - 1.0).abs() < 1e-6, "{nfa}: {p}");
        }
        assert_eq!((by_nfa(0.0), by_nfa(f64::INFINITY)), (0.0, 1.0));
        assert!(by_nfa(f64::NAN).is_nan());
    }
}
