//! Tests of the answer beside the largest set: alternatives, bounds, rejections and cost.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

use super::*;
use crate::{candidates::Candidates, problem::Tolerance, site::model::ModelPoint};

#[test]
fn settings_out_of_range_are_rejected() {
    let good = MaximumClique::default();
    assert_eq!(good.check(), Ok(()));
    let message = MaximumClique { budget: 0, ..good.clone() }.check().unwrap_err();
    assert_eq!(message, "budget = 0; give 1 or more pair tests");
    assert!(MaximumClique { max_pairs: 2, ..good }.check().is_err());
}

/// A model, a cloud, and lists of candidates.
struct Scene {
    model: Vec<ModelPoint>,
    cloud: Vec<MeasuredPoint>,
    candidates: Candidates,
}

impl Scene {
    /// Every cloud point is a candidate of every model point.
    fn of(model: &[[f64; 3]], cloud: &[[f64; 3]]) -> Self {
        let seen = |at: &[f64; 3]| UncertainPoint::isotropic(Point::from(*at), 1e-3);
        Self {
            model: model.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect(),
            cloud: cloud.iter().map(|at| MeasuredPoint { position: seen(at), pixels: None }).collect(),
            candidates: Candidates::all(model.len(), cloud.len()),
        }
    }

    /// Cloud point j is a candidate of model point j modulo their number.
    fn named(mut self) -> Self {
        let count = self.model.len();
        self.candidates = Candidates::from_pairs(count, (0..self.cloud.len()).map(|j| (j % count, j)));
        self
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

    fn search(&self, search: &MaximumClique) -> Result<Identification, Rejected> {
        search.search(&self.problem(), &mut ChaCha8Rng::seed_from_u64(0))
    }
}

/// Points without symmetry.
fn scattered(count: usize) -> Vec<[f64; 3]> {
    (0..count).map(|k| [2.0, 3.0, 5.0].map(|p: f64| ((k + 1) as f64 * p.sqrt()).fract() * 2.0)).collect()
}

fn named(count: usize) -> Vec<Correspondence> {
    (0..count).map(|i| Correspondence { model: i, cloud: i }).collect()
}

fn moved(places: &[[f64; 3]], by: [f64; 3]) -> Vec<[f64; 3]> {
    places.iter().map(|at| [0, 1, 2].map(|k| at[k] + by[k])).collect()
}

const PYRAMID: [[f64; 3]; 8] = [
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [0.5, 0.5, 0.7],
    [-0.5, 0.5, 0.7],
    [-0.5, -0.5, 0.7],
    [0.5, -0.5, 0.7],
];

/// A truncated square pyramid maps onto itself by every quarter turn: three other sets of eight share no pair with the
/// best. They give other poses, so that all are in the answer, whatever number is requested.
#[test]
fn the_other_sets_of_a_symmetric_object_are_reported() {
    let scene = Scene::of(&PYRAMID, &PYRAMID);
    for alternatives in [64, 3, 2, 0] {
        let found = scene.search(&MaximumClique { alternatives, ..MaximumClique::default() }).unwrap();
        assert_eq!((found.pairs.len(), found.alternatives.len(), found.consensus_bound), (8, 3, 8), "{alternatives}");
        assert!(found.optimal && found.alternatives_complete && found.undecided.is_none(), "{alternatives}: {found:?}");
        assert!(found.alternatives.iter().flatten().all(|pair| !found.pairs.contains(pair)));
    }
}

/// Nine points, each measured twice within 2 mm: 512 sets with the same pose. The answer holds the requested number,
/// those with the fewest common pairs first.
#[test]
fn sets_that_are_alike_are_reported_as_far_as_asked_for() {
    let places = scattered(9);
    let scene = Scene::of(&places, &[&places[..], &moved(&places, [0.002, 0.0, 0.0])].concat()).named();
    let found = scene.search(&MaximumClique { alternatives: 5, ..MaximumClique::default() }).unwrap();
    assert_eq!((found.pairs.len(), found.alternatives.len(), found.alternatives_complete), (9, 5, false));
    assert!(found.optimal && found.undecided.is_none());
    let shared =
        |alternative: &Vec<Correspondence>| alternative.iter().filter(|pair| found.pairs.contains(pair)).count();
    assert_eq!(found.alternatives.iter().map(shared).collect::<Vec<_>>(), [0, 1, 1, 1, 1]);
    let all = scene.search(&MaximumClique { alternatives: 511, ..MaximumClique::default() }).unwrap();
    assert_eq!((all.alternatives.len(), all.alternatives_complete), (511, true));
    // The proof of equal poses costs tests, and is made only if there are more alternatives than requested.
    let apart = Scene::of(&places, &[&places[..], &moved(&places, [9.0, 0.0, 0.0])].concat()).named();
    let pair_tests =
        |alternatives| apart.search(&MaximumClique { alternatives, ..MaximumClique::default() }).unwrap().pair_tests;
    assert!(
        pair_tests(1) == pair_tests(64) && pair_tests(0) > pair_tests(1),
        "{} {} {}",
        pair_tests(0),
        pair_tests(1),
        pair_tests(64)
    );
    // Thirteen points have more such sets than the limit: the equal pose decides, and they are incomplete.
    let places = scattered(13);
    let scene = Scene::of(&places, &[&places[..], &moved(&places, [0.002, 0.0, 0.0])].concat()).named();
    let found = scene.search(&MaximumClique::default()).unwrap();
    assert_eq!((found.pairs.len(), found.alternatives.len(), found.alternatives_complete), (13, 64, false));
    assert!(found.optimal && found.undecided.is_none());
    // A sufficient number requests all sets found: their equal pose decides.
    let found = scene.search(&MaximumClique { alternatives: 10_000, ..MaximumClique::default() }).unwrap();
    assert_eq!((found.alternatives.len(), found.alternatives_complete, found.undecided), (MAX_TIES, false, None));
    // With a complete second object nine metres away they differ, and the undecided answer has its numbers.
    let doubled = [&places[..], &moved(&places, [0.002, 0.0, 0.0])].concat();
    let scene = Scene::of(&places, &[&doubled[..], &moved(&doubled, [9.0, 0.0, 0.0])].concat()).named();
    let found = scene.search(&MaximumClique::default()).unwrap();
    assert!(!found.alternatives_complete && found.alternatives.len() == MAX_TIES, "{}", found.alternatives.len());
    match found.undecided {
        Some(Rejected::Budget { budget: BUDGET, best: 13, bound: 13, pair_tests }) => {
            assert_eq!(pair_tests, found.pair_tests)
        }
        other => panic!("{other:?}"),
    }
}

/// The set of minimum residual; among equals up to rounding, the first.
#[test]
fn the_smallest_residual_decides_between_sets_of_one_size() {
    let places = scattered(5);
    let mut second = moved(&places, [5.0, 0.0, 0.0]);
    second[0][1] += 0.004;
    let scene = Scene::of(&places, &[&second[..], &places].concat()).named();
    let found = scene.search(&MaximumClique::default()).unwrap();
    assert!(found.pairs.iter().all(|pair| pair.cloud == pair.model + 5), "{:?}", found.pairs);
    assert_eq!((found.alternatives.len(), found.alternatives[0].clone()), (1, named(5)));
    let vertices: Vec<Correspondence> = [0, 5]
        .iter()
        .flat_map(|&j| named(5).into_iter().map(move |p| Correspondence { cloud: p.cloud + j, ..p }))
        .collect();
    let (first, other) = ((0..5).collect::<Vec<_>>(), (5..10).collect::<Vec<_>>());
    let of = |cliques: &[Vec<usize>]| min_residual(&scene.problem(), &vertices, cliques);
    assert_eq!((of(&[first.clone(), other.clone()]), of(&[other.clone(), first.clone()])), (1, 0));
    assert_eq!((of(&[other.clone(), other.clone()]), of(&[first.clone(), first, other])), (0, 2));
}

#[test]
fn alternatives_with_the_smallest_overlap_come_first() {
    let best = named(4);
    let other = |clouds: [usize; 4]| (0..4).map(|i| Correspondence { model: i, cloud: clouds[i] }).collect::<Vec<_>>();
    let mut alternatives = vec![other([0, 1, 2, 9]), other([9, 8, 7, 6]), other([0, 1, 8, 7]), other([7, 8, 2, 3])];
    MaximumClique::different_first(&best, &mut alternatives);
    assert_eq!(alternatives, [other([9, 8, 7, 6]), other([0, 1, 8, 7]), other([7, 8, 2, 3]), other([0, 1, 2, 9])]);
}

/// A mirror image of four points that are not coplanar is rejected; distances alone accept it. One of six points leaves
/// its four coplanar ones, undecided.
#[test]
fn mirror_images_are_reported() {
    let mirrored = |places: &[[f64; 3]]| places.iter().map(|[x, y, z]| [*x, *y, -z]).collect::<Vec<_>>();
    let four = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 1.5, 0.0], [3.0, 0.4, 1.1]];
    let scene = Scene::of(&four, &mirrored(&four)).named();
    let rejected = scene.search(&MaximumClique::default()).unwrap_err();
    assert_eq!(rejected, Rejected::Mirrored { best: 4, proved: true });
    let distances = MaximumClique { orientation: false, ..MaximumClique::default() };
    let found = scene.search(&distances).unwrap();
    assert_eq!((found.pairs.len(), found.undecided, found.optimal), (4, None, true));
    let six = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [1.7, 1.5, 0.0], [0.2, 1.1, 0.0], [0.4, 0.3, 1.0], [0.9, 0.8, 1.4]];
    let scene = Scene::of(&six, &mirrored(&six)).named();
    let found = scene.search(&MaximumClique::default()).unwrap();
    assert_eq!((found.pairs.len(), found.undecided), (4, Some(Rejected::Mirrored { best: 6, proved: false })));
    assert_eq!(scene.search(&distances).unwrap().undecided, None);
    // Three true points beside a fourth that agrees with two of them are three points, and no image.
    let mut cloud = four;
    cloud[3] = [30.0, 4.0, 11.0];
    let found = Scene::of(&four, &cloud).named().search(&MaximumClique::default()).unwrap();
    assert_eq!((found.pairs, found.undecided), (named(3), None));
}

