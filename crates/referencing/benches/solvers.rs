//! Run time of each registered solver.
//!
//! Thirteen points, one thread: `cargo bench -p seafix-referencing --bench solvers`.

mod common;

use std::{hint::black_box, time::Duration};

use common::{choices, points, rig};
use criterion::{Criterion, criterion_group, criterion_main};
use seafix_referencing::{Observations, SOLVERS};

fn solvers(criterion: &mut Criterion) {
    let rig = rig();
    let data = Observations { points: points(&rig, 13), edges: Vec::new(), rig: Some(&rig) };
    let mut group = criterion.benchmark_group("solver");
    for (name, choice) in choices() {
        let solver = SOLVERS.build(&choice).expect("the settings are in range");
        group.bench_function(name, |bench| bench.iter(|| black_box(solver.solve(black_box(&data)))));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
    targets = solvers
}
criterion_main!(benches);
