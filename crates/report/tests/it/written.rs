//! Answers that a person has written: their numbers are those of the tables, and their claims are checked.

use std::{fs, path::Path};

use seafix_log::{Axis, Writer};
use seafix_report::{Answer, Forms, Verified, prepare, verify, verify_answered};

use crate::{
    answers::{front, trial},
    dives,
    made_up::{blind, header, write_run},
};

/// Writes the report with an answer; the result is its first page's text and its verification.
fn written(folder: &Path, answer: &str, claims: &[&str]) -> (String, Verified) {
    let out = folder.join("report");
    let prepared = prepare(folder, Forms::ALL, Some(&Answer::parse(answer, claims).unwrap())).unwrap();
    assert!(prepared.unmet.is_empty(), "{:?}", prepared.unmet);
    prepared.write(&out).unwrap();
    (front(&out), verify(folder, &out).unwrap())
}

/// The fault of an answer that has no value in a run.
fn fault(folder: &Path, answer: &str) -> String {
    let answer = Answer::parse(answer, &[""; 0]).unwrap();
    prepare(folder, Forms::ALL, Some(&answer)).unwrap_err().to_string()
}

/// Fixes rejected in 0, 10 and 40 of 40 frames by three solvers.
fn three_solvers(folder: &Path) {
    for (index, (solver, rejected)) in [("kabsch", 0), ("horn", 10), ("triad, old", 40)].into_iter().enumerate() {
        let axes = [("source.altitude", "2.0"), ("pipeline.solver", solver)];
        trial(folder, index + 1, axes, "Which solver?", rejected);
    }
}

/// Rates, counts, medians, changes and values of two terms are those of the table, and verification computes each again.
///
/// Seen to fail where quotes do not hide a comma, and where the divisor of a ratio is the first term.
#[test]
fn the_numbers_of_an_answer_are_those_of_the_table() {
    let folder = tempfile::tempdir().unwrap();
    three_solvers(folder.path());
    let answer = r#"Horn has {fix-rate: solver=horn; interval} of {attempts: solver=horn}, {change fix-rate: solver=horn - solver=kabsch; interval},
        {percent fixes: solver=horn / attempts: solver=kabsch}, {difference fixes: solver=kabsch - fixes: solver=horn},
        {ratio fixes: solver=kabsch / fixes: solver=horn}, {decrease fixes: solver=kabsch - fixes: solver=horn},
        {smallest fix-rate: solver=any; bare} to {largest fix-rate: solver=any}, {rejected: solver="triad, old"} and {rejected: all} rejected,
        {common fix-rate: solver=horn & solver=any}, error {median position_error: solver=horn; interval} or
        {common median position_error: solver=horn & solver=any; bare}."#;
    let claims = [
        "significant(fix-rate: solver=kabsch - solver=\"triad, old\"; of 3)",
        "not significant(median position_error: solver=kabsch - solver=horn)",
        "fix-rate: solver=horn = 75",
        "fix-rate: solver=horn; high > fix-rate: solver=horn",
    ];
    let (page, verified) = written(folder.path(), answer, &claims);
    assert!(verified.holds(), "{verified:#?}");
    let expected = [
        "Horn has 75.0 % [",
        "] of 40, −25.0 points [",
        "], 75.0 %, 10, 1.3, 25.0 %, 0.0 to 100.0 %, 40 and 50 rejected, 75.0 %, error ",
    ];
    expected.iter().for_each(|part| assert!(page.contains(part), "{part}: {page}"));
    let table = fs::read_to_string(folder.path().join("report/tables/answer.csv")).unwrap();
    let row = table.lines().find(|line| line.contains("horn")).unwrap();
    let answer = &page[..page.find(" or ").unwrap()];
    let error = answer.rsplit("error ").next().unwrap();
    assert!(row.contains(&error.replace(" mm", "")) && row.contains(",40,"), "{error}: {row}");
    // The generated answer moves to the appendix, with the claims; the conclusion gives place to the answer.
    let report = fs::read_to_string(folder.path().join("report/report.html")).unwrap();
    assert!(!page.contains("Conclusion.") && report.contains("Claims of the answer"));
    assert!(verified.findings.contains("**Answer.** Horn has"), "{}", verified.findings);
}

/// Values of a dive, from a frame on and over all frames; points and objects by name, or the extreme of all.
///
/// Seen to fail where the first frame is ignored.
#[test]
fn a_dive_has_values_over_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let since = |number: u64| 1e-4 * (number % 20) as f64;
    dives::trial(folder.path(), 1, ["navigation", "often"], "Drift?", |number| {
        [if number < 25 { since(number) } else { 0.010 }, 0.020]
    });
    let answer = "It is {rms navigated_position_error: navigation=often, from=25}, {last navigated_position_error: all}, \
                  {maximum navigated_position_error: all}, {rms odometry_only_position_error: all; interval}; drift {drift-minimum: all}.";
    let (page, verified) = written(folder.path(), answer, &["drift-intervals: all = 2"]);
    assert!(verified.holds(), "{verified:#?}");
    assert!(page.contains("It is 10.0 mm, 10.0 mm, 10.0 mm, 20.0 mm [20.0, 20.0]; drift 1.00 mm/m."), "{page}");
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), &[2.0, 5.0]);
    let answer = "{largest median poi_error: distance=2, solver=kabsch, point=any} and \
                  {smallest median tre_rms: distance=any, solver=kabsch, object=any} of {largest f1: distance=any, solver=any}.";
    let (_, verified) =
        written(folder.path(), answer, &["smallest median poi_error: distance=2, solver=kabsch, point=any > 0"]);
    assert!(verified.holds(), "{verified:#?}");
}

