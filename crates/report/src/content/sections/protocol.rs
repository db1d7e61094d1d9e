//! The section on the protocol: metrics, thresholds, trials and statistics, fixed before the run.

use crate::{
    content::sections::significance,
    document::{Block, Section, Text, italic, text},
    format::harder,
    paired::{ALPHA, Comparison, SEED},
    proportion::{self, BORNE},
    run::{Run, Trial},
};

/// The sentences on the confidence intervals of a trial's rates.
fn intervals(run: &Run) -> String {
    if !run.trials.iter().any(|trial| proportion::is_trajectory(&trial.header)) {
        return "Every frame is an independent draw: rates and recall have exact (Clopper–Pearson) 95 % intervals."
            .to_owned();
    }
    let mut message = "Frames follow each other on one trajectory, so neighbours are not independent. The 95 % intervals of rates and the bands of recall are Clopper–Pearson intervals for the effective number of attempts (Korn and Graubard, 1998): n divided by the design effect. The design effect is the variance of sums over blocks of consecutive attempts relative to independent attempts, plus one standard error; a block has the cube root of n attempts. If all attempts have the same outcome (0 % or 100 %), every block counts as one attempt. Bands are widened so that they never fall along the bound.".to_owned();
    if run.trials.iter().any(|trial| trial.every() > 1) {
        message.push_str(
            " A trial that logged only some of its frames has counts of the others; every block counts as one attempt.",
        );
    }
    message
}

pub(crate) fn section(run: &Run, comparisons: &[Comparison]) -> Section {
    let mut section = Section::new("Protocol").with([
        Block::Paragraph(text![
            "Metrics are defined below; thresholds are in the configuration (last section). No frame is excluded: a frame without a fix stays in every denominator. Medians and quantiles of errors are over fixes that are not wrong, unless stated otherwise; failures never enter an average of errors."
        ]),
        Block::Terms(terms(run)),
    ]);
    if !comparisons.is_empty() {
        section.say(text![statistics(comparisons)]);
    }
    let frames: usize = run.trials.iter().map(Trial::count).sum();
    section.say(text![format!("Trials: {}; frames in all: {frames}.", run.trials.len())]);
    section
}

/// The definitions of the metrics that the report of this run has.
fn terms(run: &Run) -> Vec<(Text, Text)> {
    let mut terms = Vec::from(metrics_of_fixes(run));
    if run.trials.iter().any(|trial| trial.frames.iter().any(|frame| frame.truth.is_some())) {
        terms.extend(metrics_with_truth());
    }
    if run.trials.iter().any(|trial| trial.sample().any(|frame| frame.navigated.is_some())) {
        terms.extend(metrics_of_navigation());
    }
    if run.header().axes.iter().any(|axis| harder(&axis.key)) {
        terms.push((
            text![italic("break-down point")],
            text![format!(
                "The largest value of a condition up to which the fix rate is at least {BORNE} % at every tested value. The threshold was set before the run."
            )],
        ));
    }
    terms
}

fn metrics_of_fixes(run: &Run) -> [(Text, Text); 5] {
    let [h, c, p, e] = ["H", "C", "P", "E"].map(italic);
    [
        (
            text![italic("fixes, rejected, wrong")],
            text![
                "A fix is wrong if its TRE exceeds the alert limit (the smaller of 0.10 m and 5 % of the target’s diameter). An attempt without a fix is rejected. All other attempts count as fixes. The three add up to the number of attempts. ",
                intervals(run)
            ],
        ),
        (
            text![italic("fit RMS")],
            text![
                "RMS of ‖",
                h,
                " ",
                c,
                " − ",
                p,
                "‖ over the correctly identified points, those within 2 px of the true projection in both images (the paper’s measure). It includes the noise of the evaluated points; ",
                italic("unused"),
                " excludes the points that the solver used."
            ],
        ),
        (
            text![italic("TRE")],
            text![
                "Target registration error: RMS of ‖",
                e.clone(),
                " ",
                italic("p"),
                " − ",
                italic("p"),
                "‖ over all model points ",
                italic("p"),
                " of the target, ",
                e.clone(),
                " the estimated pose times the inverse of the true pose."
            ],
        ),
        (
            text![italic("position error, attitude error")],
            text![
                "Distance of the left camera from its true position in the frame of the target, and the rotation angle of ",
                e.clone(),
                "."
            ],
        ),
        (
            text![italic("NEES")],
            text![
                "Normalised estimation error squared: the pose error weighted by the inverse of its covariance, with six degrees of freedom. Its mean is 6 for a consistent covariance."
            ],
        ),
    ]
}

