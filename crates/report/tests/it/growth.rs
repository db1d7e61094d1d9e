//! The growth of time, memory and page size of a report with its rows.

use std::{alloc::System, env, fs, process::Command};

use seafix_report::{Forms, report, verify};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

use crate::rows;

#[global_allocator]
static ALLOCATIONS: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Whether this process runs `test` alone; otherwise it runs `test` in another process.
///
/// The allocation counters belong to the process, so a concurrent test would be counted too.
fn alone(test: &str) -> bool {
    if env::var_os("SEAFIX_ALONE").is_some() {
        return true;
    }
    let mut alone = Command::new(env::current_exe().unwrap());
    alone.args([test, "--exact", "--test-threads=1"]).env("SEAFIX_ALONE", "1");
    let output = alone.output().unwrap();
    let message = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && message.contains("1 passed"), "{message}");
    false
}

/// Four times the rows cost at most four times the memory, and the page hardly grows.
///
/// This holds for a report and for its verification.
///
/// Seen to fail where the Stanford diagram plots every fix.
#[test]
fn a_report_grows_with_its_rows_at_most() {
    if !alone("growth::a_report_grows_with_its_rows_at_most") {
        return;
    }
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
