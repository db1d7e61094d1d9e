//! Every search: irrelevant changes of a problem do not change the answer.

use nalgebra::Vector3;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Camera, MeasuredPoint, Point, Transform, UncertainPoint, so3};
use seafix_proptests::{
    admissible::{difference, largest, tolerance},
    law, not_idle,
    poses::pose,
    problems::{LARGE, Planted, SMALL, planted},
    search_laws::{self, all_distinct, gist},
    searches::{Answer, searches},
};
use seafix_referencing::{
    Acceptance, Candidates, Correspondence, Mahalanobis, ModelPoint, Outcome, Problem, Rejected, RigidConsensus,
    Tolerance, compute_fix,
};
use std::cell::Cell;

/// A budget of pair tests for hundreds of cases.
const BUDGET: i64 = 20_000;

/// The cloud points, each mapped by `change`.
fn with_cloud(planted: &Planted, change: impl Fn(&MeasuredPoint) -> MeasuredPoint) -> Planted {
    Planted { cloud: planted.cloud.iter().map(change).collect(), ..planted.clone() }
}

/// Whether a search exhausted its budget.
fn ended(answer: &Answer) -> bool {
    let why = answer.as_ref().map_or_else(Some, |found| found.undecided.as_ref());
    matches!(why, Some(Rejected::Budget { .. }))
}

/// P25. A rigid motion of the cloud with the same candidate lists changes nothing, since only distances matter, except
/// by rounding: the size is the same, and so is a unique set of that size.
///
/// Seen to fail when the tolerance of a pair depends on its position.
#[test]
fn a_motion_of_the_cloud_changes_nothing() {
    let searches = searches(BUDGET);
    law(96, (planted(SMALL), pose(5.0)), |(planted, motion)| {
        let motion: Transform<Camera, Camera> = motion;
        let brute = [false, true].map(|orientation| largest(&planted.problem(), orientation));
        let problem = planted.problem();
        let lists = planted.candidates.lists.iter().enumerate();
        let pairs: Vec<_> =
            lists.flat_map(|(i, list)| list.iter().map(move |&j| Correspondence { model: i, cloud: j })).collect();
        let edge = |a: Correspondence, b: Correspondence| {
            (difference(&problem, a, b) - tolerance(&problem, a, b)).abs() < 1e-9
        };
        let doubtful = brute.iter().any(|largest| largest.doubtful);
        prop_assume!(!doubtful && !pairs.iter().any(|&a| pairs.iter().any(|&b| edge(a, b))));
        let turn = motion.rotation_matrix();
        let moved = with_cloud(&planted, |point| {
            let UncertainPoint { at, covariance } = point.position;
            let position = UncertainPoint { at: motion * at, covariance: turn * covariance * turn.transpose() };
            MeasuredPoint { position, pixels: None }
        });
        for search in searches.iter().filter(|search| search.claims.exact) {
            let (here, there) = (search.answer(&planted), search.answer(&moved));
            match (&here, &there) {
                (Ok(a), Ok(b)) if a.optimal && b.optimal => {
                    prop_assert_eq!(a.pairs.len(), b.pairs.len(), "{}", &search.name);
                    let only = brute[usize::from(search.rejects_mirrors())].sets.len() == 1;
                    prop_assert!(!only || a.pairs == b.pairs, "{}", search.name);
                }
                _ if ended(&here) || ended(&there) => {}
                _ => prop_assert_eq!(gist(&here), gist(&there), "{}", &search.name),
            }
        }
        Ok(())
    });
}

/// P27. Monotonicity: for four or more points the number of identified points does not decrease with a larger Δ, a
/// further candidate, or a further model point.
///
/// Seen to fail when model points with more than three candidates are skipped as ambiguous; not with a lost candidate,
/// bounds that are one too small, a budget mistaken for completion, or a coherence that also rejects differences below
/// 0.3 Δ.
#[test]
fn more_never_finds_less() {
    let searches = searches(BUDGET);
    let held = Cell::new(0);
    let cases = law(96, (planted(SMALL), any::<prop::sample::Index>(), any::<prop::sample::Index>()), |(all, i, j)| {
        prop_assume!(!all.cloud.is_empty());
        let (i, j) = (i.index(all.model.len()), j.index(all.cloud.len()));
        let wider = Planted {
            tolerance: match all.tolerance {
                Tolerance::Fixed(delta) => Tolerance::Fixed(1.5 * delta),
                Tolerance::Sigmas(k) => Tolerance::Sigmas(1.5 * k),
            },
            ..all.clone()
        };
        let mut one_more = all.clone();
        one_more.candidates.lists[i].push(j);
        one_more.candidates.lists[i].sort_unstable();
        one_more.candidates.lists[i].dedup();
        let mut without = all.clone();
        without.candidates.lists[i].clear();
        for search in searches.iter().filter(|search| search.claims.exact) {
            for (less, more) in [(&all, &wider), (&all, &one_more), (&without, &all)] {
                let Ok(before) = search.answer(less) else { continue };
                if !before.optimal || before.pairs.len() < 4 {
                    continue;
                }
                held.set(held.get() + 1);
                match search.answer(more) {
                    Ok(after) if after.optimal => {
                        prop_assert!(after.pairs.len() >= before.pairs.len(), "{}", search.name);
                    }
                    Ok(_) | Err(Rejected::Budget { .. }) => {}
                    Err(rejection) => prop_assert!(false, "{}: {rejection}", search.name),
                }
            }
        }
        Ok(())
    });
    not_idle("sets of four and more", held.get(), cases, 2);
}

