//! The first page's sentences on synthetic runs with known results.

use std::{fs, path::Path};

use seafix_log::{Axis, FrameRecord, TrialHeader, Writer};
use seafix_report::{Forms, report, verify};

use crate::made_up::{blind, header};

/// Writes a trial of 40 frames, of which the first `rejected` have no fix.
pub(crate) fn trial(folder: &Path, index: usize, axes: [(&str, &str); 2], question: &str, rejected: u64) {
    // Frame 5 of the synthetic run is rejected.
    let of = |header: &TrialHeader, place| blind(header, if place < rejected { 5 } else { 0 }, 2.0);
    trial_of(folder, index, axes, question, of);
}

/// Writes a trial of 40 frames.
pub(crate) fn trial_of(
    folder: &Path,
    index: usize,
    axes: [(&str, &str); 2],
    question: &str,
    of: impl Fn(&TrialHeader, u64) -> FrameRecord,
) {
    let mut header = header(index, 2.0, axes[1].1);
    header.question = question.to_owned();
    header.trial = format!("{index:03}");
    header.axes = axes.map(|(key, value)| Axis { key: key.to_owned(), value: value.to_owned() }).to_vec();
    let mut writer = Writer::create(&folder.join(format!("{}.mcap", header.trial)), &header).unwrap();
    for place in 0..40 {
        let mut frame = of(&header, place);
        (frame.frame, frame.stamp_ns) = (place, 100 * place);
        writer.frame(&frame).unwrap();
    }
    writer.finish().unwrap();
}

/// The text of the report's first page after the question; its numbers are verified.
pub(crate) fn page(folder: &Path) -> String {
    let out = folder.join("report");
    report(folder, &out, Forms::ALL).unwrap();
    assert!(verify(folder, &out).unwrap().holds());
    front(&out)
}

