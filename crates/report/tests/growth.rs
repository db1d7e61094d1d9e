//! What a report costs grows with its rows, and what it writes does not.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod rows;

use std::{alloc::System, fs};

use seafix_report::{Forms, report, verify};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATIONS: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// With four times the rows a report, and its verification, ask for four times the memory at most; and its page, which is for
/// people, hardly grows.
///
/// Seen to fail where the diagram of integrity draws every fix.
#[test]
fn a_report_grows_with_its_rows_at_most() {
    let cost = |frames: u64| {
        let folder = tempfile::tempdir().unwrap();
        rows::write_rows(folder.path(), frames);
        let out = folder.path().join("report");
        let region = Region::new(ALLOCATIONS);
        let page = report(folder.path(), &out, Forms::ALL).unwrap().page;
        let written = region.change().bytes_allocated;
        assert!(verify(folder.path(), &out).unwrap().holds());
        let verified = region.change().bytes_allocated - written;
        [written, verified, fs::metadata(page).unwrap().len() as usize].map(|bytes| bytes as f64)
    };
    let (few, many) = (cost(1200), cost(4800));
    let [written, verified, page] = [0, 1, 2].map(|place| many[place] / few[place]);
    assert!(written < 4.0 && verified < 4.0 && page < 1.5, "{written:.2}, {verified:.2}, {page:.2} times");
}