/// A set stands if its image has as many points: only a larger image contradicts it.
#[test]
fn an_image_no_larger_than_the_set_contradicts_nothing() {
    let five = scattered(5);
    let image: Vec<_> = moved(&five, [7.0, 0.0, 0.0]).iter().map(|[x, y, z]| [*x, *y, -z]).collect();
    let found = Scene::of(&five, &[&five[..], &image].concat()).named().search(&MaximumClique::default()).unwrap();
    assert_eq!((found.pairs, found.undecided), (named(5), None));
    let found =
        Scene::of(&five, &[&five[..4], &[[50.0; 3]], &image].concat()).named().search(&MaximumClique::default());
    let found = found.unwrap();
    assert_eq!(found.undecided, Some(Rejected::Mirrored { best: 5, proved: false }));
}

/// Too small a set is rejected with its size and the pair tests; too many pairs are not searched.
#[test]
fn what_is_too_small_or_too_large_is_reported() {
    let four = scattered(4);
    let mut cloud = four.clone();
    (cloud[2], cloud[3]) = ([30.0, 0.0, 0.0], [0.0, 60.0, 0.0]);
    let scene = Scene::of(&four, &cloud).named();
    assert_eq!(scene.search(&MaximumClique::default()), Err(Rejected::NoConsensus { best: 2, needed: 3 }));
    // The budget ends before two are found to agree: the graph, and one test more.
    let ended = scene.search(&MaximumClique { budget: 1, ..MaximumClique::default() });
    assert_eq!(ended, Err(Rejected::Budget { budget: 1, best: 1, bound: 2, pair_tests: 6 + 1 }));
    let scene = Scene::of(&four, &four);
    let large = scene.search(&MaximumClique { max_pairs: 15, ..MaximumClique::default() }).unwrap_err();
    assert!(matches!(large, Rejected::TooLarge { size: 16, max: 15, .. }), "{large}");
    assert!(scene.search(&MaximumClique { max_pairs: 16, ..MaximumClique::default() }).is_ok());
}

