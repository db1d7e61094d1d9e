//! Run time of each registered component, with new ones included automatically.
//!
//! Images have 1024×768 px, settings are the defaults, and the components run warm on one thread: `cargo bench -p
//! seafix-vision --bench stages`.

mod common;

use std::time::Duration;

use common::scene::{rig, stereo, stones};
use criterion::{Criterion, criterion_group, criterion_main};
use seafix_component::{Choice, Registry};
use seafix_vision::{DESCRIPTORS, DETECTORS, Descriptors, FILTERS, MATCHERS, View, Workspace};

fn each<T: ?Sized>(registry: &'static Registry<T>, mut work: impl FnMut(&str, &T)) {
    for name in registry.names() {
        work(name, &registry.build(&Choice::named(name)).expect("valid defaults"));
    }
}

fn stages(criterion: &mut Criterion) {
    let size = [1024, 768];
    let [left, right] = stereo(&stones(size), size, 1.0);
    let rig = rig(size);
    let detector = DETECTORS.build(&Choice::named("harris")).expect("a registered detector");
    let keypoints = [&left, &right].map(|image| detector.detect(image));

    let mut group = criterion.benchmark_group("filter");
    each(&FILTERS, |name, filter| {
        let (mut work, mut image) = (Workspace::default(), left.clone());
        // The same image each time, since a filter changes its image.
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                image.copy_from(&left);
                filter.apply(&mut image, &mut work);
            });
        });
    });
    group.finish();

    let mut group = criterion.benchmark_group("detect");
    each(&DETECTORS, |name, detector| {
        let (mut work, mut found) = (Workspace::default(), Vec::new());
        group.bench_function(name, |bencher| bencher.iter(|| detector.detect_into(&left, &mut work, &mut found)));
    });
    group.finish();

    let mut group = criterion.benchmark_group("describe");
    each(&DESCRIPTORS, |name, descriptor| {
        let (mut work, mut described) = (Workspace::default(), Descriptors::default());
        group.bench_function(name, |bencher| {
            bencher.iter(|| descriptor.describe_into(&left, &keypoints[0], &mut work, &mut described));
        });
    });
    group.finish();

    let mut group = criterion.benchmark_group("match");
    each(&DESCRIPTORS, |kind, descriptor| {
        let described = [(&left, &keypoints[0]), (&right, &keypoints[1])].map(|(i, k)| descriptor.describe(i, k));
        let view = |image, i: usize| View { image, keypoints: &keypoints[i], descriptors: &described[i] };
        let (left, right) = (view(&left, 0), view(&right, 1));
        each(&MATCHERS, |name, matcher| {
            let (mut work, mut found) = (Workspace::default(), Vec::new());
            group.bench_function(format!("{name}/{kind}"), |bencher| {
                bencher.iter(|| matcher.match_into(&left, &right, &rig, &mut work, &mut found));
            });
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    targets = stages
}
criterion_main!(benches);