/// The text of the first page of the report in a folder, after the question.
pub(crate) fn front(out: &Path) -> String {
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let (_, page) = page.split_once("class=\"question\"").unwrap();
    let page = page.split_once("class=\"appendix\"").unwrap().0;
    let mut text = String::new();
    let mut inside = true;
    for c in page.chars() {
        match c {
            '<' => inside = true,
            '>' => inside = false,
            c if !inside => text.push(c),
            _ => {}
        }
    }
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Methods that tolerate the same are named together, and a lower end that says nothing new is left out; one method
/// without fixes is named as such.
#[test]
fn methods_that_tolerate_the_same_have_one_clause() {
    let folder = tempfile::tempdir().unwrap();
    let question = "How many wrong pairs does each robust method tolerate?";
    let rejected = [("kabsch", [0, 0]), ("horn", [0, 0]), ("triad", [0, 30]), ("umeyama", [30, 30])];
    let mut index = 0;
    for (solver, by_fraction) in rejected {
        for (fraction, rejected) in ["10", "50"].into_iter().zip(by_fraction) {
            index += 1;
            let axes = [("source.outliers", fraction), ("pipeline.solver", solver)];
            trial(folder.path(), index, axes, question, rejected);
        }
    }
    let page = page(folder.path());
    let expected = "At least 95 % of the attempts have a fix up to 50 % outliers with kabsch and horn";
    assert!(page.contains(expected), "{page}");
    assert!(page.contains(", up to 10 % outliers with triad"), "{page}");
    assert!(page.contains(", at none of the tested fractions with umeyama"), "{page}");
}

/// A question about limits of acceptance has the fixes and the wrong ones of the first method at each limit.
///
/// Its 40 frames count as ten blocks of four: no event in ten has the interval [0, 30.8] %.
///
/// The table has the limits of every method.
#[test]
fn every_limit_of_acceptance_has_its_fixes() {
    let folder = tempfile::tempdir().unwrap();
    let question = "How many objects are found, and how many answers are wrong, at each limit?";
    for (index, solver) in ["kabsch", "triad"].into_iter().enumerate() {
        for (place, (limit, rejected)) in [("strict", 40), ("0.5", 0)].into_iter().enumerate() {
            let axes = [("pipeline.acceptance.max-p-wrong", limit), ("pipeline.solver", solver)];
            trial(folder.path(), 2 * index + place + 1, axes, question, rejected);
        }
    }
    let page = page(folder.path());
    let expected = "With maximum-clique + kabsch, at the limit strict, 0.0 % [0.0, 30.8] of 40 objects in view have a fix and \
                    0.0 % [0.0, 30.8] a wrong one; at the limit 0.5, 100.0 % [69.2, 100.0] of 40 objects in view have a fix \
                    and 0.0 % [0.0, 30.8] a wrong one; the table has the other methods.";
    assert!(page.contains(expected), "{page}");
    assert!(page.contains("maximum-clique + triadstrict400.0 [0.0, 30.8]0.0 [0.0, 30.8]0.540100.0 ["), "{page}");
    assert!(page.contains("higher with maximum-clique + kabsch at the limit 0.5 than with maximum-clique + kabsch at the limit strict, a"), "{page}");
}

/// Along an axis, errors of several series are those at the same values, and at a series' own last value; values without a
/// fix are named.
///
/// Seen to fail where each series has its own ends only.
#[test]
fn errors_of_series_are_at_the_same_values() {
    let folder = tempfile::tempdir().unwrap();
    let question = "How accurate is a fix from 2 to 4 m?";
    let mut index = 0;
    for (solver, rejected) in [("triad", [0, 0, 40]), ("kabsch", [0, 0, 0])] {
        for (altitude, rejected) in ["2.0", "3.0", "4.0"].into_iter().zip(rejected) {
            index += 1;
            let axes = [("source.altitude", altitude), ("pipeline.solver", solver)];
            trial(folder.path(), index, axes, question, rejected);
        }
    }
    let page = page(folder.path());
    let sentence = &page[page.find("With triad, the median").unwrap()..];
    let sentence = &sentence[..sentence.find(" wrong fixes in ").unwrap()];
    let (triad, kabsch) = sentence.split_once("; with kabsch, ").unwrap();
    assert!(triad.contains("] at altitude 3.0 m, with no fix at altitude 4.0 m"), "{triad}");
    assert!(kabsch.contains("] at altitude 3.0 m and ") && kabsch.contains("] at altitude 4.0 m; 0"), "{kabsch}");
}

/// The ends of an axis are compared over their common attempts, four successive ones of which count as one.
///
/// Twelve rejected ones are three blocks, for which McNemar's z is √3; all forty are ten, for which it is √10.
///
/// Seen to fail where every attempt counts as one.
#[test]
fn ends_are_compared_over_common_attempts() {
    let question = "How much does a current reduce the rate of fixes?";
    for (rejected, expected, verdict) in [
        (12, "(a change of −30.0 points [", "in 40 common attempts, not significant)"),
        (40, "(a change of −100.0 points [", "in 40 common attempts, significant)"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        for (index, (speed, rejected)) in [("0.0", 0), ("0.6", rejected)].into_iter().enumerate() {
            let axes = [("source.speed", speed), ("pipeline.solver", "kabsch")];
            trial(folder.path(), index + 1, axes, question, rejected);
        }
        let page = page(folder.path());
        assert!(page.contains(&format!("at speed 0.6 m/s {expected}")) && page.contains(verdict), "{page}");
        // The table has the same change, and the conclusion the same difference.
        let change = expected.split(" points ").next().unwrap().rsplit(' ').next().unwrap();
        assert!(page.contains(change) && page.contains("higher at speed 0.0 m/s than at speed 0.6 m/s"), "{page}");
    }
}

/// Of methods over kinds of problems, the answer names where each is below the best; the table has a cell for each pair.
///
/// Seen to fail where the kinds are pooled.
#[test]
fn methods_are_ranked_within_each_kind() {
    let folder = tempfile::tempdir().unwrap();
    let question = "Which solver solves which kind of problem?";
    let mut index = 0;
    for (kind, by_method) in [("easy", [0, 0]), ("hard", [10, 40])] {
        for (solver, rejected) in ["kabsch", "triad"].into_iter().zip(by_method) {
            index += 1;
            trial(folder.path(), index, [("source.kind", kind), ("pipeline.solver", solver)], question, rejected);
        }
    }
    let page = page(folder.path());
    let expected = "kabsch is nowhere significantly below the best rate; triad is below it in hard; the best rates are \
                    100.0 % [69.2, 100.0] in easy, 75.0 % [";
    assert!(page.contains(expected), "{page}");
    assert!(page.contains("; wrong fixes: none of 80 attempts with kabsch and triad"), "{page}");
}

/// Errors of the calibration are sorted by what they do to the pose and to the residuals.
///
/// All trials have the same fixes here, so none does anything.
#[test]
fn tolerated_errors_are_compared_with_the_first_case() {
    let folder = tempfile::tempdir().unwrap();
    let question = "Which errors does a fix tolerate, and which appear in its residuals?";
    for (index, case) in ["exact", "roll", "focal length"].into_iter().enumerate() {
        trial(folder.path(), index + 1, [("case", case), ("pipeline.solver", "kabsch")], question, 0);
    }
    let page = page(folder.path());
    assert!(page.contains("Compared with exact, whose median camera position error is "), "{page}");
    assert!(
        page.contains(": neither this error nor the residuals of the points (fit RMS) are shown to be larger"),
        "{page}"
    );
    assert!(page.contains("; no case has significantly fewer fixes"), "{page}");
}

/// Repetitions differ by their seed, which is a name and no quantity: the answer runs over the other condition.
#[test]
fn a_seed_is_no_axis() {
    let folder = tempfile::tempdir().unwrap();
    let mut index = 0;
    for seed in ["1", "4"] {
        for (altitude, rejected) in [("2", 0), ("6", 20)] {
            index += 1;
            let axes = [("seed", seed), ("source.altitude", altitude)];
            trial(folder.path(), index, axes, "How many attempts succeed, by altitude?", rejected);
        }
    }
    let page = page(folder.path());
    assert!(!page.contains("at seed") && page.contains("altitude 2") && page.contains("altitude 6"), "{page}");
    assert!(page.contains("seed 1") && page.contains("seed 4"), "{page}");
}
