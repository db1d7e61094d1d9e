use rand::SeedableRng;
use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

use super::*;
use crate::{candidates::Candidates, problem::Tolerance, site::model::ModelPoint};

#[test]
fn a_search_without_a_budget_is_rejected() {
    assert_eq!(StructuralCoherence::default().check(), Ok(()));
    let message = StructuralCoherence { budget: 0, ..StructuralCoherence::default() }.check().unwrap_err();
    assert_eq!(message, "budget = 0; give 1 or more pair tests");
}

#[test]
fn ordered_samples_come_in_lexicographic_order() {
    let mut sample = vec![0, 1];
    let mut all = vec![sample.clone()];
    while next_arrangement(&mut sample, 1, 3) {
        all.push(sample.clone());
    }
    assert_eq!(all, [[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1]]);
}

#[test]
fn subsets_come_in_lexicographic_order() {
    let mut sample = vec![0, 1, 2];
    let mut all = vec![sample.clone()];
    while next_combination(&mut sample, 2, 4) {
        all.push(sample.clone());
    }
    assert_eq!(all, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]);
}

const PLACES: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 1.5, 0.0], [3.0, 0.4, 1.1]];

/// Model points and a cloud, whose point i is the only candidate of model point i.
struct Scene {
    model: Vec<ModelPoint>,
    cloud: Vec<MeasuredPoint>,
    candidates: Candidates,
}

impl Scene {
    fn of(model: &[[f64; 3]], cloud: &[[f64; 3]]) -> Self {
        let seen = |at: &[f64; 3]| UncertainPoint::isotropic(Point::from(*at), 1e-3);
        Self {
            model: model.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect(),
            cloud: cloud.iter().map(|at| MeasuredPoint { position: seen(at), pixels: None }).collect(),
            candidates: Candidates::from_pairs(model.len(), (0..cloud.len()).map(|i| (i, i))),
        }
    }

    fn search(&self, search: &StructuralCoherence) -> Result<Identification, Rejected> {
        search.search(&self.problem(), &mut rand_chacha::ChaCha8Rng::seed_from_u64(0))
    }

    fn problem(&self) -> Problem<'_> {
        Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &self.candidates,
            tolerance: Tolerance::Fixed(0.01),
            prior: None,
            edges: Default::default(),
        }
    }
}

fn search(samples: Samples, budget: u64) -> StructuralCoherence {
    StructuralCoherence { samples, budget, ..StructuralCoherence::default() }
}

/// Budget, best and bound of an answer that the budget ended.
fn budget_of(ended: &Identification) -> (u64, usize, usize) {
    assert!(!ended.optimal);
    match ended.undecided {
        Some(Rejected::Budget { budget, best, bound, .. }) => (budget, best, bound),
        ref other => panic!("{other:?}"),
    }
}

/// Four points that agree are the first sample: six distances and one volume.
#[test]
fn the_tests_of_a_sample_are_its_distances_and_its_quadruples() {
    for samples in [Samples::Permutations, Samples::Combinations] {
        let found = Scene::of(&PLACES, &PLACES).search(&search(samples, 7)).unwrap();
        assert_eq!((found.pairs.len(), found.pair_tests, found.consensus_bound, found.optimal), (4, 7, 4, true));
        assert_eq!(found.undecided, None);
        let flat = StructuralCoherence { orientation: false, ..search(samples, 6) };
        assert_eq!(Scene::of(&PLACES, &PLACES).search(&flat).unwrap().pair_tests, 6);
    }
    let ended = Scene::of(&PLACES, &PLACES).search(&search(Samples::Permutations, 6)).unwrap();
    assert_eq!(budget_of(&ended), (6, 4, 4));
}

/// The last of four points agrees with none.
///
/// It is detected after one test in first, second and third place, and after three tests in fourth: the 24
/// permutations take 6 (1 + 1 + 2 + 4) tests and the first three points 3 more. Combinations take 4 + 3.
#[test]
fn a_point_that_agrees_with_none_costs_what_its_samples_cost() {
    let mut cloud = PLACES;
    cloud[3] = [9.0, 9.0, 9.0];
    let scene = Scene::of(&PLACES, &cloud);
    for (samples, pair_tests) in [(Samples::Permutations, 51), (Samples::Combinations, 7)] {
        let found = scene.search(&search(samples, pair_tests)).unwrap();
        assert_eq!(
            (found.pairs.len(), found.pair_tests, found.consensus_bound, found.optimal),
            (3, pair_tests, 3, true)
        );
        let ended = scene.search(&search(samples, pair_tests - 1)).unwrap();
        assert_eq!(budget_of(&ended), (pair_tests - 1, 3, 3));
    }
}

