//! Time and memory of a report over the number of rows: `cargo bench -p seafix-report --bench rows -- 1000000`.
//!
//! The run has two logs with half of the rows each, every row logged. Real runs of this size log a sample of their
//! rows.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints its results and may panic")]

#[path = "../tests/it/made_up.rs"]
#[expect(dead_code, reason = "tests use the rest")]
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
    println!("report of {count} rows: {:.1} s, peak memory {}", start.elapsed().as_secs_f64(), memory());
    let start = Instant::now();
    let verified = verify(folder.path(), &out).unwrap();
    assert!(verified.holds(), "{verified:?}");
    let seconds = start.elapsed().as_secs_f64();
    println!("verification of {} numbers: {seconds:.1} s, peak memory {}", verified.numbers, memory());
}

/// The peak memory of the process, from `/proc` of Linux.
fn memory() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let max = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    max.map_or_else(|| "memory unknown".to_owned(), |max| max.trim().to_owned())
}
