//! The coverage of covariances where clutter clumps about the object's points.

use nalgebra::Vector3;
use seafix_component::Choice;
use seafix_evaluation::nees;
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use seafix_referencing::{
    Acceptance, Gate, Mahalanobis, ModelPoint, Observations, Outcome, Prior, PriorBound, Problem, SEARCHES, Solver,
    Tolerance, candidates, compute_fix,
};
use seafix_simulation::{Purpose, Stream};

/// The 95 % quantile of χ²₆.
const NINETY_FIVE: f64 = 12.591_587_243_743_977;
/// Standard deviation of a measured coordinate (m), half-size of the gate (m), and distance of the object (m).
const SIGMA: f64 = 0.01;
const GATE: f64 = 0.15;
const AWAY: f64 = 3.0;

/// Clutter about every object point.
#[derive(Debug, Clone, Copy)]
struct Clump {
    /// Number of clutter points about each object point.
    count: usize,
    /// Their standard deviation along each axis (m).
    spread: f64,
}

/// The fixes of a cell, and the errors beyond the 95 % quantile with the covariance of noise alone and with the fix's.
#[derive(Debug, Default)]
struct Coverage {
    fixes: u32,
    before: u32,
    after: u32,
    /// Sum of the ratio of the position's standard deviations, fix over noise alone.
    growth: f64,
}

impl Coverage {
    fn of(&self, beyond: u32) -> f64 {
        f64::from(beyond) / f64::from(self.fixes.max(1))
    }
}

/// `draws` objects of twelve points, nine of them in view.
fn coverage(clump: Clump, draws: u64) -> Coverage {
    let search = SEARCHES.build(&Choice::named("rigid-consensus")).expect("it exists");
    let solver = Mahalanobis::default();
    let mut all = Coverage::default();
    for number in 0..draws {
        let mut stream = Stream::new(22, number, clump.count as u64, Purpose::Survey);
        let half = [0.8, 0.6, 0.5];
        let at: Vec<Vector3<f64>> =
            (0..12).map(|_| Vector3::from(half.map(|half| stream.between(-half, half)))).collect();
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(stream.normal3(1.0));
        let truth = Transform::<Object, Camera>::new(turn, turn * Vector3::new(0.0, 0.0, -AWAY));
        let mut measure = |place: Vector3<f64>| {
            let position = truth.inverse() * Point::from(place) + stream.normal3(SIGMA);
            MeasuredPoint { position: UncertainPoint::isotropic(position, SIGMA), pixels: None }
        };
        let mut cloud: Vec<MeasuredPoint> = at[..9].iter().map(|at| measure(*at)).collect();
        let mut noise = Stream::new(23, number, clump.count as u64, Purpose::Survey);
        for at in &at {
            cloud.extend((0..clump.count).map(|_| measure(at + noise.normal3(clump.spread))));
        }
        let model: Vec<ModelPoint> =
            at.iter().enumerate().map(|(k, at)| ModelPoint::exact(format!("P{k}"), Point::from(*at))).collect();
        let prior = Prior { object_from_camera: truth, bound: PriorBound::Box(GATE) };
        let lists = candidates(&model, &cloud, Some(&prior), &Gate::Box(GATE), None);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &lists,
            tolerance: Tolerance::Sigmas(4.0),
            prior: Some(&prior),
            edges: Default::default(),
        };
        let attempt = compute_fix(&problem, &*search, &solver, &Acceptance::default(), None, noise.rng());
        let Outcome::Fix(fix) = attempt.outcome else { continue };
        let data = Observations::of(&fix.pairs, &model, &cloud, None);
        let Ok(of_noise) = solver.covariance(&data, &fix.object_from_camera) else { continue };
        let sum: Vector3<f64> = data.points.iter().map(|point| point.measured.at.coords).sum();
        let centroid = Point::from(sum / data.points.len() as f64);
        let beyond = |covariance| {
            u32::from(!(nees(&fix.object_from_camera, &truth, covariance, &centroid).is_some_and(|x| x <= NINETY_FIVE)))
        };
        all.fixes += 1;
        all.before += beyond(&of_noise);
        all.after += beyond(&fix.covariance);
        all.growth += fix.covariance.position_rms() / of_noise.position_rms();
    }
    all
}

/// Errors beyond the 95 % quantile become fewer by the uncertainty of the association, where another candidate is within
/// the noise of every point. Without clutter, covariances are those of the noise.
#[test]
fn covariances_include_the_association() {
    let clear = coverage(Clump { count: 0, spread: 0.0 }, 60);
    assert!(clear.fixes > 30 && (clear.growth / f64::from(clear.fixes) - 1.0).abs() < 1e-12, "{clear:?}");
    let dense = coverage(Clump { count: 1, spread: 0.01 }, 250);
    println!("{dense:?}");
    assert!(dense.fixes > 20 && dense.growth > 1.05 * f64::from(dense.fixes), "{dense:?}");
    assert!(3 * dense.after <= 2 * dense.before, "{dense:?}");
}

/// The coverage for clumps of several numbers and sizes. `DRAWS` is the number of draws of a cell, 200 by default.
#[test]
#[ignore = "table"]
fn coverage_by_clump() {
    let draws = std::env::var("DRAWS").ok().and_then(|n| n.parse().ok()).unwrap_or(200);
    println!("count spread_mm: fixes, beyond 95 % before and after (%), growth of the position's sigma");
    for count in [0, 1, 2, 4, 8] {
        for spread in [0.01, 0.02, 0.03, 0.05, 0.1] {
            let one = coverage(Clump { count, spread }, draws);
            println!(
                "{count} {:.0}: {} {:.1} {:.1} {:.2}",
                1e3 * spread,
                one.fixes,
                100.0 * one.of(one.before),
                100.0 * one.of(one.after),
                one.growth / f64::from(one.fixes.max(1))
            );
        }
    }
}