/// Sixteen points agree by 120 distances and 1820 volumes, and sampling them costs as much as one more.
#[test]
fn to_draw_sixteen_points_costs_as_much_as_a_test() {
    let places: Vec<[f64; 3]> =
        (0..16).map(f64::from).map(|k| [k, (k * 1.7).sin() * 3.0, (k * 0.9).cos() * 2.0]).collect();
    let scene = Scene::of(&places, &places);
    let found = scene.search(&search(Samples::Combinations, 1941)).unwrap();
    assert_eq!((found.pairs.len(), found.pair_tests, found.undecided), (16, 1940, None));
    let ended = scene.search(&search(Samples::Combinations, 1940)).unwrap();
    assert_eq!(budget_of(&ended), (1940, 16, 16));
}

/// No three points agree: the two of them that do are found, by permutations or by pairs in the end.
#[test]
fn the_size_of_the_largest_set_is_reported_where_it_is_too_small() {
    let (model, mut cloud) = (&PLACES[..3], [[9.0, 9.0, 9.0], PLACES[1], PLACES[2]]);
    let best = |cloud: &[[f64; 3]], samples, budget| match Scene::of(model, cloud).search(&search(samples, budget)) {
        Err(Rejected::NoConsensus { best, needed: 3 }) => Ok(best),
        Err(Rejected::Budget { best, bound, pair_tests, .. }) => Err((best, bound, pair_tests)),
        other => panic!("{other:?}"),
    };
    for samples in [Samples::Permutations, Samples::Combinations] {
        assert_eq!(best(&cloud, samples, 100), Ok(2));
    }
    // One test of the three, then the pairs (0, 1), (0, 2) and (1, 2).
    assert_eq!(best(&cloud, Samples::Combinations, 4), Ok(2));
    assert_eq!(best(&cloud, Samples::Combinations, 3), Err((1, 2, 3)));
    cloud[1] = [-9.0, 9.0, 9.0];
    cloud[2] = [0.0, 0.0, 50.0];
    for samples in [Samples::Permutations, Samples::Combinations] {
        assert_eq!(best(&cloud, samples, 100), Ok(1));
    }
    let few = Rejected::TooFew { with_candidates: 2, needed: 3 };
    assert_eq!(Scene::of(model, &cloud[..2]).search(&search(Samples::Permutations, 9)), Err(few));
}

/// Four points and their mirror image: no fix with orientation, a fix without.
#[test]
fn a_mirror_image_is_reported_with_its_size() {
    let image = PLACES.map(|[x, y, z]| [x, y, -z]);
    for samples in [Samples::Permutations, Samples::Combinations] {
        let rejected = Scene::of(&PLACES, &image).search(&search(samples, 1000)).unwrap_err();
        assert_eq!(rejected, Rejected::Mirrored { best: 4, proved: true });
        let distances = StructuralCoherence { orientation: false, ..search(samples, 1000) };
        assert_eq!(Scene::of(&PLACES, &image).search(&distances).unwrap().pairs.len(), 4);
    }
}

/// Four coplanar points of a mirror image of six also fit a motion: the result is undecided.
#[test]
fn the_flat_part_of_a_mirror_image_is_undecided() {
    let model = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [1.7, 1.5, 0.0], [0.2, 1.1, 0.0], [0.4, 0.3, 1.0], [0.9, 0.8, 1.4]];
    let image = model.map(|[x, y, z]| [x, y, -z]);
    let found = Scene::of(&model, &image).search(&search(Samples::Combinations, 10_000)).unwrap();
    assert_eq!(found.pairs.len(), 4);
    assert_eq!(found.undecided, Some(Rejected::Mirrored { best: 6, proved: false }));
}

/// The first candidates of each list are tried first; those of the last point change fastest.
#[test]
fn every_choice_of_candidates_is_tried() {
    let cloud = [[50.0, 0.0, 0.0], [60.0, 9.0, 0.0], [70.0, 0.0, 7.0], PLACES[0], PLACES[1], PLACES[2]];
    let (model, cloud) = (Scene::of(&PLACES[..3], &[]).model, Scene::of(&cloud, &cloud).cloud);
    let scene = Scene { model, cloud, candidates: Candidates::all(3, 6) };
    let found = scene.search(&search(Samples::Combinations, 100_000)).unwrap();
    let expected: Vec<_> = (0..3).map(|i| Correspondence { model: i, cloud: 3 + i }).collect();
    assert_eq!(found.pairs, expected);
}

