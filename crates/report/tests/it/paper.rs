//! The content of reports.

use std::{fs, path::Path, sync::LazyLock};

use seafix_log::{FrameRecord, FrameTimes, Outcome, TrialHeader, Writer, read};
use seafix_report::{Forms, ReportError, report, summary};

use crate::made_up::{SIZE, frame, header, write_run};

#[test]
fn the_report_is_the_same_twice_and_stands_alone() {
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), &[2.0, 5.0]);
    let path = report(folder.path(), &folder.path().join("report"), Forms::ALL).unwrap().page;
    let first = fs::read(&path).unwrap();
    assert_eq!(
        fs::read(report(folder.path(), &folder.path().join("report"), Forms::ALL).unwrap().page).unwrap(),
        first
    );
    let text = String::from_utf8(first).unwrap();
    assert!(!text.contains("<script") && text.contains("&lt;script&gt;"), "names are escaped");
    for foreign in ["src=\"http", "href=\"http", "url(http", "@import"] {
        assert!(!text.contains(foreign), "{foreign}");
    }
    let picture = fs::read(folder.path().join("report/fix.jpg")).unwrap();
    let mut decoder = zune_jpeg::JpegDecoder::new(zune_core::bytestream::ZCursor::new(&picture[..]));
    decoder.decode().unwrap();
    assert_eq!(decoder.dimensions().unwrap(), (2 * SIZE[0] as usize + 8, SIZE[1] as usize));
    if let Some(keep) = std::env::var_os("KEEP_REPORT") {
        fs::create_dir_all(&keep).unwrap();
        fs::write(Path::new(&keep).join("report.html"), text).unwrap();
        fs::copy(folder.path().join("report/fix.jpg"), Path::new(&keep).join("fix.jpg")).unwrap();
        fs::write(Path::new(&keep).join("table.txt"), summary(folder.path()).unwrap().to_string()).unwrap();
    }
}

#[test]
fn one_trial_is_generated_over_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let mut header = header(1, 3.0, "kabsch");
    header.axes.clear();
    header.trial = "001".to_owned();
    let mut writer = Writer::create(&folder.path().join("001.mcap"), &header).unwrap();
    FRAMES.iter().for_each(|frame| writer.frame(frame).unwrap());
    writer.finish().unwrap();
    let text =
        fs::read_to_string(report(folder.path(), &folder.path().join("report"), Forms::ALL).unwrap().page).unwrap();
    assert!(text.contains("Error of every fix over the frames"));
    if let Some(keep) = std::env::var_os("KEEP_REPORT") {
        fs::create_dir_all(&keep).unwrap();
        fs::write(Path::new(&keep).join("one.html"), text).unwrap();
    }
}

#[test]
fn numbers_are_those_of_the_log() {
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), &[2.0, 5.0]);
    let summary = summary(folder.path()).unwrap();
    assert_eq!(summary.rows.len(), 4);
    for row in &summary.rows {
        assert_eq!(row.found + row.rejected + row.wrong, row.attempted);
        assert_eq!(row.reasons.values().sum::<usize>(), row.rejected);
        let log = read(&folder.path().join(format!("{}.mcap", row.trial))).unwrap();
        let fixes = log.frames.iter().flat_map(|frame| &frame.targets);
        let mut tre: Vec<f64> = fixes
            .filter(|fix| fix.outcome == Outcome::Fix && fix.evaluation.wrong == Some(false))
            .filter_map(|fix| fix.evaluation.tre_rms)
            .collect();
        tre.sort_by(f64::total_cmp);
        let middle = (tre[(tre.len() - 1) / 2] + tre[tre.len() / 2]) / 2.0;
        assert!((row.tre.unwrap().median - middle).abs() < 1e-15);
        assert!((0.1..0.3).contains(&row.disparity_sigma.unwrap()), "0.4 px uniform in both images");
    }
    let wrong: Vec<usize> = summary.rows.iter().map(|row| row.wrong).collect();
    assert_eq!(wrong, [0, 0, 1, 0]);
    let text = summary.to_string();
    assert!(text.contains("maximum-clique + kabsch"), "{text}");
}

