//! Monte Carlo of the solvers against the Cramér–Rao bound.

use std::time::Instant;

use seafix_component::Choice;
use seafix_evaluation::{position_error, transfer_rms};
use seafix_proptests::monte_carlo::{
    Asked, Cell, bound, cell, cell_of, cell_where, is_meaningful, observations, paired, pixel_chi2, placed,
};
use seafix_referencing::{Observations, SOLVERS};
use seafix_simulation::{Layout, Shape, VirtualRig};

/// The paper's cameras: the virtual one, and Karmin2.
fn cameras() -> [(&'static str, VirtualRig); 2] {
    [("virtual", VirtualRig::default()), ("karmin2", VirtualRig { size: [1600, 1200], focal: 1348.3, baseline: 0.25 })]
}

/// The table of all solvers over layouts and cameras; `LIMITS_DRAWS`, `LIMITS_SOLVERS` (`mahalanobis,kabsch`),
/// `LIMITS_DISTANCES`, `LIMITS_POINTS`, `LIMITS_SIGMAS` and `LIMITS_MODEL` select its cells.
#[test]
#[ignore = "table"]
fn table() {
    let list = |key: &str, default: &str| -> Vec<String> {
        std::env::var(key).unwrap_or_else(|_| default.to_owned()).split(',').map(str::to_owned).collect()
    };
    let numbers = |key: &str, default: &str| -> Vec<f64> {
        list(key, default).iter().map(|word| word.parse().expect("a number")).collect()
    };
    let draws = numbers("LIMITS_DRAWS", "2000")[0] as u64;
    println!(
        "camera  shape   N   z    σ_px  σ_mod solver                tre/b  pos/b  bias  NEES   cover  σ_rot° reject. TRE mm pos mm  µs"
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
                                let built = build(&solver);
                                let start = Instant::now();
                                let c = cell(&*built, &settings, 20, draws, true);
                                let us = start.elapsed().as_secs_f64() * 1e6 / draws as f64;
                                println!(
                                    "{name:7} {shape:7?} {points:2} {distance:4} {sigma_px:5} {model_sigma:5} {solver:20} {:6.3} {:6.3} {:5.3} {:6.3} {:.4} {:6.3} {:5} {:7.3} {:7.3} {us:.1}",
                                    c.tre,
                                    c.position,
                                    c.bias,
                                    c.nees,
                                    c.coverage,
                                    c.attitude_sigma.to_degrees(),
                                    c.rejected,
                                    c.tre_rms * 1e3,
                                    c.position_rms * 1e3
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}

/// P46, P47, short form: over 2000 draws of a spread layout the two weighted solvers have target registration error and
/// position error within 6 % of the Cramér–Rao bound, and a mean NEES within four of its standard deviations of six.
/// The long form is the table below with 10 000 draws.
///
/// Seen to fail when covariances are a fifth too small, and when the right image is ignored.
#[test]
fn weighted_solvers_reach_the_bound() {
    for (_, rig) in cameras() {
        for name in ["mahalanobis", "stereo-reprojection"] {
            let solver = SOLVERS.build(&Choice::named(name)).expect("a solver");
            let settings = Layout { sigma_px: 0.5, rig: rig.clone(), ..Layout::default() };
            let found = cell(&*solver, &settings, 20, 2000, true);
            for ratio in [found.tre, found.position] {
                assert!((0.94..1.06).contains(&ratio), "{name}: {found:?}");
            }
            assert!((found.nees - 6.0).abs() < 4.0 * (12.0 / 2000.0_f64).sqrt(), "{name}: {found:?}");
        }
    }
}

/// All cells: camera, shape, distance, pixel noise.
fn cells(points: usize) -> Vec<(String, Layout)> {
    let mut all = Vec::new();
    for (camera, rig) in cameras() {
        for shape in [Shape::Spread, Shape::Compact] {
            for distance in [1.5, 3.25, 5.0] {
                for sigma_px in [0.1, 0.5] {
                    let settings =
                        Layout { shape, points, number: 0, distance, sigma_px, model_sigma: 0.0, rig: rig.clone() };
                    if settings.place(1).is_ok() {
                        all.push((format!("{camera} {shape:?} N {points} {distance} m {sigma_px} px"), settings));
                    }
                }
            }
        }
    }
    all
}

/// Target registration error and position error of a solver (mm), and half a unit of the last digit of each.
type Printed = [(f64, f64); 2];

/// An independent table of errors of thirteen points over the view at a disparity noise of 0.3 px: camera, distance
/// (m), and for `triad`, `kabsch` and maximum likelihood the RMS errors of model points and of the camera's position
/// (mm), as printed, with half a unit of the last digit.
#[rustfmt::skip]
const ELSEWHERE: [(usize, f64, [Printed; 3]); 3] = [
    (1, 1.75, [[(2.8, 0.05), (10.5, 0.05)], [(1.5, 0.05), (5.9, 0.05)], [(0.32, 0.005), (1.2, 0.05)]]),
    (1, 3.25, [[(9.8, 0.05), (35.0, 0.5)], [(5.1, 0.05), (20.0, 0.5)], [(0.61, 0.005), (2.2, 0.05)]]),
    (0, 5.0, [[(72.0, 0.5), (154.0, 0.5)], [(34.0, 0.5), (85.0, 0.5)], [(1.9, 0.05), (4.3, 0.05)]]),
];

/// Figure 2: the table of [`ELSEWHERE`] is reproduced within the Monte Carlo error of twenty layouts: errors differ by
/// a tenth from layout to layout, their mean by two or three per cent. 100 layouts, 20 draws each; 500 in the long
/// form.
///
/// The evaluated model points are other points of the view than those of the pose. Evaluated at the points of the pose,
/// as in all other figures, least squares have an error smaller by an eighth, which no choice of layouts explains: seen
/// to fail there, at 7 to 13 standard errors.
#[test]
fn the_table_of_others_is_reproduced() {
    reproduces(100);
}

#[test]
#[ignore = "long: 500 layouts"]
fn the_table_of_others_is_reproduced_by_many_layouts() {
    reproduces(500);
}

fn reproduces(layouts: u64) {
    const USED: usize = 13;
    let mut missed = Vec::new();
    for (camera, distance, columns) in ELSEWHERE {
        let (camera, rig) = cameras()[camera].clone();
        for (solver, expected) in ["triad", "kabsch", "stereo-reprojection"].iter().zip(columns) {
            let built = build(solver);
            // For every draw, the squared target registration error of other points and of the used ones, and the
            // squared position error (mm²).
            let layout = |number: u64| -> Vec<[f64; 3]> {
                let settings = Layout {
                    points: USED + 40,
                    number,
                    distance,
                    sigma_px: 0.3 / 2f64.sqrt(),
                    rig: rig.clone(),
                    ..Layout::default()
                };
                let placed = settings.place(2).expect("the layout can be placed");
                let truth = &placed.object_from_camera;
                let draw = |draw| {
                    let mut points = observations(&placed, draw, 0.0).expect("every draw can be triangulated");
                    points.truncate(USED);
                    let pose = built
                        .solve(&Observations { points, edges: Vec::new(), rig: Some(&placed.rig) })
                        .expect("thirteen points");
                    let (used, others) = placed.model.split_at(USED);
                    let rms = |points| transfer_rms(&pose, truth, points).expect("there are points");
                    [rms(others), rms(used), position_error(&pose, truth)].map(|error| (error * 1e3).powi(2))
                };
                (0..20).map(draw).collect()
            };
            let squares: Vec<Vec<[f64; 3]>> = (0..layouts).map(layout).collect();
            let mut line = format!("{camera:7} {distance} m {solver:19}");
            for (which, name) in ["TRE, other points", "TRE, points used", "position"].iter().enumerate() {
                let each: Vec<(f64, f64)> =
                    squares.iter().map(|draws| moments(draws.iter().map(|draw| draw[which]))).collect();
                let (mean, variance) = moments(each.iter().map(|(mean, _)| *mean));
                // The variance between layouts, without that of twenty draws.
                let between = variance - moments(each.iter().map(|(_, variance)| variance / 20.0)).0;
                let rms = mean.sqrt();
                let error = (between.max(0.0) / 20.0).sqrt() / (2.0 * rms);
                let (printed, half) = expected[usize::from(which == 2)];
                let off = (printed - rms) / error.hypot(half / 3f64.sqrt());
                line += &format!(" | {name} {rms:.3} ± {error:.3}, {printed} ({off:+.1})");
                if which != 1 && off.abs() > 3.29 {
                    missed.push(format!("{camera} {distance} m {solver} {name}: {rms} {printed}"));
                }
            }
            println!("{line}");
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Mean and variance.
fn moments(all: impl ExactSizeIterator<Item = f64> + Clone) -> (f64, f64) {
    let n = all.len() as f64;
    let mean = all.clone().sum::<f64>() / n;
    (mean, all.map(|one| (one - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

/// A solver by its name, optionally followed by a loss.
fn build(name: &str) -> Box<dyn seafix_referencing::Solver> {
    let choice = match name.split_once(' ') {
        Some((name, loss)) => Choice::named(name).with("loss", loss),
        None => Choice::named(name),
    };
    SOLVERS.build(&choice).expect("a solver")
}

/// The consistency of a cell: mean NEES within [5.89, 6.11] if the attitude is known to 1°, else within [5.8, 6.3].
fn is_consistent(found: &Cell) -> bool {
    let range = if found.attitude_sigma <= 1f64.to_radians() { 5.89..=6.11 } else { 5.8..=6.3 };
    range.contains(&found.nees)
}

/// P46, P47, figures 1 and 4: in every cell with at least four points, target registration error and position error of
/// both weighted solvers are at most 1.05 × the bound, and their NEES is that of χ²₆, over 10 000 draws.
#[test]
#[ignore = "long: 96 cells"]
fn every_cell_reaches_the_bound() {
    let mut missed = Vec::new();
    for points in [4, 5, 13, 50] {
        for (name, settings) in cells(points) {
            for solver in ["mahalanobis", "stereo-reprojection"] {
                let c = cell(&*build(solver), &settings, 20, 10_000, true);
                let line = format!(
                    "{name} {solver}: TRE {:.3} position {:.3} NEES {:.3} cover {:.4} attitude {:.2}°",
                    c.tre,
                    c.position,
                    c.nees,
                    c.coverage,
                    c.attitude_sigma.to_degrees()
                );
                println!("{line}");
                if c.tre > 1.05 || c.position > 1.05 || !is_consistent(&c) || !(0.9428..=0.9571).contains(&c.coverage) {
                    missed.push(line);
                }
            }
        }
    }
    assert!(missed.is_empty(), "{} missed:\n{}", missed.len(), missed.join("\n"));
}

/// Figure 1 for three points: several starts reach at most 1.25 × the bound in every cell, over the layouts with a
/// meaningful bound ([`is_meaningful`]), 10 000 draws.
#[test]
#[ignore = "long: 48 cells"]
fn three_points_in_every_cell() {
    for (name, settings) in cells(3) {
        for solver in ["p3p-stereo", "stereo-reprojection"] {
            let c = three_points(&name, solver, &settings, 10_000);
            println!(
                "{name} {solver}: {} of 20 layouts, TRE {:.3} position {:.3} NEES {:.3}",
                c.layouts, c.tre, c.position, c.nees
            );
        }
    }
}

/// The same in two cells, short: one with a bound that is always meaningful, and one where it often is not. Seen to
/// fail with all layouts (position error 4.9 × the bound).
#[test]
fn three_points_reach_the_bound_where_it_is_meaningful() {
    let rig = cameras()[0].1.clone();
    for (shape, sigma_px) in [(Shape::Spread, 0.1), (Shape::Compact, 0.5)] {
        let settings = Layout { shape, points: 3, sigma_px, rig: rig.clone(), ..Layout::default() };
        for solver in ["p3p-stereo", "stereo-reprojection"] {
            three_points(&format!("{shape:?}"), solver, &settings, 2000);
        }
    }
}

/// Four compact points of any layout: some are ambiguous in tilt, and some have a nonlinear likelihood. Alternatives at
/// a confidence of 0.999 are detected and counted. Over the answers covariances are consistent, the target registration
/// error reaches the bound, and the position error reaches the prediction of the nonlinear likelihood of the exact
/// pixels ([`monte_carlo::foreseen`](seafix_proptests::monte_carlo::foreseen)), and the bound itself if it is
/// meaningful ([`is_meaningful`]). 10 000 draws for each seed and distance.
///
/// Seen to fail with first-order covariances (coverage 0.941 for seeds 8 and 11 at 5 m), and when alternatives are not
/// examined (0.915, NEES 110).
#[test]
#[ignore = "long: 44 cells"]
fn four_compact_points_of_any_seed() {
    let missed: Vec<String> =
        (1..=11).flat_map(|seed| [3.25, 5.0].map(|at| four_compact(seed, at, 500))).flatten().collect();
    assert!(missed.is_empty(), "{} missed:\n{}", missed.len(), missed.join("\n"));
}

/// Three compact points, many of whose layouts are ambiguous in tilt: alternatives are reported, covariances are
/// consistent over the answers, and errors are within 1.25 of the bound of all layouts. 10 000 draws for each distance.
#[test]
#[ignore = "long: 6 cells"]
fn three_compact_points_report_what_is_as_likely() {
    let missed: Vec<String> = [1.5, 3.25, 5.0].into_iter().flat_map(|distance| three_compact(distance, 500)).collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// The same at 5 m, short.
#[test]
fn three_compact_points_far_away_are_distinguished_or_known() {
    let missed = three_compact(5.0, 100);
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// The failures of three compact points, over `draws` draws of each of twenty layouts.
#[allow(clippy::print_stdout, reason = "the long form prints its cells")]
fn three_compact(distance: f64, draws: u64) -> Vec<String> {
    let rig = cameras()[0].1.clone();
    let settings = Layout { shape: Shape::Compact, points: 3, distance, sigma_px: 0.5, rig, ..Layout::default() };
    let all = placed(&settings, 1, 20);
    let mut missed = Vec::new();
    for solver in ["p3p-stereo", "stereo-reprojection"] {
        let c =
            cell_of(&*build(solver), &settings, &all, &Asked { draws, covariance: true, alternatives: Some(CHI2_1) });
        let line = format!(
            "{distance} m {solver}: TRE {:.3} position {:.3} NEES {:.3} cover {:.4}; {} ambiguous, {} rejected, {} elsewhere of {}; position error over \
             the prediction of the likelihood {:.3}; nonlinearity at most {:.2}",
            c.tre,
            c.position,
            c.nees,
            c.coverage,
            c.ambiguous,
            c.rejected,
            c.elsewhere,
            draws * 20,
            c.position_foreseen,
            c.bent
        );
        println!("{line}");
        if c.tre > 1.25 || c.position > 1.25 || !is_known(&c, draws * 20) {
            missed.push(line);
        }
    }
    missed
}

/// Whether covariances are consistent over the answers of a cell with reported alternatives: mean NEES, coverage, and
/// the number of answers in another minimum. With fewer draws than in the long forms, three standard errors more are
/// allowed for the mean of χ²₆ and for a fraction of 0.95.
fn is_known(c: &Cell, generated: u64) -> bool {
    let wide = allowance(generated);
    let consistent = (5.8 - wide..=6.3 + wide).contains(&c.nees);
    let covers = (0.9428 - 0.06 * wide..=0.9571 + 0.06 * wide).contains(&c.coverage);
    // Half of one in a thousand, plus three standard errors.
    let rare = f64::from(c.elsewhere) <= 0.0005 * generated as f64 + 3.0 * (0.0005 * generated as f64).sqrt();
    consistent && covers && rare
}

/// The difference of three standard errors of a mean NEES between this number of draws and 10 000.
fn allowance(generated: u64) -> f64 {
    (3.0 * ((12.0_f64 / generated as f64).sqrt() - (12.0_f64 / 10_000.0).sqrt())).max(0.0)
}

/// χ²₁ at 99.9 %.
const CHI2_1: f64 = 10.827_566_170_662_733;

/// The same for the two seeds with the worst layouts, short.
#[test]
fn four_compact_points_of_bad_layouts_are_distinguished_or_known() {
    let missed: Vec<String> = [8, 11].into_iter().flat_map(|seed| four_compact(seed, 5.0, 50)).collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// The failures of four compact points of this seed, over `draws` draws of each of twenty layouts.
#[allow(clippy::print_stdout, reason = "the long form prints its cells")]
fn four_compact(seed: u64, distance: f64, draws: u64) -> Vec<String> {
    let rig = cameras()[0].1.clone();
    let settings = Layout { shape: Shape::Compact, points: 4, distance, sigma_px: 0.5, rig, ..Layout::default() };
    let all = placed(&settings, seed, 20);
    let mut meant = all.clone();
    meant.retain(|placed| is_meaningful(placed, settings.sigma_px, &bound(placed, &settings)));
    let mut missed = Vec::new();
    for solver in ["mahalanobis", "stereo-reprojection"] {
        let asked = Asked { draws, covariance: true, alternatives: Some(CHI2_1) };
        let c = cell_of(&*build(solver), &settings, &all, &asked);
        let m = cell_of(&*build(solver), &settings, &meant, &asked);
        let generated = draws * 20;
        let line = format!(
            "seed {seed} {distance} m {solver}: TRE {:.3} position {:.3} NEES {:.3} cover {:.4}; {} ambiguous, {} rejected, {} elsewhere \
             of {generated}; position error over the prediction of the likelihood {:.3}; nonlinearity at most {:.2}; of {} layouts where the bound \
             is meaningful (nonlinearity at most {:.2}) TRE {:.3} position {:.3}",
            c.tre,
            c.position,
            c.nees,
            c.coverage,
            c.ambiguous,
            c.rejected,
            c.elsewhere,
            c.position_foreseen,
            c.bent,
            meant.len(),
            m.bent,
            m.tre,
            m.position
        );
        println!("{line}");
        let wide = allowance(generated);
        let reached = [m.tre, m.position, c.tre, c.position_foreseen].iter().all(|ratio| *ratio <= 1.05 + wide);
        if !reached || !is_known(&c, generated) {
            missed.push(line);
        }
    }
    missed
}

fn three_points(name: &str, solver: &str, settings: &Layout, draws: u64) -> Cell {
    let keep = |placed: &_, bound: &_| is_meaningful(placed, settings.sigma_px, bound);
    let c = cell_where(&*build(solver), settings, 20, draws, true, keep);
    if c.layouts > 0 {
        assert!(c.tre <= 1.25 && c.position <= 1.25, "{name} {solver}: {c:?}");
        assert!(c.nees > 5.4 && c.nees < 6.6, "{name} {solver}: {c:?}");
    }
    c
}

/// Few points that hardly determine their attitude: no answer is less probable than the truth, that is, has a larger χ²
/// of the pixels. Rejections are rare: a start that does not reach its minimum is continued.
///
/// Seen to fail when other starts are accepted although the first did not converge: two of 10 000 poses then had an
/// error of 3.4 m.
#[test]
fn no_answer_is_less_likely_than_the_truth() {
    let mut rejected = 0;
    for solver in ["mahalanobis", "stereo-reprojection"].map(build) {
        for number in 0..20 {
            let settings = Layout { points: 4, number, distance: 5.0, sigma_px: 0.5, ..Layout::default() };
            let placed = settings.place(1).expect("the layout can be placed");
            for draw in 0..500 {
                let Some(points) = observations(&placed, draw, 0.0) else { continue };
                let data = Observations { points, edges: Vec::new(), rig: Some(&placed.rig) };
                let Ok(pose) = solver.solve(&data) else {
                    rejected += 1;
                    continue;
                };
                let chi2 =
                    |pose| pixel_chi2(&placed, &data.points, pose, 0.5).expect("all points are before the cameras");
                let (found, truth) = (chi2(&pose), chi2(&placed.object_from_camera));
                assert!(found <= truth * 1.001, "{solver:?}: layout {number}, draw {draw}: {found} {truth}");
            }
        }
    }
    assert!(rejected <= 10, "{rejected} of 20 000 rejected");
}

/// Figure 4 for every solver: its covariance is consistent within ±10 % in every cell with an attitude error below 5°,
/// and claims no more in weaker cells (unweighted solvers have errors of 15° in the weakest). The measure is the mean
/// NEES of 10 000 draws of each cell with thirteen points (1000 for slow solvers). `LIMITS_SOLVERS` selects solvers
/// (`irls cauchy` is a loss of its own), `LIMITS_POINTS` other numbers of points, `LIMITS_DRAWS` the draws,
/// `LIMITS_CELLS` cells by a part of their names (`Compact N 13 3.25 m`).
#[test]
#[ignore = "long: 15 solvers"]
fn every_solver_knows_its_error() {
    let mut missed = Vec::new();
    let asked = std::env::var("LIMITS_SOLVERS").unwrap_or_default();
    let wanted = std::env::var("LIMITS_CELLS").unwrap_or_default();
    let number = |key: &str| std::env::var(key).ok().map(|number| number.parse::<u64>().expect("a number"));
    let (points, draws) = (number("LIMITS_POINTS").unwrap_or(13) as usize, number("LIMITS_DRAWS"));
    let losses = ["irls cauchy", "irls un-squared"];
    for name in
        SOLVERS.names().chain(losses).filter(|name| asked.is_empty() || asked.split(',').any(|one| one == *name))
    {
        for (cell_name, settings) in cells(points).into_iter().filter(|(name, _)| name.contains(&wanted)) {
            let slow = ["irls", "l-bfgs", "nelder-mead", "triad"].iter().any(|slow| name.starts_with(slow));
            let c = cell(&*build(name), &settings, 20, draws.unwrap_or(if slow { 1000 } else { 10_000 }), true);
            let turn = c.attitude_rms.to_degrees();
            println!(
                "{name} {cell_name}: NEES {:.3} cover {:.4}, attitude {turn:.2}°, {} rejected",
                c.nees, c.coverage, c.rejected
            );
            if c.nees > 6.6 || turn < 5.0 && c.nees < 5.4 {
                missed.push(format!("{name} {cell_name}: {:.3}", c.nees));
            }
        }
    }
    assert!(missed.is_empty(), "{} missed:\n{}", missed.len(), missed.join("\n"));
}

/// Figure 3, short: 600 draws in each cell.
///
/// Seen to fail when the model's variance is omitted from the weights, and when the right image is ignored.
#[test]
fn model_error_makes_weights_no_worse_than_none() {
    weights_are_no_worse(600);
}

/// Figure 3, 10 000 draws in each cell.
#[test]
#[ignore = "long: 36 cells"]
fn model_error_in_every_cell() {
    let (cells, worst) = weights_are_no_worse(10_000);
    println!("{cells} cells, two solvers each; nearest to worse: {worst:.1} standard errors");
}

/// Figure 3: with a model error of 1, 3 and 5 mm, drawn anew in each draw, no weighted solver has a larger error than
/// Kabsch on the same draws: the mean of the paired differences of squared target registration and position errors is
/// not above zero at 99.9 %. Returns the number of cells and the maximum difference in standard errors.
fn weights_are_no_worse(draws: u64) -> (usize, f64) {
    let kabsch = build("kabsch");
    let (mut all, mut worst) = (0, f64::NEG_INFINITY);
    for (camera, rig) in cameras() {
        for shape in [Shape::Spread, Shape::Compact] {
            for distance in [1.5, 3.25, 5.0] {
                for model_sigma in [1e-3, 3e-3, 5e-3] {
                    let settings = Layout { shape, distance, model_sigma, rig: rig.clone(), ..Layout::default() };
                    if settings.place(1).is_err() {
                        continue;
                    }
                    all += 1;
                    for name in ["mahalanobis", "stereo-reprojection"] {
                        let z = paired(&*build(name), &*kabsch, &settings, 20, draws);
                        worst = z.iter().fold(worst, |worst, &z| worst.max(z));
                        let cell = format!("{camera} {shape:?} {distance} m {model_sigma} m {name}");
                        assert!(z.iter().all(|&z| z < 3.09), "{cell}: TRE, position {z:?}");
                    }
                }
            }
        }
    }
    (all, worst)
}
