//! Figures of the literature beside which a report sets its own.

use seafix_component::{Form, Settings};
use serde::{Deserialize, Serialize};

/// The form of a quantity.
struct Quantity;

impl Settings for Quantity {
    fn form() -> Form {
        Form::Words(Published::QUANTITIES.to_vec())
    }
}

/// A range of errors that a publication states for an experiment of the same kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// The publication and the conditions of its experiment.
    pub source: String,
    /// The compared quantity (m).
    #[setting(form = Quantity)]
    pub quantity: String,
    /// The smallest and the largest value (m).
    pub range: [f64; 2],
}

impl Published {
    /// The quantities that can be compared.
    const QUANTITIES: [(&str, &str); 3] = [
        ("fit_rms", "RMS residual of the correctly identified pairs at the estimated pose."),
        ("tre_rms", "Target registration error: RMS error of all model points that the pose transfers."),
        ("position_error", "Error of the left camera's position in the object frame."),
    ];

    /// The key that is invalid, with a message and a remedy.
    pub(crate) fn invalid(&self) -> Option<(&'static str, &'static str, String)> {
        let [low, high] = self.range;
        let names = Self::QUANTITIES.map(|(name, _)| name);
        if self.source.trim().is_empty() {
            return Some(("source", "no source", "name the publication and the conditions of its experiment".into()));
        }
        if !names.contains(&self.quantity.as_str()) {
            let remedy = format!("choose one of {}", names.join(", "));
            return Some(("quantity", "unknown quantity", remedy));
        }
        (!(0.0 <= low && low <= high && high.is_finite()))
            .then(|| ("range", "no range", "give the smallest and the largest value in metres".into()))
    }
}
