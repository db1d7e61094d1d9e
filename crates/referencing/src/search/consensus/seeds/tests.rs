use nalgebra::Rotation3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{MeasuredPoint, UncertainPoint};

use super::*;
use crate::{
    candidates::Candidates,
    problem::{Problem, Tolerance},
    search::limits::NEEDED,
};

const POINTS: usize = 9;
const SEEN: usize = 6;

/// A complete copy of the object, the first points of another, and clutter.
fn scene(rng: &mut ChaCha8Rng) -> (Vec<ModelPoint>, Vec<MeasuredPoint>) {
    let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
    let model: Vec<ModelPoint> = (0..POINTS).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
    let copies = [(POINTS, place(0.5)), (SEEN, place(0.5))];
    let mut at = Vec::new();
    for (seen, turn) in copies {
        let (turn, shift) = (Rotation3::from_scaled_axis(turn), place(0.4));
        at.extend(model[..seen].iter().map(|point| turn * point.at.coords + shift + place(0.01)));
    }
    at.extend((0..30).map(|_| place(1.5)));
    let measured =
        |at: &Vector3<f64>| MeasuredPoint { position: UncertainPoint::isotropic((*at).into(), 0.01), pixels: None };
    let cloud = at.iter().map(measured).collect();
    (model, cloud)
}

/// The modes beside the complete copy from three searches: without parts, with the rest of the copy as a part without
/// limits, and with no work allowed for parts.
///
/// Fails if the pairs of parts are not followed, and if skipping them is not reported.
#[test]
fn a_part_is_found_without_limits_and_the_complete_set_always() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for _ in 0..10 {
        let (model, cloud) = scene(&mut rng);
        let candidates = Candidates::all(POINTS, cloud.len());
        let tolerance = Tolerance::Fixed(0.06);
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
        let seeds = |taken, min| Seeds::new(&model, (&terms, &prior_terms, &graph), taken, (min, 3.0), u64::MAX / 4);
        let clouds = |swept: &Swept| -> Vec<usize> {
            let best = swept.modes.first().map(|mode| mode.pairs(&graph)).unwrap_or_default();
            best.iter().map(|pair| pair.cloud).collect()
        };
        let (none, full): (_, BTreeSet<usize>) = (BTreeSet::new(), (0..POINTS).collect());
        let part: Vec<usize> = (POINTS..POINTS + SEEN).collect();
        let plain = seeds(&full, NEEDED).sweep();
        let unlimited = seeds(&full, NEEDED).with_parts(SEEN + 2, u64::MAX, u64::MAX / 4).sweep();
        assert_eq!((clouds(&plain), clouds(&unlimited)), (part.clone(), part));
        assert!(plain.complete && unlimited.complete && unlimited.parts);
        let full_sets = seeds(&full, NEEDED).with_parts(SEEN + 2, 1, 0).sweep();
        assert!(full_sets.complete && !full_sets.parts);
        let all = seeds(&none, NEEDED).with_parts(SEEN + 2, 1, 0).sweep();
        assert_eq!(clouds(&all), (0..POINTS).collect::<Vec<_>>());
        assert!(all.complete && all.pair_tests < seeds(&none, NEEDED).sweep().pair_tests);
    }
}

/// Putative pairs of a model of 1500 points, of which 60 are true.
///
/// Without guided seeds the enumeration reaches its budget. With them the set is found and counts as the best, and a
/// second search without its points ends too. Fails if the seeds are not followed.
#[test]
fn a_large_set_is_found_by_guided_seeds() {
    const PAIRS: usize = 1500;
    const TRUE: usize = 60;
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut place = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
    let model: Vec<ModelPoint> = (0..PAIRS).map(|_| ModelPoint::exact("", place(1.0).into())).collect();
    let turn = Rotation3::from_scaled_axis(place(1.0));
    let seen = |i: usize, at: Vector3<f64>, clutter: Vector3<f64>| if i < TRUE { turn * at } else { clutter };
    let cloud: Vec<MeasuredPoint> = (0..PAIRS)
        .map(|i| seen(i, model[i].at.coords + place(0.02), place(1.0)))
        .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), 0.02), pixels: None })
        .collect();
    let candidates = Candidates::from_pairs(PAIRS, (0..PAIRS).map(|i| (i, i)));
    let tolerance = Tolerance::Fixed(0.085);
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
    let seeds = |taken, budget| Seeds::new(&model, (&terms, &prior_terms, &graph), taken, (NEEDED, 3.0), budget);
    let (none, all): (_, BTreeSet<usize>) = (BTreeSet::new(), (0..TRUE).collect());
    const SMALL: u64 = 1_000_000;
    assert!(!seeds(&none, SMALL).sweep().complete);
    let found = seeds(&none, SMALL).guided(100 * SMALL).sweep();
    let members = found.modes.first().map(|mode| mode.pairs(&graph)).unwrap_or_default();
    let right = members.iter().filter(|pair| pair.model < TRUE).count();
    assert!(found.complete && right > 50 && members.len() - right < 3, "{right} of {}", members.len());
    let copies = seeds(&all, SMALL).with_parts(50, SMALL, SMALL).guided(100 * SMALL).sweep();
    assert!(copies.complete && copies.modes.iter().all(|mode| mode.members.len() < 20));
}