/// Further metrics of fixes, for a run with ground truth.
fn metrics_with_truth() -> [(Text, Text); 2] {
    let e = italic("E");
    [
        (
            text![italic("area under recall")],
            text![
                "Mean over all attempts of max(0, 1 − error/bound): 1 without error, 0 from the bound on and for rejected attempts and wrong fixes. The bounds were set before the run: 50 mm for the TRE, 5° for the attitude error."
            ],
        ),
        (
            text![italic("at a lever arm")],
            text![
                "Position error of a point 1, 2 or 5 m from the centroid of the points that the fix used, RMS over all directions of the arm: √(‖",
                e.clone(),
                " ",
                italic("c"),
                " − ",
                italic("c"),
                "‖² + 8/3 ",
                italic("a"),
                "² sin²(θ/2)), with the centroid ",
                italic("c"),
                ", the arm ",
                italic("a"),
                " and the angle θ of ",
                e.clone(),
                "."
            ],
        ),
    ]
}

fn metrics_of_navigation() -> [(Text, Text); 2] {
    [
        (
            text![italic("amplitude, drift")],
            text![
                "Over a fix interval, from a fix to the last frame before the next: the largest navigated position error less the error at the fix, and the length of the change of the error vector, divided by the path length and by the time."
            ],
        ),
        (
            text![italic("RMS of a dive")],
            text![
                "Root mean square of the navigated position error over the frames with a pose. Its 95 % interval is a percentile interval of the circular block bootstrap over these frames; the block length follows from the autocorrelation of the squared errors (Politis and White, 2004). It covers the variation within the dive, not that between dives."
            ],
        ),
    ]
}

/// The sentences on the comparison of trials.
fn statistics(comparisons: &[Comparison]) -> String {
    let unit = if comparisons[0].over_conditions {
        "Methods are compared over conditions, with one value for each: the median TRE over all attempts, with failures counted as infinite errors. The difference is the ratio of two such medians"
    } else if comparisons[0].between_conditions {
        "Frame k of every trial is generated from the same random numbers, so only the condition differs. Trials are compared by frame and target, over the attempts that both made, by the median of the paired TRE differences. Failures count as infinite errors; pairs that both fail are excluded"
    } else {
        "Trials on the same frames are compared attempt by attempt, by the median of the paired TRE differences. Failures count as infinite errors; pairs that both fail are excluded"
    };
    format!(
        "{unit}. The 95 % interval is a percentile bootstrap interval from 10 000 resamples (seed {SEED}) over {}. The test is Wilcoxon’s two-sided signed rank test, Holm-adjusted for the family of {} comparison{}; the effect is the matched-pairs rank-biserial correlation. A difference is significant if the adjusted p is below {ALPHA} and the interval excludes equality. Success and failure are compared by McNemar’s exact test. A difference that is not significant is tested for equivalence {}, a margin set before the run. Equivalence is shown if the 90 % interval of the same bootstrap is within the margin (two one-sided tests at 5 %, not adjusted) and McNemar’s test shows no difference; fewer than five blocks show no equivalence.",
        if comparisons[0].over_conditions {
            "the conditions"
        } else {
            "blocks of consecutive attempts with a length of the cube root of n, because neighbouring frames are not independent"
        },
        comparisons.len(),
        if comparisons.len() == 1 { "" } else { "s" },
        significance::margin(comparisons),
    )
}
