//! Mutates the corpus of parsers for a time or a number of inputs, and reports what breaks their law.

#![allow(clippy::print_stdout, reason = "a program that reports to a terminal")]

use std::{
    collections::BTreeMap,
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    process::ExitCode,
    sync::Mutex,
    time::{Duration, Instant},
};

use peak_alloc::PeakAlloc;
use seafix_fuzz::{PARSERS, Parser, corpus, mutated, rewrite_logs, small_log};

/// Counts the memory of the parsers.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Maximum memory of a parser (bytes), and its maximum time for one input.
const MAX_MEMORY: usize = 1 << 30;
const MAX_TIME: Duration = Duration::from_secs(20);

/// What an input broke.
#[derive(Debug, Default)]
struct Found {
    tried: u64,
    panics: BTreeMap<String, Vec<u64>>,
    large: Vec<u64>,
    slow: Vec<u64>,
    peak: usize,
    longest: Duration,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        // The corpus of logs is made from a log of a run.
        ["rewrite", from, to] => rewrite(from, to),
        ["one", name, seed] => one(name, seed.parse().unwrap_or(0)),
        _ => all(&arguments),
    }
}

fn rewrite(from: &str, to: &str) -> ExitCode {
    let written = small_log(from.as_ref()).and_then(|log| rewrite_logs(&log));
    match written.and_then(|log| fs::write(to, log).map_err(|error| error.to_string())) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failure(&error),
    }
}

fn failure(what: &str) -> ExitCode {
    println!("error: {what}");
    ExitCode::FAILURE
}

/// The value of an option, or `default`.
fn option(arguments: &[String], name: &str, default: u64) -> u64 {
    let place = arguments.iter().position(|argument| argument == name);
    place.and_then(|place| arguments.get(place + 1)?.parse().ok()).unwrap_or(default)
}

fn all(arguments: &[String]) -> ExitCode {
    let seconds = option(arguments, "--seconds", u64::MAX);
    let mutations = option(arguments, "--mutations", if seconds == u64::MAX { 10_000 } else { u64::MAX });
    let first = option(arguments, "--first", 0);
    let chosen = |parser: &&Parser| {
        let named = PARSERS.iter().any(|known| arguments.iter().any(|argument| argument == known.name));
        !named || arguments.iter().any(|argument| argument == parser.name)
    };
    // A panic is counted by its place; its message would fill the terminal.
    static PLACE: Mutex<String> = Mutex::new(String::new());
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map_or_else(String::new, ToString::to_string);
        PLACE.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone_from(&place);
    }));
    let mut broken = 0;
    for parser in PARSERS.iter().filter(chosen) {
        let found = match mutate(parser, first, mutations, Duration::from_secs(seconds.min(1 << 30)), &PLACE) {
            Ok(found) => found,
            Err(error) => return failure(&format!("{}: {error}", parser.name)),
        };
        broken += found.panics.len() + found.large.len() + found.slow.len();
        println!(
            "{:20} {:>9} inputs, at most {:>5} MB and {:>6.2} s an input",
            parser.name,
            found.tried,
            found.peak >> 20,
            found.longest.as_secs_f64()
        );
        for (place, seeds) in &found.panics {
            println!("  {} panics at {place}, for instance seed {}", seeds.len(), seeds[0]);
        }
        for (what, seeds) in [("over 1 GB", &found.large), ("over 20 s", &found.slow)] {
            if let Some(seed) = seeds.first() {
                println!("  {} inputs {what}, for instance seed {seed}", seeds.len());
            }
        }
    }
    if broken == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn mutate(parser: &Parser, first: u64, mutations: u64, time: Duration, place: &Mutex<String>) -> Result<Found, String> {
    let files = corpus(parser.name)?;
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    parser.prepare(folder.path()).map_err(|error| error.to_string())?;
    let (mut found, begun) = (Found::default(), Instant::now());
    while found.tried < mutations && begun.elapsed() < time {
        let seed = first + found.tried;
        // The corpus itself comes first.
        let bytes = match files.get(usize::try_from(seed).unwrap_or(usize::MAX)) {
            Some(file) => file.clone(),
            None => mutated(&files, seed),
        };
        MEMORY.reset_peak_usage();
        let before = Instant::now();
        let parsed = catch_unwind(AssertUnwindSafe(|| parser.parse(folder.path(), &bytes)));
        let (spent, peak) = (before.elapsed(), MEMORY.peak_usage());
        match parsed {
            Ok(written) => written.map_err(|error| error.to_string())?,
            Err(_) => {
                let place = place.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone();
                found.panics.entry(place).or_default().push(seed);
            }
        }
        if peak > MAX_MEMORY {
            found.large.push(seed);
        }
        if spent > MAX_TIME {
            found.slow.push(seed);
        }
        found.peak = found.peak.max(peak);
        found.longest = found.longest.max(spent);
        found.tried += 1;
    }
    Ok(found)
}

/// Parses one input again, with its panic; the input stays in the current folder.
fn one(name: &str, seed: u64) -> ExitCode {
    let Some(parser) = PARSERS.iter().find(|parser| parser.name == name) else {
        return failure(&format!("no parser `{name}`"));
    };
    let parsed = corpus(name).and_then(|files| {
        let bytes = files.get(seed as usize).cloned().unwrap_or_else(|| mutated(&files, seed));
        let kept = format!("{name}-{seed}");
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let prepared = fs::write(&kept, &bytes).and_then(|()| parser.prepare(folder.path()));
        prepared.and_then(|()| parser.parse(folder.path(), &bytes)).map_err(|error| error.to_string())
    });
    match parsed {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failure(&error),
    }
}
