//! Time and memory of a report over its rows: `cargo bench -p seafix-report --bench rows -- 1000000`.
//!
//! Two logs with half of the rows each, every row logged: more than a run of Seafix logs, which keeps a sample of so many.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement says what it measures")]

#[path = "../tests/it/made_up.rs"]
#[expect(dead_code, reason = "tests want the rest")]
mod made_up;
#[path = "../tests/it/rows.rs"]
mod rows;

use std::{fs, time::Instant};

use seafix_report::{Forms, report, verify};

fn main() {
    let count = std::env::args().filter_map(|word| word.parse::<u64>().ok()).next().unwrap_or(100_000);
    let folder = tempfile::tempdir().unwrap();
    rows::write_rows(folder.path(), count / 2);
    let out = folder.path().join("report");
    let start = Instant::now();
    report(folder.path(), &out, Forms::ALL).unwrap();
    println!("report of {count} rows: {:.1} s, at most {} so far", start.elapsed().as_secs_f64(), memory());
    let start = Instant::now();
    let verified = verify(folder.path(), &out).unwrap();
    assert!(verified.holds(), "{verified:?}");
    let seconds = start.elapsed().as_secs_f64();
    println!("verification of {} numbers: {seconds:.1} s, at most {} so far", verified.numbers, memory());
}

/// The most memory the process had, as Linux says.
fn memory() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let max = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    max.map_or_else(|| "memory unknown".to_owned(), |max| max.trim().to_owned())
}