/// The search test by test: samples, choices and pairs in the order in which the enumeration counts them.
fn literally(scene: &Scene, problem: &Problem<'_>, search: &StructuralCoherence) -> (Option<usize>, u64, usize) {
    let n = scene.model.len();
    let (mut pair_tests, mut sampled, mut best) = (0, 0, 0);
    for q in (NEEDED..=n).rev() {
        let mut sample: Vec<usize> = (0..q).collect();
        loop {
            let lists: Vec<&[usize]> = sample.iter().map(|&point| scene.candidates.lists[point].as_slice()).collect();
            let mut choice = vec![0; q];
            'choices: loop {
                let pair = |place: usize| Correspondence { model: sample[place], cloud: lists[place][choice[place]] };
                let pairs: Vec<Correspondence> = (0..q).map(pair).collect();
                sampled += (q * q) as u64 / DRAWING;
                let mut coherent = true;
                'tests: for place in 0..q {
                    for before in 0..place {
                        if pair_tests + sampled >= search.budget {
                            return (None, pair_tests, best);
                        }
                        pair_tests += 1;
                        if !problem.coherent(pairs[place], pairs[before]) {
                            coherent = false;
                            break 'tests;
                        }
                    }
                    best = best.max(place + 1);
                }
                if coherent {
                    return (Some(q), pair_tests, best);
                }
                for place in (0..q).rev() {
                    if choice[place] + 1 < lists[place].len() {
                        choice[place] += 1;
                        choice[place + 1..].fill(0);
                        continue 'choices;
                    }
                }
                break;
            }
            let more = match search.samples {
                Samples::Combinations => next_combination(&mut sample, q - 1, n),
                Samples::Permutations => next_arrangement(&mut sample, q - 1, n),
            };
            if !more {
                break;
            }
        }
    }
    (Some(0), pair_tests, best)
}

/// The counts equal those of a search test by test.
///
/// They are compared at every budget up to the end of small searches, and at some budgets of a search whose samples
/// are long enough for their sampling to count.
#[test]
fn what_is_counted_is_what_would_be_tested_one_by_one() {
    use rand::RngExt;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    for case in 0..60 {
        let (points, max) = if case < 55 { (3 + case % 3, 3) } else { (17 + case % 2, 2) };
        let mut place = || std::array::from_fn(|_| f64::from(rng.random_range(0..3_u32)));
        let model: Vec<[f64; 3]> = (0..points).map(|_| place()).collect();
        let mut cloud = model.clone();
        (0..points).step_by(2).for_each(|i| cloud[i] = place());
        let mut scene = Scene::of(&model, &cloud);
        let some = |i: usize, rng: &mut rand_chacha::ChaCha8Rng| {
            let list: Vec<usize> = (0..rng.random_range(1..=max)).map(|k| (i + k) % points).collect();
            list.into_iter().map(move |j| (i, j))
        };
        let pairs: Vec<(usize, usize)> = (0..points).flat_map(|i| some(i, &mut rng)).collect();
        scene.candidates = Candidates::from_pairs(points, pairs);
        let problem = scene.problem();
        for samples in [Samples::Permutations, Samples::Combinations] {
            let budgets: Vec<u64> = if points < 10 { (1..400).collect() } else { (1..40).map(|k| k * 977).collect() };
            for budget in budgets {
                let search = StructuralCoherence { orientation: false, ..search(samples, budget) };
                let lists = (0..points).map(|i| (i, scene.candidates.lists[i].as_slice())).collect();
                let mut of = Enumeration::of(&problem, lists, samples, false, budget);
                let mut found = Some(0);
                for q in (NEEDED..=points).rev() {
                    match of.samples_of(q) {
                        Ok(None) => continue,
                        Ok(Some(pairs)) => found = Some(pairs.len()),
                        Err(Spent) => found = None,
                    }
                    break;
                }
                let counted = (found, of.pair_tests, of.best);
                assert_eq!(counted, literally(&scene, &problem, &search), "case {case}, {samples:?}, {budget}");
            }
        }
    }
}

/// Σ over subsets of two of 2, 3 and 5: 6 + 10 + 15.
#[test]
fn products_of_subsets_are_summed_up() {
    assert_eq!(products(&[2, 3, 5], 2, 100), 31);
    assert_eq!((products(&[2, 3, 5], 0, 100), products(&[2, 3, 5], 3, 100)), (1, 30));
    assert!(products(&[1; 200], 100, 1 << 40) > 1 << 40 && products(&[7; 200], 199, u128::MAX) == u128::MAX);
}
