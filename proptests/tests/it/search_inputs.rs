//! Every search: invalid and extreme input gets an answer within the budget, without a panic.

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_component::Choice;
use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};
use seafix_proptests::{
    admissible::objection,
    law,
    poses::{pose, vector},
    problems::{LARGE, Planted, SMALL, planted},
    searches::{Tried, nowhere, searches, sets},
};
use seafix_referencing::{
    Acceptance, Candidates, Correspondence, Degenerate, ModelPoint, Outcome, Rejected, SOLVERS, Tolerance, judge,
};

const BUDGET: i64 = 20_000;

/// Each search once, with the defaults except for its budget.
fn each(budget: i64) -> Vec<Tried> {
    let mut all = searches(budget);
    all.dedup_by_key(|search| search.name.split(' ').next().unwrap_or_default().to_owned());
    all
}

fn cube(rng: &mut ChaCha8Rng, half: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-half..half))
}

/// Model and cloud anywhere in a cube; any cloud point may be a candidate of any model point, in lists of this length.
fn clutter(points: usize, list: usize, cloud: usize, delta: f64) -> Planted {
    let mut rng = ChaCha8Rng::seed_from_u64(32);
    let model = (0..points).map(|_| ModelPoint::exact("P", Point::from(cube(&mut rng, 1.0)))).collect();
    let measure = |at| MeasuredPoint { position: UncertainPoint::isotropic(Point::from(at), 0.01), pixels: None };
    let seen = (0..cloud).map(|_| measure(cube(&mut rng, 1.0))).collect();
    let pairs = (0..points * list).map(|k| (k % points, k % cloud));
    Planted {
        model,
        cloud: seen,
        candidates: Candidates::from_pairs(points, pairs),
        tolerance: Tolerance::Fixed(delta),
        truth: Vec::new(),
        pose: nowhere(),
    }
}

/// P32, B35. Fewer than three model points with candidates, no cloud, or empty gates: `TooFew`, never a pose.
///
/// Seen to fail when two points suffice.
#[test]
fn too_few_points_are_no_pose() {
    let searches = searches(BUDGET);
    law(64, planted(SMALL), |planted| {
        let nothing =
            Planted { cloud: Vec::new(), candidates: Candidates::all(planted.model.len(), 0), ..planted.clone() };
        let mut two = planted.clone();
        two.candidates.lists.iter_mut().skip(2).for_each(Vec::clear);
        for search in &searches {
            let answer = search.answer(&nothing);
            prop_assert!(matches!(answer, Err(Rejected::TooFew { with_candidates: 0, .. })), "{}", search.name);
            let answer = search.answer(&two);
            prop_assert!(matches!(answer, Err(Rejected::TooFew { .. })), "{}: {answer:?}", search.name);
        }
        Ok(())
    });
}

/// Collinear points determine no pose: with any search the answer is `degenerate`, with the number that failed.
#[test]
fn points_on_a_line_are_degenerate() {
    let solver = SOLVERS.build(&Choice::named("mahalanobis")).expect("it is listed");
    let along = |k: usize| Vector3::new(1.0, 0.3, 0.2) * [0.0, 0.23, 0.31, 0.58, 0.77, 1.0][k];
    let image = |k: usize| (nowhere().inverse() * Point::from(along(k))).coords;
    let line = Planted {
        model: (0..6).map(|k| ModelPoint::exact("P", Point::from(along(k)))).collect(),
        cloud: (0..6)
            .map(|k| MeasuredPoint { position: UncertainPoint::isotropic(Point::from(image(k)), 0.002), pixels: None })
            .collect(),
        candidates: Candidates::all(6, 6),
        tolerance: Tolerance::Fixed(0.01),
        truth: Vec::new(),
        pose: nowhere(),
    };
    for search in each(BUDGET) {
        let problem = line.problem();
        let attempt = judge(&problem, search.answer(&line), &*solver, &Acceptance::default(), None);
        let reported =
            matches!(attempt.outcome, Outcome::Degenerate(Degenerate::Collinear { ratio, .. }) if ratio < 1e-3);
        assert!(reported, "{}: {:?}", search.name, attempt.outcome);
    }
}

/// P35. Δ = 1e-9 of the extent: with exact coordinates every visible point is identified; with noise fewer are, without
/// other effects.
///
/// Seen to fail when the first filter of the association graph compares (A + B − r²)² with 4AB, which cancels.
#[test]
fn a_tolerance_of_rounding_is_enough_for_exact_points() {
    let searches = searches(BUDGET);
    let points = prop::collection::vec((vector(2.0), vector(1e-3)), 4..12);
    law(64, (points, pose(5.0)), |(points, pose)| {
        let image = |p: &Vector3<f64>| (pose.inverse() * Point::from(*p)).coords;
        let exact = Planted {
            model: points.iter().map(|(p, _)| ModelPoint::exact("P", Point::from(*p))).collect(),
            cloud: points.iter().map(|(p, _)| measured(image(p), Matrix3::zeros())).collect(),
            candidates: Candidates::from_pairs(points.len(), (0..points.len()).map(|i| (i, i))),
            tolerance: Tolerance::Fixed(4e-9),
            truth: (0..points.len()).map(|i| Correspondence { model: i, cloud: i }).collect(),
            pose,
        };
        let mut noisy = exact.clone();
        noisy.cloud.iter_mut().zip(&points).for_each(|(c, (_, noise))| c.position.at = c.position.at + *noise);
        for search in &searches {
            let answer = search.answer(&exact);
            if search.claims.exact {
                let pairs = answer.as_ref().map(|found| &found.pairs);
                prop_assert_eq!(pairs, Ok(&exact.truth), "{}", &search.name);
            }
            for set in sets(&search.answer(&noisy)) {
                prop_assert!(set.len() <= points.len());
            }
        }
        Ok(())
    });
}