#[test]
fn a_folder_without_logs_is_no_run() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(report(folder.path(), &folder.path().join("report"), Forms::ALL), Err(ReportError::NoLogs(_))));
}

static FRAMES: LazyLock<Vec<FrameRecord>> = LazyLock::new(|| {
    let header = header(1, 3.0, "kabsch");
    (0..12).map(|number| frame(&header, number, 3.0)).collect()
});

/// The report and the summary of a run of one trial at 3 m, with header and frames modified by `change`.
fn changed(change: impl Fn(&mut TrialHeader, &mut FrameRecord)) -> (String, seafix_report::RunSummary) {
    let folder = tempfile::tempdir().unwrap();
    let mut header = header(1, 3.0, "kabsch");
    let mut frames = FRAMES.clone();
    frames.iter_mut().for_each(|frame| change(&mut header, frame));
    let mut writer = Writer::create(&folder.path().join("001.mcap"), &header).unwrap();
    frames.iter().for_each(|frame| writer.frame(frame).unwrap());
    writer.finish().unwrap();
    let report = report(folder.path(), &folder.path().join("report"), Forms::ALL).unwrap();
    (fs::read_to_string(report.page).unwrap(), report.summary)
}

#[test]
fn only_single_trials_carry_intervals() {
    let (text, _) = changed(|_, _| {});
    assert!(text.contains("%, 95 % interval ["));
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), &[3.0]);
    let text =
        fs::read_to_string(report(folder.path(), &folder.path().join("report"), Forms::ALL).unwrap().page).unwrap();
    assert!(!text.contains("95 % interval [") && text.contains("These counts pool trials"));
}

#[test]
fn published_figures_are_those_of_the_experiment() {
    let (text, summary) = changed(|_, _| {});
    assert!(summary.published.is_empty() && !text.contains("For comparison"));
    let (text, summary) = changed(|header, _| {
        header.configuration =
            "[[published]]\nsource = 'A & B 2020'\nquantity = 'tre_rms'\nrange = [0.0, 0.005]\n".to_owned();
    });
    assert_eq!(summary.published, ["For comparison: A & B 2020 reports a TRE of at most 5 mm."]);
    assert!(summary.to_string().contains(&summary.published[0]));
    assert!(text.contains("A &amp; B 2020 reports a TRE of at most 5 mm."));
}

#[test]
fn what_saw_no_images_is_not_stated_to_match_them() {
    let (text, _) = changed(|_, _| {});
    assert!(text.contains("are described, matched and triangulated") && text.contains("harris"));
    let (text, _) = changed(|header, frame| {
        header.components.retain(|component| ["search", "solver"].contains(&&component.stage[..]));
        frame.images = None;
        frame.key_points.clear();
        frame.times = FrameTimes::default();
    });
    let pipeline = &text[text.find("id=\"pipeline\"").unwrap()..text.find("id=\"data\"").unwrap()];
    assert!(text.contains("The source gives no images") && !text.contains("are described, matched"));
    assert!(!pipeline.contains("harris") && pipeline.contains("maximum-clique"));
    // Images that were used but not logged count as images.
    let (text, _) = changed(|_, frame| frame.images = None);
    assert!(text.contains("are described, matched and triangulated") && text.contains("harris"));
}

#[test]
fn a_surveyed_target_measures_no_disparity() {
    let named = |objects: [&str; 2]| {
        let (_, summary) = changed(|header, _| {
            let points = header.targets[0].points.iter_mut().enumerate();
            points.for_each(|(index, point)| point.id = format!("{}/{index}", objects[index % 2]));
        });
        summary.rows[0].disparity_sigma
    };
    assert!(named(["box", "box"]).is_some());
    assert_eq!(named(["box", "drum"]), None);
}