/// Of 40 attempts, the first 10 of which are rejected, 20 are those of a shorter trial too: half of these have a fix.
///
/// Seen to fail where all attempts of the first trial count.
#[test]
fn common_attempts_are_those_of_all_trials() {
    let folder = tempfile::tempdir().unwrap();
    let axes = |solver| [("source.altitude", "2.0"), ("pipeline.solver", solver)];
    trial(folder.path(), 1, axes("kabsch"), "Which solver?", 10);
    let mut header = header(2, 2.0, "horn");
    header.trial = "002".to_owned();
    header.axes = axes("horn").map(|(key, value)| Axis { key: key.to_owned(), value: value.to_owned() }).to_vec();
    let mut writer = Writer::create(&folder.path().join("002.mcap"), &header).unwrap();
    for place in 0..20 {
        let mut frame = blind(&header, 0, 2.0);
        (frame.frame, frame.stamp_ns) = (place, 100 * place);
        writer.frame(&frame).unwrap();
    }
    writer.finish().unwrap();
    let answer = "{fix-rate: solver=kabsch}, {common fix-rate: solver=kabsch & solver=any} of {common attempts: solver=kabsch & solver=horn}.";
    let (page, verified) = written(folder.path(), answer, &["common fixes: solver=horn & solver=kabsch = 20"]);
    assert!(verified.holds() && page.contains("75.0 %, 50.0 % of 20."), "{page}{verified:#?}");
}

/// A claim that does not hold has one line with its values.
///
/// Seen to fail where `<` is taken for `<=`.
#[test]
fn a_claim_that_does_not_hold_is_named() {
    let folder = tempfile::tempdir().unwrap();
    three_solvers(folder.path());
    let claims = ["wrong: all < 0", "not significant(fix-rate: solver=kabsch - solver=\"triad, old\")"];
    let answer = Answer::parse("No.", &claims).unwrap();
    let prepared = prepare(folder.path(), Forms::SMALL, Some(&answer)).unwrap();
    let [first, second] = &prepared.unmet[..] else { panic!("{:?}", prepared.unmet) };
    assert!(first.starts_with("the claim `wrong: all < 0` does not hold: 0 < 0; change"), "{first}");
    assert!(second.contains("100.0 % [") && second.contains(" and 0.0 % ["), "{second}");
}

/// Selections of no trial or of several name the labels that exist.
#[test]
fn faults_name_what_exists() {
    let folder = tempfile::tempdir().unwrap();
    three_solvers(folder.path());
    let fault = |answer: &str| fault(folder.path(), answer);
    let several = fault("{fix-rate: altitude=2}");
    let expected =
        "several trials match `altitude=2` in `fix-rate: altitude=2`; add solver=kabsch|horn|triad, old, or solver=any";
    assert!(
        several.starts_with("cannot answer in the report on virtual-direct: ") && several.ends_with(expected),
        "{several}"
    );
    assert!(
        fault("{fix-rate: solver=horns}")
            .ends_with("no trial has solver=`horns` in `fix-rate: solver=horns`; did you mean `horn`?")
    );
    assert!(
        fault("{fix-rate: solvr=horn}").contains("no axis `solvr`")
            && fault("{fix-rate: solvr=horn}").contains("`solver`")
    );
    assert!(
        fault("{median position_error: solver=any}")
            .contains("3 trials match, but `median position_error` is a value of one")
    );
    assert!(fault("{median position_error: solver=\"triad, old\"}").contains("no value in"));
    assert!(fault("{attempts: solver=horn; interval}").contains("no interval of this value"));
    assert!(fault("{fix-rate: solver=horn, point=a}").contains("no value of `fix-rate` for this part"));
    assert!(fault("{ratio fixes: solver=horn / wrong: all}").contains("a division by zero"));
    assert!(fault("{change fix-rate: all - solver=horn}").contains("no common attempts"));
}

/// A changed digit, a changed word and another list are noticed.
///
/// Seen to fail where the page's own answer replaces that of the list.
#[test]
fn changes_of_a_written_answer_are_found() {
    let folder = tempfile::tempdir().unwrap();
    three_solvers(folder.path());
    let (_, verified) = written(folder.path(), "In {fix-rate: solver=horn} & more.", &["wrong: all = 0"]);
    assert!(verified.holds(), "{verified:#?}");
    let out = folder.path().join("report");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let changed = |from: &str, to: &str| {
        assert!(page.contains(from), "{from}");
        fs::write(out.join("report.html"), page.replacen(from, to, 1)).unwrap();
        verify(folder.path(), &out).unwrap()
    };
    let digit = changed(">75.0</data>", ">76.0</data>");
    assert_eq!((digit.mismatches.len(), digit.changed.len()), (1, 1), "{digit:#?}");
    assert_eq!(changed("In </b>", "On </b>").changed, ["report.html"]);
    let claim = changed("content=\"wrong: all = 0\"", "content=\"wrong: all = 1\"");
    assert!(claim.unmet.len() == 1 && !claim.holds(), "{claim:#?}");
    fs::write(out.join("report.html"), &page).unwrap();
    let other = Answer::parse("In {fix-rate: solver=horn}.", &[""; 0]).unwrap();
    assert_eq!(verify_answered(folder.path(), &out, Some(&other)).unwrap().changed[0], "report.html");
    assert!(!verify_answered(folder.path(), &out, None).unwrap().holds());
}
