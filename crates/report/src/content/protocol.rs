//! How it was judged: metrics, thresholds, trials, statistics, all fixed beforehand.

use super::BORNE;
use crate::{
    document::{Block, Section, italic, text},
    format::harder,
    paired::{ALPHA, Comparison, SEED},
    proportion,
    run::Run,
};

/// How sure a trial's rates are, and by what.
fn intervals(run: &Run) -> String {
    if !run.trials.iter().any(|trial| proportion::is_trajectory(&trial.header)) {
        return "Every frame is a draw by itself: the rates of a trial, and recall, carry exact (Clopper–Pearson) 95 % intervals.".to_owned();
    }
    let mut said = "Frames follow each other on one way, and neighbours are not independent: the 95 % intervals of a trial’s rates, and the bands of recall, are those of Clopper and Pearson for the effective number of attempts (Korn and Graubard, 1998): n over the design effect, by which sums of blocks of consecutive attempts, the cube root of n long, vary more than of independent ones, a standard error added. Where all attempts are alike (0 % or 100 %) every block is one trial. A band is widened where it would fall.".to_owned();
    if run.trials.iter().any(|trial| trial.every() > 1) {
        said.push_str(
            " Where a trial logged only some of its frames the others are counted, and every block is one trial.",
        );
    }
    said
}

pub(super) fn section(run: &Run, comparisons: &[Comparison]) -> Section {
    let [h, c, p, e] = ["H", "C", "P", "E"].map(italic);
    let mut terms = vec![
        (
            text![italic("found, refused, wrong")],
            text![
                "A fix is wrong when the TRE exceeds the alert limit (the smaller of 0.10 m and 5 % of the target’s diameter); an attempt without a fix is refused; all others are found. The three add up to the attempts. ",
                intervals(run)
            ],
        ),
        (
            text![italic("m1")],
            text![
                "RMS of ‖",
                h,
                " ",
                c,
                " − ",
                p,
                "‖ over the correctly identified points (within 2 px of truth in both images): the paper’s figure. It contains the evaluated points’ own noise; ",
                italic("unused"),
                " leaves out those the solver used."
            ],
        ),
        (
            text![italic("m2")],
            text![
                "RMS of ‖",
                e.clone(),
                " ",
                italic("p"),
                " − ",
                italic("p"),
                "‖ over all model points ",
                italic("p"),
                " of the target, ",
                e.clone(),
                " the estimated pose after the inverse of the true one."
            ],
        ),
        (
            text![italic("m3")],
            text![
                "Error of the left camera’s position in the frame of the target, and the rotation angle of ",
                e.clone(),
                "."
            ],
        ),
        (
            text![italic("NEES")],
            text![
                "Squared error of the pose by its own covariance, six degrees of freedom; its mean is 6 where the covariance is honest."
            ],
        ),
    ];
    if run.trials.iter().any(|trial| trial.frames.iter().any(|frame| frame.truth.is_some())) {
        terms.push((
            text![italic("area under recall")],
            text![
                "The mean over all attempts of max(0, 1 − error/bound): 1 for no error, 0 from the bound on and for every attempt refused or wrong. Bounds, set beforehand: 50 mm for m2, 5° for the attitude of m3."
            ],
        ));
        terms.push((
            text![italic("at a lever arm")],
            text![
                "Error of a point 1, 2 or 5 m from the centroid of the points that the fix used: the root mean square over all directions of the arm, √(‖",
                e.clone(),
                " ",
                italic("c"),
                " − ",
                italic("c"),
                "‖² + 8/3 ",
                italic("a"),
                "² sin²(θ/2)), ",
                italic("c"),
                " the centroid, ",
                italic("a"),
                " the arm, θ the angle of ",
                e.clone(),
                "."
            ],
        ));
    }
    let sails = |trial: &crate::run::Trial| trial.sample().any(|frame| frame.navigated.is_some());
    if run.trials.iter().any(sails) {
        terms.push((
            text![italic("amplitude, drift")],
            text![
                "Of a stretch from a fix to the last frame before the next: the greatest error of the navigated position less that at the fix, and the distance between the errors, as vectors, at its two ends, by the way and by the time between them."
            ],
        ));
    }
    if run.header().axes.iter().any(|axis| harder(&axis.key)) {
        terms.push((
            text![italic("borne")],
            text![format!(
                "A condition is borne where at least {BORNE} % of the attempts are found, a share set beforehand; the break-down point is the largest value up to which every one that was tried is."
            )],
        ));
    }
    let mut section = Section::new("Protocol").with([
        Block::Paragraph(text![
            "Metrics are defined below, thresholds stand in the configuration (last section). No frame is excluded: one without an answer stays in every denominator. Medians and quantiles are over the fixes found, and say so; no failure is averaged into an error."
        ]),
        Block::Terms(terms),
    ]);
    if !comparisons.is_empty() {
        let unit = if comparisons[0].over_conditions {
            "Methods are compared over conditions, one value each: the median of the TRE over all attempts, failures as infinitely far off; the difference is the ratio of two such medians"
        } else if comparisons[0].between_conditions {
            "Frame k of every trial is drawn from the same random numbers, so that only the condition differs: trials are compared frame by frame and target by target, as far as both attempted it, failures as infinitely far off, by the median of the paired differences of m2, where not both fail"
        } else {
            "Trials that saw the same frames are compared attempt by attempt, failures as infinitely far off, by the median of the paired differences of m2, where not both fail"
        };
        section.say(text![format!(
            "{unit}. Its 95 % interval is the percentile bootstrap of 10 000 resamples, seed {SEED}, over {}. The test is Wilcoxon’s signed rank, two-sided, adjusted after Holm for the family of {} comparison{}; the effect is the matched-pairs rank-biserial correlation. A difference is called significant where the adjusted p is below {ALPHA} and the interval leaves out none at all. Success and failure are compared by McNemar’s exact test. Where no difference is significant, equivalence {} is tested, a margin set beforehand: it is shown where the 90 % interval, by the same bootstrap, is within it (two one-sided tests at 5 %, not adjusted) and McNemar’s test finds no difference; fewer than five blocks show nothing.",
            if comparisons[0].over_conditions { "the conditions" } else { "blocks of consecutive attempts, ⌈∛n⌉ long, for neighbouring frames are not independent" },
            comparisons.len(),
            if comparisons.len() == 1 { "" } else { "s" },
            super::significance::margin(comparisons),
        ).replace("⌈∛n⌉", "the cube root of n")]);
    }
    let frames: usize = run.trials.iter().map(crate::run::Trial::count).sum();
    section.say(text![format!("Trials: {}; frames in all: {frames}.", run.trials.len())]);
    section
}
