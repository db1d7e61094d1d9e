//! Where fixes stand in the diagram of integrity.

use super::target::{Outcome, TargetRecord};

/// The region of the Stanford diagram that a fix is in, by its error e, its protection level p and the alert limit a, all of
/// the position (m) (Tossaint and others, *The Stanford–ESA integrity diagram*, Navigation 2007).
///
/// A fix with p > a must not be used. A fix with p < e is misleading; if also p ≤ a < e, it is hazardously misleading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Region {
    /// e ≤ p ≤ a.
    Available,
    /// p < e ≤ a.
    Misleading,
    /// p ≤ a < e.
    Hazardous,
    /// a < p, e ≤ p.
    Unavailable,
    /// a < p < e.
    UnavailableMisleading,
    /// The fix has no protection level.
    Unprotected,
}

impl Region {
    /// All regions.
    pub const ALL: [Self; 6] = [
        Self::Available,
        Self::Misleading,
        Self::Hazardous,
        Self::Unavailable,
        Self::UnavailableMisleading,
        Self::Unprotected,
    ];

    /// Of this error, level and limit (m).
    pub fn of(error: f64, level: Option<f64>, limit: f64) -> Self {
        match level {
            None => Self::Unprotected,
            Some(level) if level > limit && error > level => Self::UnavailableMisleading,
            Some(level) if level > limit => Self::Unavailable,
            Some(_) if error > limit => Self::Hazardous,
            Some(level) if error > level => Self::Misleading,
            Some(_) => Self::Available,
        }
    }

    /// The word for it in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Available => "available",
            Self::Misleading => "misleading",
            Self::Hazardous => "hazardously-misleading",
            Self::Unavailable => "unavailable",
            Self::UnavailableMisleading => "unavailable-misleading",
            Self::Unprotected => "unprotected",
        }
    }
}

impl TargetRecord {
    /// The region that the fix is in; `None` without a fix, its truth or its limit.
    pub fn region(&self) -> Option<Region> {
        let error = self.evaluation.position_error.filter(|_| self.outcome == Outcome::Fix)?;
        let level = self.integrity.as_ref().and_then(|it| it.protection_position);
        Some(Region::of(error, level, self.evaluation.alert_limit?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_level_and_limit_state_the_region() {
        let of = |error, level| Region::of(error, Some(level), 0.10);
        let around = [(0.01, 0.02), (0.03, 0.02), (0.11, 0.02), (0.11, 0.12), (0.13, 0.12), (0.02, 0.12)];
        let regions = around.map(|(error, level)| of(error, level).name());
        let expected = [
            "available",
            "misleading",
            "hazardously-misleading",
            "unavailable",
            "unavailable-misleading",
            "unavailable",
        ];
        assert_eq!(regions, expected);
        // On its limit a value is within it.
        assert_eq!([of(0.02, 0.02), of(0.10, 0.10)], [Region::Available; 2]);
        assert_eq!(Region::of(0.01, None, 0.10), Region::Unprotected);
    }
}
