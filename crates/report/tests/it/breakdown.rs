//! Break-down points against values by hand.

use std::fs;

use seafix_log::Writer;
use seafix_report::{Forms, report, verify};

use crate::made_up::{blind, header};

/// All attempts are fixes at 2, 3 and 5 m, one is rejected at 4 m: the break-down point is 3 m. Eight fixes in eight
/// attempts do not show a fix rate of 95 % with confidence.
///
/// Seen to fail where the verification continues beyond the first value that fails.
#[test]
fn what_comes_after_a_break_does_not_count() {
    let folder = tempfile::tempdir().unwrap();
    for (index, distance) in [2.0, 3.0, 4.0, 5.0].into_iter().enumerate() {
        let header = header(index + 1, distance, "kabsch");
        let mut writer = Writer::create(&folder.path().join(format!("{}.mcap", header.trial)), &header).unwrap();
        for place in 0..8 {
            let rejected = distance == 4.0 && place == 0;
            let mut frame = blind(&header, if rejected { 5 } else { 0 }, distance);
            (frame.frame, frame.stamp_ns) = (place, 100 * place);
            writer.frame(&frame).unwrap();
        }
        writer.finish().unwrap();
    }
    let out = folder.path().join("report");
    report(folder.path(), &out, Forms::ALL).unwrap();
    let table = fs::read_to_string(out.join("tables/breakdown.csv")).unwrap();
    let line = table.lines().nth(1).unwrap();
    assert!(line.starts_with("maximum-clique + kabsch,distance (m),2,5,3,100,") && line.ends_with("\","), "{table}");
    assert!(verify(folder.path(), &out).unwrap().holds());
}
