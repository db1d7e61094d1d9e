//! A test that a warm front end allocates nothing.

use std::{alloc::System, env, process::Command};

use seafix_component::Choice;
use seafix_vision::{
    DESCRIPTORS, DETECTORS, FrontEnd, FrontEndOutput, LOCATORS, MATCHERS, REFINEMENTS, TRIANGULATORS, Threads,
};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

use crate::scenes;

#[global_allocator]
static ALLOCATIONS: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Whether this process runs `test` alone; otherwise a child process runs it and passes.
///
/// Counters are per process, so a concurrent test would be counted.
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

/// The third pair of images causes no allocation, with each component in a pipeline of defaults.
///
/// The first two pairs allocate the buffers. Seen to fail when the band's pairs are collected into a new vector.
#[test]
fn a_warm_pair_allocates_nothing() {
    if !alone("allocations::a_warm_pair_allocates_nothing") {
        return;
    }
    let rig = scenes::rig([0.2, 0.0, 0.0], [0.0; 3], &[]);
    let [left, right] = scenes::images(&rig, 60.0, 0.0);
    let default = ["harris", "corner", "surf", "epipolar-band", "direct", "optimal"];
    let mut pipelines = Vec::new();
    let names = [
        DETECTORS.names().collect::<Vec<_>>(),
        LOCATORS.names().collect(),
        DESCRIPTORS.names().collect(),
        MATCHERS.names().collect(),
        REFINEMENTS.names().collect(),
        TRIANGULATORS.names().collect(),
    ];
    for (stage, names) in names.into_iter().enumerate() {
        for name in names {
            let mut pipeline = default;
            pipeline[stage] = name;
            pipelines.push(pipeline);
        }
    }
    for pipeline in pipelines {
        let [detector, locator, descriptor, matcher, refinement, triangulator] = pipeline.map(Choice::named);
        let front_end = FrontEnd {
            filters: Vec::new(),
            detector: DETECTORS.build(&detector).expect("a valid detector"),
            locator: LOCATORS.build(&locator).expect("a valid locator"),
            descriptor: DESCRIPTORS.build(&descriptor).expect("a valid descriptor"),
            matcher: MATCHERS.build(&matcher).expect("a valid matcher"),
            refinement: REFINEMENTS.build(&refinement).expect("a valid refinement"),
            triangulator: TRIANGULATORS.build(&triangulator).expect("a valid triangulator"),
        };
        let mut front_end_output = FrontEndOutput::new(Threads::One);
        (0..2).for_each(|_| front_end.run(&left, &right, &rig, &mut front_end_output));
        let region = Region::new(ALLOCATIONS);
        front_end.run(&left, &right, &rig, &mut front_end_output);
        let change = region.change();
        assert_eq!((change.allocations, change.reallocations), (0, 0), "{pipeline:?}");
        // These images have no corner of a chequerboard or a box.
        let made = ["l-corner", "x-corner"].contains(&pipeline[0]);
        assert!(made || front_end_output.cloud.len() > 20, "{pipeline:?}: {}", front_end_output.cloud.len());
    }
}
