//! The number of instructions of each search on the problems of `searches`, by the registry. Load of the machine does
//! not affect it.
//!
//! `valgrind --tool=callgrind` counts them and must be installed. The command takes some minutes:
//! `cargo bench -p seafix-proptests --bench instructions`, or `… -- paper-scale` for one family. A search of more than
//! 150 ms is not counted, since it would take many seconds. The last row is a complete fix by the defaults: search,
//! solver, and the complete answer.

#![allow(clippy::print_stdout, reason = "a bench prints")]

mod medium;

use std::{
    hint::black_box,
    process::Command,
    time::{Duration, Instant},
};

use medium::MEDIUM;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_component::Choice;
use seafix_proptests::problems::Listed;
use seafix_referencing::{Acceptance, SEARCHES, SOLVERS, compute_fix};

/// Maximum time of a counted search.
const LONG: Duration = Duration::from_millis(150);
/// Number of calls before the counted ones, and of these; the first calls fill caches.
const BEFORE: usize = 1;
const COUNTED: usize = 2;
/// The search and solver of the complete fix, and the name of its row.
const DEFAULT: (&str, &str, &str) = ("rigid-consensus", "mahalanobis", "a complete fix");

fn main() {
    let given: Vec<String> = std::env::args().collect();
    // The child process under valgrind: a number of calls, nothing else.
    if let Some(place) = given.iter().position(|word| word == "--calls") {
        let call = prepared(&given[place + 1], given[place + 2].parse().expect("a number"));
        let calls: usize = given[place + 3].parse().expect("a number");
        (0..calls).for_each(|_| call());
        return;
    }
    let asked: Vec<usize> =
        (0..MEDIUM.len()).filter(|&i| given.iter().any(|word| word == MEDIUM[i].0.name())).collect();
    let families = if asked.is_empty() { (0..MEDIUM.len()).collect() } else { asked };
    println!("Thousands of instructions a call.\n");
    let names: Vec<&str> = families.iter().map(|&i| MEDIUM[i].0.name()).collect();
    println!("| | {} |\n|---|{}", names.join(" | "), "---|".repeat(names.len()));
    for row in SEARCHES.names().chain([DEFAULT.2]) {
        let cells: Vec<String> = families.iter().map(|&family| cell(row, family)).collect();
        println!("| {} | {} |", if row == DEFAULT.2 { row.to_owned() } else { format!("`{row}`") }, cells.join(" | "));
    }
}

/// One call of a row on the problem of a family.
fn prepared(row: &str, family: usize) -> impl Fn() + use<> {
    let listed = Listed::new(medium::problem(family));
    let name = if row == DEFAULT.2 { DEFAULT.0 } else { row };
    let search = SEARCHES.build(&Choice::named(name)).expect("the defaults are in range");
    let solver = SOLVERS.build(&Choice::named(DEFAULT.1)).expect("the defaults are in range");
    let full = row == DEFAULT.2;
    move || {
        let problem = listed.problem();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        if full {
            black_box(compute_fix(black_box(&problem), &*search, &*solver, &Acceptance::default(), None, &mut rng));
        } else {
            let _ = black_box(search.search(black_box(&problem), &mut rng));
        }
    }
}

fn cell(row: &str, family: usize) -> String {
    let call = prepared(row, family);
    call();
    let started = Instant::now();
    call();
    if started.elapsed() > LONG {
        return "–".to_owned();
    }
    let counts = [BEFORE, BEFORE + COUNTED].map(|calls| instructions(row, family, calls));
    match counts {
        [Some(before), Some(all)] => format!("{:.0}", (all - before) / COUNTED as f64 / 1e3),
        _ => "no valgrind".to_owned(),
    }
}

/// The number of instructions of a process with this number of calls.
fn instructions(row: &str, family: usize, calls: usize) -> Option<f64> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(std::env::current_exe().ok()?)
        .args(["--calls", row, &family.to_string(), &calls.to_string()])
        .output()
        .ok()?;
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    message.lines().find_map(|line| line.split("Collected :").nth(1)?.trim().parse().ok())
}
