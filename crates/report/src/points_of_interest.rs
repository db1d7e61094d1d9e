//! The quantities of a point of interest in view, under the names that the columns of the results have.

use seafix_log::PointOfInterest;

/// One quantity of a point of interest in view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PoiQuantity {
    /// How far the point truly is from the left camera (m).
    Range,
    /// How far from its true place the vehicle had it (m).
    Error,
    /// Normalised error squared, three degrees of freedom.
    Nees,
}

impl PoiQuantity {
    pub(crate) const ALL: [Self; 3] = [Self::Range, Self::Error, Self::Nees];

    /// Its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Range => "poi_range",
            Self::Error => "poi_error",
            Self::Nees => "poi_nees",
        }
    }

    /// The quantity that is called `name`.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|quantity| quantity.name() == name)
    }

    /// Its value in the logged record; `None` where nothing is known.
    pub(crate) fn of(self, point: &PointOfInterest) -> Option<f64> {
        match self {
            Self::Range => Some(point.range()),
            Self::Error => point.error(),
            Self::Nees => point.nees,
        }
    }
}

/// What a point is called, with its object.
pub(crate) fn name(point: &PointOfInterest) -> String {
    format!("{}/{}", point.object, point.point)
}
