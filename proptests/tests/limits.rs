//! Monte Carlo of the solvers beside the Cramér–Rao bound.

use std::time::Instant;

use seafix_component::Choice;
use seafix_proptests::monte_carlo::cell;
use seafix_referencing::SOLVERS;
use seafix_simulation::{Layout, Shape, VirtualRig};

/// The paper's cameras: the virtual one, and Karmin2.
fn cameras() -> [(&'static str, VirtualRig); 2] {
    [("virtual", VirtualRig::default()), ("karmin2", VirtualRig { size: [1600, 1200], focal: 1348.3, baseline: 0.25 })]
}

/// The table of all solvers over layouts and cameras:
/// `LIMITS_DRAWS=10000 LIMITS_SOLVERS=mahalanobis,kabsch cargo test --release -p seafix-proptests --test limits -- --ignored --nocapture table`.
#[test]
#[ignore = "prints a table; minutes"]
fn table() {
    let list = |key: &str, default: &str| -> Vec<String> {
        std::env::var(key).unwrap_or_else(|_| default.to_owned()).split(',').map(str::to_owned).collect()
    };
    let numbers = |key: &str, default: &str| -> Vec<f64> {
        list(key, default).iter().map(|word| word.parse().expect("a number")).collect()
    };
    let draws = numbers("LIMITS_DRAWS", "2000")[0] as u64;
    println!(
        "camera  shape   N   z    σ_px  σ_mod solver                m2/b   m3/b   bias  NEES   cover  σ_rot° refused m2 mm  m3 mm  µs"
    );
    for (name, rig) in cameras() {
        for shape in [Shape::Spread, Shape::Compact] {
            for &distance in &numbers("LIMITS_DISTANCES", "1.5,3.25,5") {
                for &points in &numbers("LIMITS_POINTS", "3,4,13,50") {
                    for &sigma_px in &numbers("LIMITS_SIGMAS", "0.1,0.5") {
                        for &model_sigma in &numbers("LIMITS_MODEL", "0") {
                            for solver in list("LIMITS_SOLVERS", "mahalanobis,stereo-reprojection") {
                                let settings = Layout {
                                    shape,
                                    points: points as usize,
                                    number: 0,
                                    distance,
                                    sigma_px,
                                    model_sigma,
                                    rig: rig.clone(),
                                };
                                if settings.place(1).is_err() {
                                    continue;
                                }
                                let built = SOLVERS.build(&Choice::named(&solver)).expect("a solver");
                                let start = Instant::now();
                                let c = cell(&*built, &settings, 20, draws, true);
                                let us = start.elapsed().as_secs_f64() * 1e6 / draws as f64;
                                println!(
                                    "{name:7} {shape:7?} {points:2} {distance:4} {sigma_px:5} {model_sigma:5} {solver:20} {:6.3} {:6.3} {:5.3} {:6.3} {:.4} {:6.3} {:5} {:7.3} {:7.3} {us:.1}",
                                    c.m2,
                                    c.m3,
                                    c.bias,
                                    c.nees,
                                    c.coverage,
                                    c.attitude_sigma.to_degrees(),
                                    c.refused,
                                    c.m2_rms * 1e3,
                                    c.m3_rms * 1e3
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}
