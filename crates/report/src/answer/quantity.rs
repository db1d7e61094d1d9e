//! The quantities of written answers by their names.

use seafix_component::unknown;

use super::error::AnswerError;
use crate::{field::Field, navigation_quantity::NavigationQuantity, points_of_interest::PoiQuantity};

/// A quantity of one or several trials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// The number of attempts or frames of a group.
    Count(Group),
    /// The fraction of attempts of a group (%).
    Rate(Group),
    /// The fraction of frames with a fix (%), among those with one target or several in view.
    FrameRate,
    /// The median of a quantity of the fixes; of the candidates and the pair tests, of all attempts.
    Median(Field),
    /// The root mean square over all fixes, wrong ones included.
    Rms(Field),
    /// The root mean square over all fixes in multiples of its Cramér–Rao bound.
    BoundRatio(Field),
    /// A statistic of a quantity of the navigated pose over the frames.
    Navigated(&'static str, NavigationQuantity),
    /// The median error at a point of interest.
    Point(PoiQuantity),
    /// The growth of the error between fixes (mm per metre), by its place in the table of drifts.
    Drift(usize),
    /// A measure of the identified points.
    Identified(&'static str),
}

/// A counted group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Group {
    Attempts,
    Fixes,
    Wrong,
    Rejected,
    Frames,
}

impl Group {
    /// The name in keys.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Attempts => "attempted",
            Self::Fixes => "found",
            Self::Wrong => "wrong",
            Self::Rejected => "refused",
            Self::Frames => "frames",
        }
    }
}

/// The statistics over the frames of a dive.
const OVER_FRAMES: [(&str, &str); 5] =
    [("rms", "rms"), ("last", "last"), ("maximum", "greatest"), ("median", "median"), ("q95", "q95")];

/// The quantities of the navigated pose in millimetres.
const NAVIGATED: [NavigationQuantity; 3] =
    [NavigationQuantity::Position, NavigationQuantity::Tre, NavigationQuantity::AlonePosition];

/// The measures of identified points.
pub(crate) const IDENTIFIED: [&str; 3] = ["precision", "recall", "f1"];

/// The drifts, in the order of [`crate::content`]'s table: over all intervals, the smallest, the largest, their number.
const DRIFTS: [&str; 4] = ["drift", "drift-minimum", "drift-maximum", "drift-intervals"];

impl Quantity {
    /// All quantities with their names.
    pub(crate) fn all() -> Vec<(String, Self)> {
        let named = |name: &str, quantity| (name.to_owned(), quantity);
        let mut all = vec![
            named("attempts", Self::Count(Group::Attempts)),
            named("fixes", Self::Count(Group::Fixes)),
            named("wrong", Self::Count(Group::Wrong)),
            named("rejected", Self::Count(Group::Rejected)),
            named("frames", Self::Count(Group::Frames)),
            named("fix-rate", Self::Rate(Group::Fixes)),
            named("wrong-rate", Self::Rate(Group::Wrong)),
            named("frame-rate", Self::FrameRate),
        ];
        all.extend(Field::ALL.iter().map(|&field| (format!("median {}", field.name()), Self::Median(field))));
        for field in [Field::Position, Field::Tre] {
            all.push((format!("rms {}", field.name()), Self::Rms(field)));
            all.push((format!("bound-ratio {}", field.name()), Self::BoundRatio(field)));
        }
        for quantity in NAVIGATED {
            let of = |(word, key)| (format!("{word} {}", quantity.name()), Self::Navigated(key, quantity));
            all.extend(OVER_FRAMES.map(of));
        }
        all.push((format!("median {}", PoiQuantity::Error.name()), Self::Point(PoiQuantity::Error)));
        all.extend(DRIFTS.iter().enumerate().map(|(place, name)| named(name, Self::Drift(place))));
        all.extend(IDENTIFIED.map(|name| named(name, Self::Identified(name))));
        all
    }

    pub(super) fn parse(text: &str, place: &str) -> Result<Self, AnswerError> {
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        let all = Self::all();
        if let Some((_, quantity)) = all.iter().find(|(name, _)| *name == words) {
            return Ok(*quantity);
        }
        let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
        let remedy = unknown(&words, &names);
        let remedy = remedy.trim_start_matches([',', ';', ' ']).to_owned();
        Err(AnswerError::new(place, format!("unknown quantity `{words}`"), remedy))
    }

    /// The name in queries.
    pub(crate) fn name(self) -> String {
        Self::all().into_iter().find(|(_, quantity)| *quantity == self).map_or_else(String::new, |(name, _)| name)
    }
}
