//! The regions of the Stanford diagram, as counted and as plotted.

use std::{fs, path::Path};

use seafix_log::{FrameRecord, Integrity, Outcome, Region, Totals, Writer};
use seafix_report::{Forms, report, summary, verify};

use crate::made_up::{blind, header};

/// Position errors and protection levels (m) for an alert limit of 50 mm, one fix in each region.
const CASES: [(f64, Option<f64>, Region); 6] = [
    (0.010, Some(0.020), Region::Available),
    (0.030, Some(0.020), Region::Misleading),
    (0.060, Some(0.040), Region::Hazardous),
    (0.010, Some(0.080), Region::Unavailable),
    (0.090, Some(0.080), Region::UnavailableMisleading),
    (0.010, None, Region::Unprotected),
];

/// Writes twelve frames, each case twice, with or without totals.
///
/// `change` can imitate a log of an older version.
fn write(folder: &Path, totals: bool, change: impl Fn(&mut FrameRecord)) {
    let header = header(1, 3.0, "kabsch");
    let mut sums = Totals { every: 1, ..Totals::default() };
    let mut writer = Writer::create(&folder.join("001.mcap"), &header).unwrap();
    for number in 0..12 {
        let mut frame = blind(&header, number, 3.0);
        let (error, level, _) = CASES[number as usize % 6];
        let row = &mut frame.targets[0];
        row.outcome = Outcome::Fix;
        row.reason.clear();
        row.object_from_camera.get_or_insert(frame.truth.as_ref().unwrap().world_from_camera);
        row.integrity = Some(Integrity { protection_position: level, ..Integrity::default() });
        row.evaluation.position_error = Some(error);
        row.evaluation.alert_limit = Some(0.05);
        change(&mut frame);
        sums.add(&frame);
        writer.frame(&frame).unwrap();
    }
    if totals {
        writer.totals(&sums).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn every_fix_is_counted_in_its_region_and_each_number_is_that_of_the_log() {
    for (totals, older) in [(true, false), (false, false), (false, true)] {
        let folder = tempfile::tempdir().unwrap();
        // Older logs have no alert limit for each fix, only those of the targets in the header.
        write(folder.path(), totals, |frame| {
            if older {
                frame.targets[0].evaluation.alert_limit = None;
            }
        });
        assert_eq!(summary(folder.path()).unwrap().rows[0].regions, Some([2; 6]));
        let out = folder.path().join("report");
        report(folder.path(), &out, Forms::ALL).unwrap();
        let verified = verify(folder.path(), &out).unwrap();
        assert!(verified.holds(), "{verified:#?}");
        let table = fs::read_to_string(out.join("tables/stanford.csv")).unwrap();
        for (_, _, region) in CASES.iter().filter(|case| case.1.is_some()) {
            assert_eq!(
                table.lines().filter(|line| line.contains(&format!(",{},", region.name()))).count(),
                2,
                "{table}"
            );
        }
        assert_eq!(table.lines().count(), 11, "a fix without a protection level is not plotted");
        let table = fs::read_to_string(out.join("tables/integrity.csv")).unwrap();
        assert!(table.contains(",12,2,16.6"), "two of twelve attempts are available: {table}");
    }
}

#[test]
fn where_nothing_is_known_of_levels_nothing_is_stated_of_them() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), true, |frame| frame.targets[0].evaluation = Default::default());
    assert_eq!(summary(folder.path()).unwrap().rows[0].regions, None);
    report(folder.path(), &folder.path().join("report"), Forms::ALL).unwrap();
    let page = fs::read_to_string(folder.path().join("report/report.html")).unwrap();
    assert!(!page.contains("Stanford") && !page.contains("Integrity"));
}
