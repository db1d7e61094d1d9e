//! Equal seeds give equal bytes for any number of threads, in debug and release, on every platform.

use std::path::Path;

use seafix_simulation::{
    Mission, PlannedMission, RigPlan,
    optics::{Port, PortKind, Water},
    scene::Changes,
    vehicle::Current,
};
use seafix_vision::Threads;

/// A small dive with every effect: turbid water, snow, a decentred dome, current, growth, rolling shutter.
fn full() -> Mission {
    let mut mission = Mission {
        frames: 2,
        rate: 0.5,
        start: 3.0,
        rig: RigPlan { size: [160, 120], focal: 78.0, ..RigPlan::default() },
        water: Water { attenuation: 0.3, ambient: 0.01, snow: 200.0, ..Water::default() },
        current: Current { speed: 0.1, sigma: 0.02, ..Current::default() },
        changes: Changes { growth: 0.3, rounding: 0.02, silt: 0.03, shift: 0.1, occluders: 2, ..Changes::default() },
        ..Mission::default()
    };
    mission.rig.port = Port { kind: PortKind::Dome, offset: [0.0, 0.001, 0.004], ..Port::default() };
    mission.imager.readout_ms = 10.0;
    mission.imager.bits = 12;
    mission
}

/// FNV-1a hash of the bits of all images and points of a dive.
fn digest(mission: &Mission, threads: Threads) -> u64 {
    let plan = mission.plan(7, 0, Path::new("")).expect("the mission can be planned");
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    let mut take = |bits: u64| hash = (hash ^ bits).wrapping_mul(0x100_0000_01B3);
    for index in 0..plan.len() {
        let instant = plan.instant(index);
        let (left, right, _) = instant.render(threads);
        left.pixels().iter().chain(right.pixels()).for_each(|grey| take(u64::from(grey.to_bits())));
        for point in instant.points() {
            point.position.at.coords.iter().for_each(|x| take(x.to_bits()));
        }
    }
    hash
}

#[test]
fn a_dive_has_the_bytes_that_it_always_had() {
    // Keeps the surface textures, which dives of one seed share and which take most of the time.
    let _kept = full().plan(7, 0, Path::new("")).unwrap();
    // Every build, debug or release, gives this hash; it changes only with the renderer and the triangulation.
    let found = digest(&full(), Threads::One);
    assert_eq!(found, 0x12D0_5A55_3BFB_807D, "0x{found:016X}");
    for threads in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| digest(&full(), Threads::Pool)), found, "{threads} threads");
    }
}

#[test]
fn another_seed_is_another_dive() {
    let mission = full();
    let plan = |seed, dive| mission.plan(seed, dive, Path::new("")).unwrap();
    let image = |plan: &PlannedMission| plan.instant(0).render(Threads::One).0;
    let kept = plan(7, 0);
    let first = image(&kept);
    assert_ne!(image(&plan(8, 0)), first);
    assert_ne!(image(&plan(7, 1)), first);
}
