//! The quantities of a point of interest in view, named like the columns of the results.

use seafix_log::PointOfInterest;

/// A quantity of a point of interest in view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PoiQuantity {
    /// The true distance from the left camera (m).
    Range,
    /// The position error (m).
    Error,
    /// The NEES, with three degrees of freedom.
    Nees,
}

impl PoiQuantity {
    pub(crate) const ALL: [Self; 3] = [Self::Range, Self::Error, Self::Nees];

    /// The name in keys, equal to the column of the results.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Range => "poi_range",
            Self::Error => "poi_error",
            Self::Nees => "poi_nees",
        }
    }

    /// The quantity with this name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|quantity| quantity.name() == name)
    }

    /// The value in a logged record; `None` where it is unknown.
    pub(crate) fn of(self, point: &PointOfInterest) -> Option<f64> {
        match self {
            Self::Range => Some(point.range()),
            Self::Error => point.error(),
            Self::Nees => point.nees,
        }
    }
}

/// The name of a point with its object, `OBJECT/POINT`.
pub(crate) fn name(point: &PointOfInterest) -> String {
    format!("{}/{}", point.object, point.point)
}
