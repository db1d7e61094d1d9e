//! Cost of a solver call relative to Kabsch and to Eigen's `umeyama`: time, instructions and allocations.
//!
//! Thirteen points, one thread, minima of interleaved repetitions: `cargo bench -p seafix-referencing --bench cost`.
//! Instructions are counted if `valgrind` is installed. `umeyama` is compiled with `c++ -O3` if Eigen's headers are in
//! `EIGEN_INCLUDE` or in `/usr/include/eigen3`.

#![allow(clippy::print_stdout)]

mod common;

use std::{
    alloc::System,
    hint::black_box,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use common::{choices, points, rig};
use seafix_referencing::{Observations, SOLVERS};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

fn main() {
    let rig = rig();
    let data = Observations { points: points(&rig, 13), edges: Vec::new(), rig: Some(&rig) };
    let choices = choices();
    let solvers: Vec<_> = choices.iter().map(|(_, choice)| SOLVERS.build(choice).expect("in range")).collect();
    // The child process under valgrind: `calls` calls of one solver.
    let given: Vec<String> = std::env::args().collect();
    if let Some(place) = given.iter().position(|word| word == "--calls") {
        let [which, calls] = [1, 2].map(|i| given[place + i].parse::<usize>().expect("a number"));
        for _ in 0..calls {
            let _ = black_box(solvers[which].solve(black_box(&data)));
        }
        return;
    }
    // The number of calls of each solver in a quarter of a millisecond, at most fifty.
    let calls: Vec<u32> = solvers
        .iter()
        .map(|solver| {
            let start = Instant::now();
            let _ = black_box(solver.solve(black_box(&data)));
            (250e-6 / start.elapsed().as_secs_f64()).clamp(1.0, 50.0) as u32
        })
        .collect();
    let mut min = vec![f64::INFINITY; solvers.len()];
    let mut eigen = f64::INFINITY;
    let umeyama = umeyama();
    for round in 0..200 {
        for ((solver, min), &calls) in solvers.iter().zip(&mut min).zip(&calls) {
            let start = Instant::now();
            for _ in 0..calls {
                let _ = black_box(solver.solve(black_box(&data)));
            }
            *min = min.min(start.elapsed().as_secs_f64() * 1e9 / f64::from(calls));
        }
        if let Some(program) = umeyama.as_ref().filter(|_| round % 40 == 0) {
            eigen = eigen.min(nanoseconds(program));
        }
    }
    let of = |name: &str| choices.iter().position(|(known, _)| known == name).expect("it is listed");
    let kabsch = of("kabsch");
    let instructions: Vec<Option<f64>> =
        (0..solvers.len()).map(|which| instructions(which, 20 * calls[which] as usize)).collect();
    println!(
        "{:32} {:>9} {:>7} {:>12} {:>7} {:>11}",
        "solver", "ns", "kabsch", "instructions", "kabsch", "allocations"
    );
    for (which, (name, _)) in choices.iter().enumerate() {
        let (count, fraction) = match (instructions[which], instructions[kabsch]) {
            (Some(count), Some(unit)) => (format!("{count:.0}"), format!("{:.2}", count / unit)),
            _ => ("-".to_owned(), "-".to_owned()),
        };
        let region = Region::new(ALLOCATOR);
        let _ = black_box(solvers[which].solve(black_box(&data)));
        let allocations = region.change().allocations;
        let (ns, ratio) = (min[which], min[which] / min[kabsch]);
        println!("{name:32} {ns:9.0} {ratio:7.2} {count:>12} {fraction:>7} {allocations:>11}");
    }
    match umeyama {
        Some(_) => println!("Eigen's umeyama: {eigen:.0} ns; kabsch is {:.2} of it", min[kabsch] / eigen),
        None => println!("Eigen's umeyama: no headers in EIGEN_INCLUDE or /usr/include/eigen3, or no compiler"),
    }
}

/// The instructions of one call: the difference between ten calls and ten plus `more`, divided by `more`.
fn instructions(which: usize, more: usize) -> Option<f64> {
    let count = |calls: usize| -> Option<f64> {
        let output = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(std::env::current_exe().ok()?)
            .args(["--calls", &which.to_string(), &calls.to_string()])
            .output()
            .ok()?;
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        message.lines().find_map(|line| line.split("Collected :").nth(1)?.trim().parse().ok())
    };
    Some((count(10 + more)? - count(10)?) / more as f64)
}

/// The compiled reference program.
fn umeyama() -> Option<PathBuf> {
    let include = std::env::var("EIGEN_INCLUDE").unwrap_or_else(|_| "/usr/include/eigen3".to_owned());
    if !Path::new(&include).join("Eigen/Dense").exists() {
        return None;
    }
    let program = std::env::temp_dir().join(format!("seafix-umeyama-{}", std::process::id()));
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/umeyama.cpp");
    let built = Command::new("c++").args(["-O3", "-DNDEBUG", "-I", &include, source, "-o"]).arg(&program).status();
    built.ok()?.success().then_some(program)
}

fn nanoseconds(program: &Path) -> f64 {
    let output = Command::new(program).output().expect("it was just compiled");
    let message = String::from_utf8_lossy(&output.stdout).into_owned();
    message.split_whitespace().next().and_then(|word| word.parse().ok()).expect("it prints a number first")
}
