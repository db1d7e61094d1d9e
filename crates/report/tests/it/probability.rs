//! The figures of the probability of a wrong answer, against counts by hand.

use std::fs;

use crate::{
    answers::{page, trial_of},
    made_up::blind,
};

/// Of forty objects 20 are found at 1e-6; at 5e-3 nine and a wrong one; at 0.3 seven and three wrong ones. Without the
/// object, two of forty frames are answered, at 0.05 and 0.3.
///
/// The intervals are Clopper and Pearson's of 0 of 20, 1 of 10, 1 of 1 and 4 of 11. All numbers are verified.
///
/// Fails if wrong fixes count as found, if rejected attempts count as fixes, and if the classes overlap.
#[test]
fn found_objects_and_wrong_answers_are_counted_by_their_probability() {
    let folder = tempfile::tempdir().unwrap();
    for (index, absent) in [(1, "false"), (2, "true")] {
        let axes = [("source.absent", absent), ("pipeline.acceptance.max-p-wrong", "0.5")];
        trial_of(folder.path(), index, axes, "How many objects are found?", |header, place| {
            let (p_wrong, wrong) = match (absent, place) {
                ("false", 0..20) => (1e-6, false),
                ("false", 20..30) => (5e-3, place == 20),
                ("false", _) => (0.3, place < 33),
                (_, 0) => (0.05, true),
                (_, 1) => (0.3, true),
                _ => (0.7, false),
            };
            // Frame 5 is rejected.
            let mut frame = blind(header, if p_wrong > 0.5 { 5 } else { 0 }, 2.0);
            let target = &mut frame.targets[0];
            (target.p_wrong, target.evaluation.wrong) = (Some(p_wrong), Some(wrong));
            frame
        });
    }
    page(folder.path());
    let table = |name: &str| -> Vec<Vec<f64>> {
        let text = fs::read_to_string(folder.path().join(format!("report/tables/{name}.csv"))).unwrap();
        let numbers = |line: &str| line.split(',').filter_map(|cell| cell.parse().ok()).collect();
        text.lines().skip(1).map(numbers).collect()
    };
    assert_eq!(
        table("roc"),
        [
            [1e-5, 50.0, 0.0],
            [1e-4, 50.0, 0.0],
            [1e-3, 50.0, 0.0],
            [1e-2, 72.5, 0.0],
            [2e-2, 72.5, 0.0],
            [0.1, 72.5, 2.5]
        ]
    );
    let expected = [
        [0.0, 1e-4, 20.0, 1e-6, 0.0, 0.0, 16.843347],
        [1e-3, 1e-2, 10.0, 5e-3, 10.0, 0.252858, 44.501612],
        [1e-2, 0.1, 1.0, 0.05, 100.0, 2.5, 100.0],
        [0.1, 0.5, 11.0, 0.3, 36.363636, 10.926344, 69.209529],
    ];
    let found = table("reliability");
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() <= 1e-4 * expected.max(1e-3), "{found} {expected}");
    }
}