fn measured(at: Vector3<f64>, covariance: Matrix3<f64>) -> MeasuredPoint {
    MeasuredPoint { position: UncertainPoint { at: Point::from(at), covariance }, pixels: None }
}

/// B33, B34. A Δ that is zero, negative or NaN yields coherent sets only; one larger than the object makes everything
/// coherent, and is searched within the budget.
///
/// Seen to fail when coherence is "not more than Δ", which NaN never exceeds, when the absolute value of Δ is used, and
/// when the bound is the number of pairs, or two.
#[test]
fn absurd_tolerances_end() {
    for delta in [0.0, -1.0, f64::NAN, f64::INFINITY, 10.0] {
        let problem = clutter(20, 50, 300, delta);
        for search in each(BUDGET) {
            let answer = search.answer(&problem);
            for set in sets(&answer) {
                assert!(set.len() >= 3 && delta >= 0.0, "{} at Δ = {delta}: {set:?}", search.name);
            }
            if delta == 10.0 {
                let bound = match &answer {
                    Ok(found) => found.consensus_bound,
                    Err(
                        Rejected::Budget { bound, .. }
                        | Rejected::TooLarge { bound, .. }
                        | Rejected::NotFound { bound, .. },
                    ) => *bound,
                    Err(Rejected::Mirrored { .. }) => 20,
                    Err(other) => panic!("{}: {other}", search.name),
                };
                assert!((3..=20).contains(&bound), "{}: {bound}", search.name);
            }
        }
    }
}

/// B36. A cloud of 300 000 points without a gate: an answer, or a rejection with its bound.
///
/// Seen to fail when the bound of a rejection is two.
#[test]
fn a_huge_cloud_ends() {
    let mut problem = clutter(4, 1, 300_000, 0.001);
    problem.candidates = Candidates::all(4, 300_000);
    for search in each(BUDGET) {
        match search.answer(&problem) {
            Ok(found) => assert!(found.consensus_bound >= found.pairs.len(), "{}", search.name),
            Err(
                Rejected::Budget { bound, .. } | Rejected::TooLarge { bound, .. } | Rejected::NotFound { bound, .. },
            ) => {
                assert!(bound >= 3, "{}", search.name);
            }
            Err(Rejected::Mirrored { best, .. }) => assert_eq!(best, 4, "{}", search.name),
            Err(other) => panic!("{}: {other}", search.name),
        }
    }
}

/// A search that has exhausted a budget of one test says so, in its answer or in its rejection.
///
/// Seen to fail when an iteration ended by the budget counts as the last.
#[test]
fn a_spent_budget_is_reported() {
    let problem = clutter(8, 6, 40, 0.3);
    for search in each(1).iter().filter(|search| search.has_budget()) {
        let answer = search.answer(&problem);
        let ended = match &answer {
            Ok(found) => found.undecided.as_ref(),
            Err(rejection) => Some(rejection),
        };
        assert!(matches!(ended, Some(Rejected::Budget { .. })), "{}: {answer:?}", search.name);
    }
}

/// B37. Fifty model points with a hundred candidates each: the best set found and a bound, at the end of the budget.
///
/// Seen to fail when the bound is the number of pairs.
#[test]
fn a_blow_up_ends_at_the_budget() {
    let problem = clutter(50, 100, 3_000, 0.04);
    for search in each(BUDGET) {
        match search.answer(&problem) {
            Ok(found) => {
                let (size, bound) = (found.pairs.len(), found.consensus_bound);
                assert!(size <= bound && bound <= 50, "{}: {size}, {bound}", search.name);
                let objection = objection(&problem.problem(), search.rejects_mirrors(), &found.pairs);
                assert_eq!(objection, None, "{}", search.name);
                assert!(size >= 3 && !found.optimal, "{}: {size}", search.name);
            }
            Err(rejection) => {
                let nothing = matches!(rejection, Rejected::TooFew { .. } | Rejected::Budget { .. });
                assert!(!nothing, "{}: {rejection}", search.name);
            }
        }
    }
}

/// Invalid covariances (NaN, infinite, not positive definite) and NaN coordinates cause no panic, and returned points
/// have finite coordinates.
///
/// Seen to fail when coherence is "not more than Δ"; not when vertices without finite coordinates are kept, which agree
/// with nothing.
#[test]
fn numbers_that_are_none_are_survived() {
    let searches = searches(BUDGET);
    let spoilt = prop::sample::select(vec![
        Matrix3::from_element(f64::NAN),
        Matrix3::from_element(f64::INFINITY),
        Matrix3::from_diagonal(&Vector3::new(-1e-4, 1e-4, 1e-4)),
        Matrix3::from_element(-1.0),
        Matrix3::zeros(),
    ]);
    let place = prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 0.0]);
    law(64, (prop_oneof![planted(SMALL), planted(LARGE)], spoilt, place, 1usize..4), |(mut planted, bad, x, every)| {
        for (j, point) in planted.cloud.iter_mut().enumerate() {
            if j % (every + 1) == 0 {
                point.position.covariance = bad;
            }
            if j % (every + 4) == 2 && x != 0.0 {
                point.position.at.coords.y = x;
            }
        }
        for search in &searches {
            for set in sets(&search.answer(&planted)) {
                let finite = set.iter().all(|pair| planted.cloud[pair.cloud].position.at.is_finite());
                prop_assert!(finite, "{}: {set:?}", search.name);
            }
        }
        Ok(())
    });
}
