//! The time of each search on a medium problem of each family, by the registry; a new search is included when it is
//! listed.
//!
//! One thread, candidates listed beforehand, default settings:
//! `cargo bench -p seafix-proptests --bench searches`, or `… --bench searches -- search/paper-scale` for one family, or
//! `… -- --quick`. A search of more than half a second runs once, and its time is printed.

#![allow(clippy::print_stdout, reason = "a bench prints")]

mod medium;

use std::{
    hint::black_box,
    time::{Duration, Instant},
};

use criterion::{Criterion, criterion_group, criterion_main};
use medium::MEDIUM;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_component::Choice;
use seafix_proptests::problems::Listed;
use seafix_referencing::SEARCHES;

/// Time above which a search runs once.
const LONG: Duration = Duration::from_millis(500);

fn searches(criterion: &mut Criterion) {
    for (place, (family, _)) in MEDIUM.iter().enumerate() {
        let listed = Listed::new(medium::problem(place));
        let problem = listed.problem();
        let mut group = criterion.benchmark_group(format!("search/{}", family.name()));
        for name in SEARCHES.names() {
            let search = SEARCHES.build(&Choice::named(name)).expect("the defaults are in range");
            // Every call has the same stream, so that one run is timed, not a mixture.
            let run = || search.search(black_box(&problem), &mut ChaCha8Rng::seed_from_u64(1));
            let started = Instant::now();
            let _ = black_box(run());
            let took = started.elapsed();
            if took > LONG {
                println!("search/{}/{name}: {:.1} s, run once", family.name(), took.as_secs_f64());
                continue;
            }
            group.bench_function(name, |bench| bench.iter(|| black_box(run())));
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1));
    targets = searches
}
criterion_main!(benches);