/// P28. Scaling model, cloud, Δ and covariances by a power of two gives exactly the same answer, for searches without a
/// length of their own.
///
/// Seen to fail when a length of 1 mm is added to Δ.
#[test]
fn a_problem_of_another_size_is_the_same_problem() {
    let searches = searches(BUDGET);
    law(96, (prop_oneof![planted(SMALL), planted(LARGE)], -3i32..=3), |(planted, power)| {
        let s = 2f64.powi(power);
        let mut scaled = with_cloud(&planted, |point| {
            let UncertainPoint { at, covariance } = point.position;
            let position = UncertainPoint { at: Point::from(at.coords * s), covariance: covariance * (s * s) };
            MeasuredPoint { position, pixels: None }
        });
        for point in &mut scaled.model {
            (point.at, point.sigma) = (Point::from(point.at.coords * s), point.sigma * s);
        }
        if let Tolerance::Fixed(delta) = &mut scaled.tolerance {
            *delta *= s;
        }
        for search in searches.iter().filter(|search| !search.claims.prior && !search.name.starts_with("gnc-tls")) {
            prop_assert_eq!(gist(&search.answer(&planted)), gist(&search.answer(&scaled)), "{}", &search.name);
        }
        Ok(())
    });
}

/// P30. Duplicate cloud points with the same candidates: the size is the same and the lower index is chosen, for model
/// points more than Δ apart.
///
/// Seen to fail when vertices of equal coordinates are sorted by decreasing index.
#[test]
fn a_point_that_comes_twice_is_the_first() {
    let searches = searches(BUDGET);
    let held = Cell::new(0);
    let cases = law(192, planted(SMALL), |planted| {
        let Tolerance::Fixed(delta) = planted.tolerance else { return Ok(()) };
        let model: Vec<_> = planted.model.iter().map(|p| p.at).collect();
        let apart = model.iter().enumerate().all(|(i, a)| model[..i].iter().all(|b| a.distance(b) > 1.01 * delta));
        if !apart || !all_distinct(&planted) {
            return Ok(());
        }
        let count = planted.cloud.len();
        let mut twice = planted.clone();
        twice.cloud.extend_from_within(..);
        for list in &mut twice.candidates.lists {
            let again: Vec<usize> = list.iter().map(|j| j + count).collect();
            list.extend(again);
        }
        for search in searches.iter().filter(|search| search.claims.exact) {
            if let (Ok(once), Ok(twice)) = (search.answer(&planted), search.answer(&twice))
                && once.optimal
                && twice.optimal
            {
                held.set(held.get() + 1);
                prop_assert_eq!(once.pairs.len(), twice.pairs.len(), "{}", &search.name);
                prop_assert!(twice.pairs.iter().all(|pair| pair.cloud < count), "{}: {:?}", search.name, twice.pairs);
            }
        }
        Ok(())
    });
    not_idle("sets found twice", held.get(), cases, 2);
}

/// The number of clouds with only the mirror image of a model of eight to thirty points that the default search takes
/// for the object, with at most three fifths of its points.
fn mirror_images_fixed(clouds: usize) -> usize {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut fixed = 0;
    for number in 0..clouds {
        let n = [8, 12, 20, 30][number % 4];
        let mut generated = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        let turn = so3::exp(&generated(1.8));
        let model: Vec<ModelPoint> = (0..n).map(|_| ModelPoint::exact("", generated(0.6).into())).collect();
        let measured = |point: &ModelPoint| {
            let image = point.at.coords.component_mul(&Vector3::new(1.0, 1.0, -1.0));
            let at = turn * image + Vector3::z() * 4.0 + generated(0.01) + generated(0.01);
            MeasuredPoint { position: UncertainPoint::isotropic(at.into(), 0.01), pixels: None }
        };
        let cloud: Vec<MeasuredPoint> = model.iter().map(measured).collect();
        let candidates = Candidates::all(n, n);
        let tolerance = Tolerance::Fixed(0.042_426);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
        let attempt = compute_fix(&problem, &search, &solver, &Acceptance::default(), None, &mut rng);
        let few = |pairs: usize| 5 * pairs <= 3 * n;
        fixed += usize::from(matches!(&attempt.outcome, Outcome::Fix(fix) if few(fix.pairs.len())));
    }
    fixed
}

/// P26. A few points of a mirror image always fit the object; they do not make a fix.
///
/// Seen to fail, with two of 600, when the model is reflected in one plane only, and with one when eight triples are
/// reflected.
#[test]
fn a_mirror_image_of_many_points_is_not_fixed() {
    assert_eq!(mirror_images_fixed(100), 0);
}

#[test]
#[ignore = "long: 6000 problems"]
fn six_thousand_mirror_images_are_not_fixed() {
    assert_eq!(mirror_images_fixed(6000), 0);
}

/// Seen to fail when vertices are sorted by their indices.
#[test]
fn the_order_of_the_points_changes_nothing() {
    search_laws::the_order_of_the_points_changes_nothing(&searches(BUDGET));
}

/// Seen to fail when the size of the cloud counts among the tests.
#[test]
fn points_outside_every_gate_change_nothing() {
    search_laws::points_outside_every_gate_change_nothing(&searches(BUDGET));
}
