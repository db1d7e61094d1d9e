use nalgebra::{Rotation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Covariance6, MeasuredPoint, Transform, UncertainPoint};

use super::*;
use crate::{
    candidates::Candidates,
    problem::{Prior, PriorBound, Problem, Tolerance},
    search::consensus::{bits::is_set, likelihood::ln_volume, seeds::Seeds},
};

const POINTS: usize = 6;
/// An unlimited budget.
const FREE: u64 = u64::MAX / 4;

/// A scene of four or five object points with noise, and clutter; the model, the cloud and the true motion.
fn scene(rng: &mut ChaCha8Rng) -> (Vec<ModelPoint>, Vec<MeasuredPoint>, Motion) {
    let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
    let model: Vec<ModelPoint> = (0..POINTS).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
    let turn = Rotation3::from_scaled_axis(place(0.3)).into_inner();
    let motion = Motion { rotation: turn, translation: Vector3::new(0.0, 0.0, 3.0) + place(0.2) };
    let seen = if place(1.0).x > 0.0 { 4 } else { 5 };
    let measured = |at: Vector3<f64>, off: Vector3<f64>| {
        // The standard deviation of depth is three times that of the other axes.
        let deep = Matrix3::from_diagonal(&Vector3::new(0.03, 0.03, 0.09));
        let position = UncertainPoint { at: (at + deep * off).into(), covariance: deep * deep };
        MeasuredPoint { position, pixels: None }
    };
    let mut cloud: Vec<MeasuredPoint> =
        model[..seen].iter().map(|point| measured(motion.apply(&point.at.coords), place(1.7))).collect();
    cloud.extend((0..12).map(|_| measured(motion.translation + place(1.3), Vector3::zeros())));
    (model, cloud, motion)
}

/// The evidence of some pairs under their own pose; `None` without one.
fn evidence(prover: &Prover<'_>, members: &[usize]) -> Option<f64> {
    let Climb { terms, prior_terms, .. } = prover.climb;
    let three = |i: usize, j: usize, k: usize| {
        let [a, b, c] = [members[i], members[j], members[k]].map(|v| &terms.pairs[v]);
        Motion::of_three([&a.model, &b.model, &c.model], [&a.cloud, &b.cloud, &c.cloud])
    };
    let count = members.len();
    let threes = (2..count).flat_map(|k| (1..k).flat_map(move |j| (0..j).map(move |i| (i, j, k))));
    let starts =
        threes.filter_map(|(i, j, k)| three(i, j, k)).chain(prior_terms.known.as_ref().map(|known| known.motion));
    let at = |start: Motion| {
        // A fit from a bad start is slow; short of its end the pose is not that of the pairs.
        let (motion, factor) = fit(terms, prior_terms, members, &start, 60)?;
        let gains: f64 = members.iter().map(|&v| terms.residual_gain(v, &motion)).sum();
        let filled = (prior_terms.ln_peak + ln_volume(&factor)).min(0.0);
        let ln_evidence =
            gains + terms.ln_fraction[count] + prior_terms.ln_density(&motion) - prior_terms.ln_peak + filled;
        let allowed = prover.climb.allows(members, &motion) && prior_terms.holds(&motion, &factor);
        allowed.then_some(ln_evidence)
    };
    starts.filter_map(at).fold(None, |max: Option<f64>, one| Some(max.map_or(one, |max| max.max(one))))
}

/// Calls `each` with every coherent set of three pairs or more that begins with `begun`.
fn coherent(graph: &ConsistencyGraph, begun: &mut Vec<usize>, each: &mut impl FnMut(&[usize])) {
    if begun.len() >= NEEDED {
        each(begun);
    }
    let from = begun.last().map_or(0, |&v| graph.starts[graph.rank[v] as usize + 1]);
    for v in from..graph.vertices.len() {
        if begun.iter().all(|&member| is_set(graph.row(member), v)) {
            begun.push(v);
            coherent(graph, begun, each);
            begun.pop();
        }
    }
}

/// The cost of ten pairs beside their first four, and the fractions of the other six in it.
///
/// Fails if each fraction is the cost of a pair by itself: all of them share the cost of the four's pose.
#[test]
fn fractions_are_no_more_than_what_all_cost() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut greatest: f64 = 0.0;
    for _ in 0..300 {
        let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
        let model: Vec<ModelPoint> = (0..10).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
        let ahead = Vector3::new(0.0, 0.0, 3.0);
        let seen =
            |point: &ModelPoint| UncertainPoint::isotropic((point.at.coords + ahead + place(0.015)).into(), 0.01);
        let cloud: Vec<MeasuredPoint> =
            model.iter().map(seen).map(|position| MeasuredPoint { position, pixels: None }).collect();
        let candidates = Candidates::from_pairs(10, (0..10).map(|i| (i, i)));
        let tolerance = Tolerance::Fixed(0.1);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let prior_terms = PriorTerms::of(&problem).expect("a box");
        let graph = ConsistencyGraph::of(&problem, &prior_terms);
        let terms = PairTerms::of(&problem, &prior_terms, &graph);
        let none = BTreeSet::new();
        let motion = Motion { rotation: Matrix3::identity(), translation: ahead };
        // Every set examined has less evidence: none becomes the best.
        let other = Mode {
            members: Vec::new(),
            edges: Vec::new(),
            motion,
            ln_evidence: 1e9,
            ln_uniform: 1e9,
            ln_clutter_density: 0.0,
        };
        let mut prover = Prover::of(&model, (&terms, &prior_terms, &graph), &none, &other, 0);
        let begun = (0..4).fold(Begun::default(), |begun, v| prover.join(&begun, v));
        let begun = prover.fitted(&begun);
        prover.best.ln_evidence = -1e9;
        let mut level = Level { common: vec![!0 << 4 & ((1 << 10) - 1)], ..Level::default() };
        prover.leave_out(&begun, (10, 0.0), 4, &mut level).expect("four points determine a pose");
        let fractions: f64 = level.costs.iter().map(|(_, fraction)| fraction).sum();
        prover.members.extend(4..10);
        let (motion, _) = fit(&terms, &prior_terms, &prover.members, &motion, 8).expect("ten points");
        let max = prover.fits().cost(&motion) - begun.cost;
        assert!(level.costs.len() == 6 && fractions <= max + 0.01, "{fractions} of {max}");
        greatest = greatest.max(fractions / max);
    }
    assert!(greatest > 0.5, "{greatest}");
}

