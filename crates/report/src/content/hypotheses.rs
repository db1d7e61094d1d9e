//! What is tested, as it stood before the first frame: the hypotheses that the experiment's axes and its pairs allow.

use super::{distinct, sentence_case};
use crate::{
    document::{Block, Section, Text, italic, text},
    format,
    paired::{ALPHA, Comparison},
    run::Run,
};

/// The hypotheses, or that there is none to test: then the question is answered by estimates and their intervals.
pub(super) fn section(run: &Run, comparisons: &[Comparison]) -> Section {
    let mut section = Section::new("Hypotheses");
    let axes = varied(run);
    let Some(first) = comparisons.first() else {
        section.say(text![format!(
            "The question is one of estimation: {} nothing is tested against anything, and rates, errors and their intervals answer it.",
            match axes.as_slice() {
                [] => "one trial, without a second to pair it with;".to_owned(),
                _ => format!("{} varied, but no two trials share frames or random numbers, so that", said(&axes)),
            }
        )]);
        return section;
    };
    let names = distinct(comparisons.iter().flat_map(|c| c.names.clone()));
    let what = match names.len() {
        0..=6 => names.join("; "),
        n => format!("{} and {} more", names[..5].join("; "), n - 5),
    };
    let (null, alternative, unit) = if first.over_conditions {
        (
            "over the conditions, the ratio of the median the TRE of two methods lies symmetrically about one",
            "one of the two has the less median m2",
            "the conditions, one pair each",
        )
    } else if first.between_conditions {
        (
            "frame by frame of the same random numbers, the difference of the TRE of two conditions lies symmetrically about nothing",
            "one of the two has the less m2",
            "the attempts that both made, in pairs",
        )
    } else {
        (
            "the difference of the TRE of two trials on the same attempts lies symmetrically about nothing",
            "one of the two has the less m2",
            "the attempts that both made, in pairs",
        )
    };
    section.say(text![format!("{} varied; compared are {what}.", sentence_case(&said(&axes)))]);
    let items: Vec<Text> = vec![
        text![italic("H0"), format!(": {null}. A refused attempt and a wrong one count as infinitely far off.")],
        text![italic("H1"), format!(": {alternative}; which of them is left open (two-sided).")],
        text![format!(
            "Test: Wilcoxon’s signed rank over {unit}, at the level {ALPHA} for the family of {} comparison{} together (Holm). H0 is rejected only where the bootstrap interval of the difference leaves out none at all as well (Section “Significance”).",
            comparisons.len(),
            if comparisons.len() == 1 { "" } else { "s" },
        )],
    ];
    section.add(Block::Items(items));
    section
}

/// What differs between the trials, by its short names.
fn varied(run: &Run) -> Vec<String> {
    let axes = &run.header().axes;
    let differs = |place: &usize| {
        run.trials
            .iter()
            .any(|trial| trial.header.axes.get(*place).is_some_and(|axis| axis.value != axes[*place].value))
    };
    distinct((0..axes.len()).filter(differs).map(|place| format::short(&axes[place].key).to_owned()))
}

/// `a, b and c are`.
fn said(axes: &[String]) -> String {
    match axes {
        [] => "the run is".to_owned(),
        [one] => format!("{one} is"),
        [max @ .., last] => format!("{} and {last} are", max.join(", ")),
    }
}