/// Four labelled points have six pair tests, and the proof adds its own. A budget of one omits the proof.
#[test]
fn tests_are_those_of_the_graph_and_of_the_proof() {
    let four = scattered(4);
    let found = Scene::of(&four, &four).named().search(&MaximumClique::default()).unwrap();
    assert_eq!(found.pair_tests, 6 + 8);
    let ended = Scene::of(&four, &four).named().search(&MaximumClique { budget: 1, ..MaximumClique::default() });
    let ended = ended.unwrap();
    assert!(!ended.optimal && !ended.alternatives_complete, "{ended:?}");
    match ended.undecided {
        Some(Rejected::Budget { budget: 1, best, bound: 4, pair_tests }) => {
            assert!(best >= 3 && pair_tests >= 6, "{pair_tests}")
        }
        other => panic!("{other:?}"),
    }
}

/// Forty-five points with five on the wrong side of a plane: these are dropped, and with them the proof.
///
/// The points are tested against the first sixteen while the set grows, and completely in the end.
#[test]
fn large_sets_are_tested_for_mirror_images_as_a_unit() {
    let mut places: Vec<[f64; 3]> = scattered(45).iter().map(|[x, y, z]| [*x, *y, z - 1.0]).collect();
    let scene = Scene::of(&places, &places).named();
    let found = scene.search(&MaximumClique::default()).unwrap();
    assert!(found.pairs == named(45) && found.optimal && found.alternatives_complete, "{found:?}");
    // The pairs of the graph, and all quadruples of 45 points in the end.
    let grown = 237_170;
    assert_eq!(found.pair_tests, 990 + grown + 148_995);
    let flat = MaximumClique { orientation: false, ..MaximumClique::default() };
    let found = scene.search(&flat).unwrap();
    assert!(found.pairs == named(45) && found.pair_tests < 2_000, "{}", found.pair_tests);
    // Nearly coplanar points are coherent with their image.
    for at in &mut places {
        at[2] *= 1e-4;
    }
    let cloud: Vec<_> =
        places.iter().enumerate().map(|(k, [x, y, z])| [*x, *y, if k < 40 { *z } else { -z }]).collect();
    let scene = Scene::of(&places, &cloud).named();
    let found = scene.search(&MaximumClique::default()).unwrap();
    assert!(found.pairs.len() >= 40, "{}", found.pairs.len());
}

#[test]
fn pairs_stand_in_the_order_of_the_model() {
    let vertices = [(2, 0), (0, 1), (1, 2)].map(|(model, cloud)| Correspondence { model, cloud });
    let graph = Association { vertices: vertices.to_vec(), ..Association::of(&Scene::of(&[], &[]).problem()) };
    assert_eq!(pairs_of(&graph, &[0, 1, 2]), [vertices[1], vertices[2], vertices[0]]);
}
