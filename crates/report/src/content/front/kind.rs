//! The kind of question that an experiment asks: what varies, what the logs hold, and the words of the question.

use crate::{
    content::{
        conditions::{axes, labels::Labels},
        front::families,
        sections::{inspection, navigation, objects},
    },
    format::short,
    run::Run,
    summary::RunSummary,
};

/// The kind of an experiment, which selects the form of its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    /// Errors beside their Cramér–Rao bounds.
    Limits,
    /// Points of interest of an inspection.
    Points,
    /// Objects that were moved.
    Objects,
    /// The pose of a vehicle between fixes.
    Navigation,
    /// The cost of searches.
    Cost,
    /// The tolerance of distances, on the axis of this key.
    Tolerance(String),
    /// Robust methods over the fraction of wrong pairs, on the axis of this key.
    Outliers(String),
    /// Fixes and wrong fixes over the limit of the probability of a wrong answer, on the axis of this key.
    Acceptance(String),
    /// Fixes along the numeric axis of this key.
    Along(String),
    /// Methods over kinds of problems, on the axis of this key.
    Families(String),
    /// Fixes in named cases, or in a single trial.
    Cases,
}

impl Kind {
    pub(super) fn of(run: &Run, summary: &RunSummary) -> Self {
        let numeric = axes::keys(summary);
        let searches = summary.rows.iter().any(|row| row.search != summary.rows[0].search);
        let tolerance = numeric.iter().find(|key| key.contains("tolerance"));
        let outliers = numeric.iter().find(|key| short(key) == "outliers");
        let axes = || summary.rows.iter().flat_map(|row| &row.axes);
        let limit = axes().find(|axis| short(&axis.key) == "max-p-wrong").map(|axis| axis.key.clone());
        match (tolerance, outliers, numeric.first()) {
            _ if summary.has_limits() => Self::Limits,
            _ if run.trials.iter().any(inspection::inspects) => Self::Points,
            _ if run.trials.iter().any(objects::moves) => Self::Objects,
            _ if run.trials.iter().any(navigation::navigates) => Self::Navigation,
            _ if searches && summary.question.to_lowercase().contains("cost of") => Self::Cost,
            _ if limit.is_some() => Self::Acceptance(limit.unwrap_or_default()),
            (Some(key), ..) => Self::Tolerance(key.clone()),
            (_, Some(key), _) => Self::Outliers(key.clone()),
            (.., Some(key)) => Self::Along(key.clone()),
            _ => families::kinds(summary, &Labels::of(summary)).map_or(Self::Cases, Self::Families),
        }
    }

    /// The names of the figures that show the answer, the best first.
    pub(super) fn figures(&self, asked: Asked) -> &'static [&'static str] {
        match self {
            Self::Limits => &["error-over-noise", "error-over-condition"],
            Self::Points | Self::Objects | Self::Navigation => &["sawtooth", "rates", "error-over-condition"],
            Self::Cost => &["search-cost"],
            Self::Tolerance(_) => &["precision-recall"],
            Self::Acceptance(_) => &["roc", "rates", "success", "recall"],
            Self::Outliers(_) => &["success", "error-over-condition", "recall"],
            Self::Along(_) | Self::Families(_) | Self::Cases if !asked.accuracy => {
                &["rates", "success", "error-over-condition", "recall"]
            }
            Self::Along(_) | Self::Families(_) | Self::Cases => {
                &["error-over-condition", "rates", "success", "distribution", "error-over-frames", "recall"]
            }
        }
    }
}

/// What the words of a question ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Asked {
    /// How often fixes succeed.
    pub(super) rate: bool,
    /// How large errors are.
    pub(super) accuracy: bool,
    /// The condition up to which fixes succeed.
    pub(super) threshold: bool,
    /// The growth of the error between fixes.
    pub(super) drift: bool,
    /// The effect of a condition, so that both ends of its axis are compared.
    pub(super) effect: bool,
    /// Whether fixes keep an error small.
    pub(super) bounded: bool,
    /// How much of an error a method removes.
    pub(super) removal: bool,
    /// Whether every case suffices.
    pub(super) suffices: bool,
    /// The number of identified points.
    pub(super) points: bool,
    /// The cases that do not make the pose worse, and those that the residuals of the points show.
    pub(super) tolerates: bool,
    /// Whether several objects in view help.
    pub(super) company: bool,
}

impl Asked {
    pub(super) fn of(question: &str) -> Self {
        let question = question.to_lowercase();
        let words: Vec<&str> = question.split(|c: char| !c.is_alphanumeric()).collect();
        let word = |known: &[&str]| words.iter().any(|word| known.contains(word));
        let stem = |known: &[&str]| words.iter().any(|word| known.iter().any(|stem| word.starts_with(stem)));
        let phrase = |known: &[&str]| known.iter().any(|phrase| question.contains(phrase));
        let succeeds = ["fixes", "rate", "rates", "solves", "solved", "suits", "suit", "often", "matched"];
        let rate = word(&succeeds) || stem(&["succeed", "suffic", "tolerat"]) || phrase(&["get a fix", "gets a fix"]);
        let accuracy = stem(&["accura", "error", "precis"]);
        Self {
            // A question about neither asks for both.
            rate: rate || !accuracy,
            accuracy: accuracy || !rate,
            threshold: phrase(&["up to which", "up to what"]),
            drift: stem(&["drift"]),
            effect: phrase(&["how much"]) || stem(&["grow", "cost", "reduc"]),
            bounded: phrase(&["fixes bound", "fixes limit", "fixes reduce"]),
            removal: stem(&["remov"]),
            suffices: stem(&["suffic"]),
            points: phrase(&["how many feature points", "how many points"]),
            tolerates: stem(&["tolerat"]) && stem(&["residual"]),
            company: phrase(&["several objects", "several targets"]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_a_question_decide_what_is_answered() {
        let asked = |question| {
            let Asked { rate, accuracy, threshold, .. } = Asked::of(question);
            [rate, accuracy, threshold]
        };
        assert_eq!(asked("How accurate is a direct fix of one object from 2 to 5 m?"), [false, true, false]);
        assert_eq!(asked("Up to which height does an object get a fix?"), [true, false, true]);
        assert_eq!(
            asked("Up to which turbidity does a fix succeed, and how much accuracy does it cost?"),
            [true, true, true]
        );
        assert_eq!(asked("What happens at night?"), [true, true, false]);
        let more = |question| {
            let Asked { effect, bounded, removal, suffices, points, tolerates, company, .. } = Asked::of(question);
            [effect, bounded, removal, suffices, points, tolerates, company]
        };
        assert_eq!(more("How much does a current reduce the rate?"), [true, false, false, false, false, false, false]);
        assert_eq!(more("Do fixes bound the error?"), [false, true, false, false, false, false, false]);
        assert_eq!(more("How much drift do key frames remove?"), [true, false, true, false, false, false, false]);
        assert_eq!(more("Is the prior sufficient?"), [false, false, false, true, false, false, false]);
        assert_eq!(
            more("How many feature points does a fix tolerate, and which errors appear in the residuals?"),
            [false, false, false, false, true, true, false]
        );
        assert_eq!(more("Do several objects in view help?"), [false, false, false, false, false, false, true]);
    }
}
