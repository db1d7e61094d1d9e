//! Monte Carlo of the solvers beside the Cramér–Rao bound.

use std::time::Instant;

use seafix_component::Choice;
use seafix_proptests::monte_carlo::{cell, observations};
use seafix_referencing::{Observations, SOLVERS};
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

/// P46, P47, short form: over 2000 draws of a spread layout the two solvers that weigh by covariance have m2 and m3
/// within 6 % of the Cramér–Rao bound, and a NEES whose mean is six to four of its own standard deviations. The long
/// form is the table below with 10 000 draws.
#[test]
fn weighed_solvers_reach_the_bound() {
    for (_, rig) in cameras() {
        for name in ["mahalanobis", "stereo-reprojection"] {
            let solver = SOLVERS.build(&Choice::named(name)).expect("a solver");
            let settings = Layout { sigma_px: 0.5, rig: rig.clone(), ..Layout::default() };
            let found = cell(&*solver, &settings, 20, 2000, true);
            for ratio in [found.m2, found.m3] {
                assert!((0.94..1.06).contains(&ratio), "{name}: {found:?}");
            }
            assert!((found.nees - 6.0).abs() < 4.0 * (12.0 / 2000.0_f64).sqrt(), "{name}: {found:?}");
        }
    }
}

/// Cost of a call beside kabsch, 13 points, minima of interleaved repetitions:
/// `cargo test --release -p seafix-proptests --test limits -- --ignored --nocapture costs`.
#[test]
#[ignore = "prints times"]
fn costs() {
    let layout = Layout { rig: cameras()[1].1.clone(), ..Layout::default() }.place(1).expect("a layout");
    let data = Observations { points: observations(&layout, 1, 0.0).expect("points"), rig: Some(&layout.rig) };
    let mut choices: Vec<Choice> = SOLVERS.names().map(Choice::named).collect();
    choices.push(Choice::named("triad").with("choose", "first"));
    choices.push(Choice::named("stereo-reprojection").with("starts", 1));
    let solvers: Vec<_> = choices.iter().map(|choice| SOLVERS.build(choice).expect("a solver")).collect();
    let mut least = vec![f64::INFINITY; solvers.len()];
    for _ in 0..200 {
        for (solver, least) in solvers.iter().zip(&mut least) {
            let start = Instant::now();
            for _ in 0..50 {
                std::hint::black_box(solver.solve(std::hint::black_box(&data)).expect("a pose"));
            }
            *least = least.min(start.elapsed().as_secs_f64() * 1e6 / 50.0);
        }
    }
    let kabsch = least[choices.iter().position(|choice| choice.name == "kabsch").expect("kabsch")];
    for (choice, us) in choices.iter().zip(&least) {
        println!("{:20} {:8.3} µs {:6.2} kabsch  {}", choice.name, us, us / kabsch, choice.settings);
    }
}
