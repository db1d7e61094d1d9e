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

/// A plate with nine square tags among thirty other tags of the same size: a small problem of many coherent triples.
///
/// The enumeration reaches its budget. Fails if no guided seeds follow then.
#[test]
fn guided_seeds_find_what_an_enumeration_does_not_reach() {
    const TAGS: usize = 9;
    const OTHERS: usize = 30;
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let corner = |k: usize| Vector3::new([0.03, 0.03, -0.03, -0.03][k], [0.03, -0.03, -0.03, 0.03][k], 0.0);
    let mut off = |half: f64| Vector3::from_fn(|_, _| rng.random_range(-half..half));
    let tag = |k: usize| Vector3::new(0.18 * (k % 3) as f64, 0.18 * (k / 3) as f64, 0.0);
    let at: Vec<Vector3<f64>> = (0..TAGS)
        .flat_map(|k| {
            let centre = tag(k) + off(0.04);
            (0..4).map(move |side| centre + corner(side))
        })
        .collect();
    let model: Vec<ModelPoint> = at.iter().map(|at| ModelPoint::exact("", (*at).into())).collect();
    let others = (0..OTHERS).flat_map(|_| {
        let (centre, turn) = (off(0.7), Rotation3::from_scaled_axis(off(1.0)));
        (0..4).map(move |side| centre + turn * corner(side))
    });
    let places: Vec<Vector3<f64>> =
        at.iter().copied().chain(others.collect::<Vec<_>>()).map(|at| at + off(0.003)).collect();
    let measured =
        |at: &Vector3<f64>| MeasuredPoint { position: UncertainPoint::isotropic((*at).into(), 0.002), pixels: None };
    let cloud: Vec<MeasuredPoint> = places.iter().map(measured).collect();
    let candidates = Candidates::all(model.len(), cloud.len());
    let problem = Problem {
        model: &model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance: Tolerance::Fixed(0.012),
        prior: None,
        edges: Default::default(),
    };
    let prior_terms = PriorTerms::of(&problem).expect("a box");
    let graph = ConsistencyGraph::of(&problem, &prior_terms);
    let terms = PairTerms::of(&problem, &prior_terms, &graph);
    const SMALL: u64 = 300_000;
    let none = BTreeSet::new();
    let seeds = || Seeds::new(&model, (&terms, &prior_terms, &graph), &none, (NEEDED, 3.0), SMALL);
    let right = |swept: &Swept| {
        let members = swept.modes.first().map(|mode| mode.pairs(&graph)).unwrap_or_default();
        members.iter().filter(|pair| pair.model == pair.cloud).count()
    };
    let (alone, guided) = (seeds().sweep(), seeds().guided(3000 * SMALL).sweep());
    assert!(!alone.complete && right(&alone) < 18, "{} right", right(&alone));
    assert!(guided.complete && right(&guided) >= 34, "{} right", right(&guided));
}