/// Checks the bound against every coherent set of small problems.
///
/// The bound must hold with a sufficient and an insufficient budget, and with all poses found by the search or all
/// but the worst removed.
fn compare(rounds: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let [mut sets, mut proved, mut open, mut found_again] = [0; 4];
    for round in 0..rounds {
        let (model, cloud, truth) = scene(&mut rng);
        // All pairs, or half of them proposed.
        let proposed = |_: &(usize, usize)| round % 3 < 2 || rng.random_bool(0.5);
        let pairs = (0..POINTS).flat_map(|i| (0..cloud.len()).map(move |j| (i, j))).filter(proposed);
        let candidates = Candidates::from_pairs(POINTS, pairs.collect::<Vec<_>>());
        let at = Transform::new(UnitQuaternion::identity(), truth.translation).inverse();
        let bound = match round % 4 {
            0 => Some(PriorBound::Gaussian(Covariance6::isotropic(0.05, 0.1))),
            1 => Some(PriorBound::Box(0.5)),
            2 => Some(PriorBound::Gaussian(Covariance6::isotropic(0.5, 0.5))),
            _ => None,
        };
        let prior = bound.map(|bound| Prior { object_from_camera: at, bound });
        let (tolerance, prior) = (Tolerance::Fixed(0.3), prior.as_ref());
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior,
            edges: Default::default(),
        };
        let prior_terms = PriorTerms::of(&problem).expect("a box");
        let graph = ConsistencyGraph::of(&problem, &prior_terms);
        let terms = PairTerms::of(&problem, &prior_terms, &graph);
        let (parts, none) = ((&terms, &prior_terms, &graph), BTreeSet::new());
        for (missed, budget) in [(false, 200 * (round % 5)), (false, FREE), (true, 200 * (round % 5)), (true, FREE)] {
            let mut swept = Seeds::new(&model, parts, &none, (NEEDED, -3.0), FREE).sweep();
            if missed {
                swept.modes.drain(..swept.modes.len().saturating_sub(1));
            }
            let before = swept.modes.first().map(|mode| mode.ln_evidence);
            let Some(reported) = prove(&model, parts, &mut swept, budget) else { continue };
            let best = swept.modes[0].ln_evidence;
            proved += u64::from(reported.bound == best);
            open += u64::from(reported.bound > best);
            found_again += u64::from(missed && before < Some(best));
            assert!(
                budget < FREE || reported.bound == best,
                "round {round}: sets up to {} are open above {best}",
                reported.bound
            );
            let prover = Prover::of(&model, parts, &none, &swept.modes[0], 0);
            coherent(&graph, &mut Vec::new(), &mut |set| {
                sets += 1;
                // Under any pose.
                let gains: f64 = set.iter().map(|&v| terms.pairs[v].gain).sum();
                if gains + terms.ln_fraction[set.len()] > reported.bound {
                    let max = evidence(&prover, set).unwrap_or(f64::NEG_INFINITY);
                    assert!(
                        max <= reported.bound + 0.01,
                        "round {round}: {set:?} has evidence {max}, bound {}",
                        reported.bound
                    );
                }
            });
        }
    }
    assert!(sets > 100 * rounds && 3 * proved > rounds && 5 * open > rounds, "{sets}, {proved}, {open}");
    assert!(10 * found_again > rounds, "{found_again}");
}

/// The proved bound holds for every coherent set of small problems.
///
/// Fails if members cost twice their cost, if the cost of a further pair ignores the covariance of the pose, if the
/// posterior volume is smaller, and if pruning bounds are taken for strict ones.
#[test]
fn no_coherent_set_is_more_probable_than_the_bound() {
    // Each problem takes 0.1 s: forty, or the number in `PROPTEST_CASES` if larger.
    let asked = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok());
    compare(asked.unwrap_or(0).max(40));
}

/// The long form: `cargo test --release -p seafix-referencing --lib -- --ignored more_probable`.
///
/// Fails if the prediction of one step is taken for the end of a fit (problem 7435), and if a set whose fit is slow
/// is skipped (problem 13 623).
#[test]
#[ignore = "20 000 problems; some minutes"]
fn no_coherent_set_of_many_problems_is_more_probable_than_the_bound() {
    compare(20_000);
}
