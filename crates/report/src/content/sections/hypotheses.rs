//! The section on hypotheses: the tests that the experiment's axes and pairs allow, fixed before its first frame.

use crate::{
    document::{Block, Section, Text, italic, text},
    format::{self, distinct, sentence_case},
    paired::{ALPHA, Comparison},
    run::Run,
};

/// The section: the hypotheses, or the statement that the question is answered by estimates and their intervals.
pub(crate) fn section(run: &Run, comparisons: &[Comparison]) -> Section {
    let mut section = Section::new("Hypotheses");
    let axes = varied(run);
    let Some(first) = comparisons.first() else {
        section.say(text![format!(
            "The question is one of estimation, answered by rates, errors and their intervals. No hypothesis is tested: {}.",
            match axes.as_slice() {
                [] => "the run has a single trial".to_owned(),
                _ => format!("{} varied, but no two trials share frames or random numbers", message(&axes)),
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
            "over the conditions, the ratio of the median TRE of two methods is distributed symmetrically about one",
            "one of the two has the smaller median TRE",
            "the conditions, one pair each",
        )
    } else if first.between_conditions {
        (
            "frame by frame with the same random numbers, the TRE difference of two conditions is distributed symmetrically about zero",
            "one of the two has the smaller TRE",
            "the pairs of attempts that both made",
        )
    } else {
        (
            "the TRE difference of two trials on the same attempts is distributed symmetrically about zero",
            "one of the two has the smaller TRE",
            "the pairs of attempts that both made",
        )
    };
    section.say(text![format!("{} varied. Compared trials: {what}.", sentence_case(&message(&axes)))]);
    let items: Vec<Text> = vec![
        text![italic("H0"), format!(": {null}. Rejected attempts and wrong fixes count as infinite errors.")],
        text![italic("H1"), format!(": {alternative} (two-sided).")],
        text![format!(
            "Test: Wilcoxon’s signed rank test over {unit}, with Holm’s adjustment to a family-wise level of {ALPHA} over {} comparison{}. H0 is rejected only if the bootstrap interval of the difference also excludes equality (Section “Significance”).",
            comparisons.len(),
            if comparisons.len() == 1 { "" } else { "s" },
        )],
    ];
    section.add(Block::Items(items));
    section
}

/// The short names of the axes that differ between the trials.
fn varied(run: &Run) -> Vec<String> {
    let axes = &run.header().axes;
    let differs = |place: &usize| {
        run.trials
            .iter()
            .any(|trial| trial.header.axes.get(*place).is_some_and(|axis| axis.value != axes[*place].value))
    };
    distinct((0..axes.len()).filter(differs).map(|place| format::short(&axes[place].key).to_owned()))
}

/// The subject and verb `a, b and c are`.
fn message(axes: &[String]) -> String {
    match axes {
        [] => "the run is".to_owned(),
        [one] => format!("{one} is"),
        [max @ .., last] => format!("{} and {last} are", max.join(", ")),
    }
}
