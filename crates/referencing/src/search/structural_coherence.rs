//! Structural coherence: the paper's search, in the paper's order.

use rand::Rng;
use seafix_component::{Component, in_range};
use serde::{Deserialize, Serialize};

use super::{
    BUDGET, Identification, NEEDED, Search, Unidentified,
    association::vertices,
    grow::so_far,
    orientation::{fours, mirrored, wholly_mirrored},
};
use crate::{Correspondence, Problem};

/// Which samples of q model points are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Samples {
    /// The paper's ordered samples A_n^q: each set of points q! times.
    #[default]
    Permutations,
    /// Each set of points once.
    Combinations,
}

/// The paper's Stage 2: for q from n down to 3, for each sample of q model points in lexicographic
/// order, for each choice of one candidate a point, all q(q − 1)/2 distances are compared; the
/// first sample that agrees in all is the answer.
///
/// Σ_q n!/(n − q)! m^q choices of m candidates a point; with combinations q! times fewer. What the answer says is exact,
/// what it costs is not bearable beyond some ten points: the budget ends it, and the refusal tells how far it came.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct StructuralCoherence {
    /// Which samples are tried.
    pub samples: Samples,
    /// Whether mirror images are refused; `false` is the paper's distances alone.
    pub orientation: bool,
    /// Pair tests before it gives up.
    pub budget: u64,
}

impl Default for StructuralCoherence {
    fn default() -> Self {
        Self { samples: Samples::default(), orientation: true, budget: BUDGET }
    }
}

impl Component for StructuralCoherence {
    const NAME: &'static str = "structural-coherence";
    const SUMMARY: &'static str = "the paper's enumeration of ordered samples, longest first";
    const SOURCE: &'static str = "Bobkov, Kudryashov, Inzartsev, Method for the coordination of referencing of \
                                  autonomous underwater vehicles to man-made objects using stereo images, 2021, Sec. 2.2";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the number of model points in the first coherent sample, longest samples first, candidates from the shells",
        ),
        ("exact", "within its budget, of coherence alone"),
        ("time", "Σ_q n!/(n − q)! m^q choices of m candidates a point; with combinations q! times fewer"),
    ];

    fn check(&self) -> Result<(), String> {
        in_range(self.budget > 0, "budget", self.budget, "1 or more pair tests")
    }
}

impl Search for StructuralCoherence {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Unidentified> {
        let with_candidates = problem.candidates.with_candidates();
        if with_candidates < NEEDED {
            return Err(Unidentified::TooFew { with_candidates, needed: NEEDED });
        }
        // Points are numbered by their coordinates: the answer does not depend on the order they came in.
        // A model point without candidates is in no sample's product: leaving it out changes no answer.
        let vertices = vertices(problem);
        let choices: Vec<usize> = vertices.iter().map(|pair| pair.cloud).collect();
        let mut lists = Vec::new();
        let mut rest = choices.as_slice();
        for same in vertices.chunk_by(|a, b| a.model == b.model) {
            let (list, later) = rest.split_at(same.len());
            lists.push((same[0].model, list));
            rest = later;
        }
        Enumeration::of(problem, lists, self.samples, self.orientation, self.budget).run(with_candidates)
    }
}

/// The budget is spent.
struct Spent;

/// To draw a sample of q points costs as much as q²/256 pair tests: nothing at the paper's scale, and more than its tests
/// among hundreds of points, of which the first two usually disagree.
const DRAWING: u64 = 256;

/// Samples of model points, longest first, and the choices of one candidate each.
pub(super) struct Enumeration<'a> {
    problem: &'a Problem<'a>,
    /// Model points and their candidates.
    lists: Vec<(usize, &'a [usize])>,
    samples: Samples,
    orientation: bool,
    budget: u64,
    tests: u64,
    /// What drawing samples has cost, in pair tests.
    drawn: u64,
    /// Size of the largest coherent set met so far, as the beginning of a longer sample.
    best: usize,
    /// Size of the first, hence largest, coherent sample that was wholly a mirror image.
    mirrored: Option<usize>,
}

impl<'a> Enumeration<'a> {
    pub(super) fn of(
        problem: &'a Problem<'a>,
        lists: Vec<(usize, &'a [usize])>,
        samples: Samples,
        orientation: bool,
        budget: u64,
    ) -> Self {
        Self { problem, lists, samples, orientation, budget, tests: 0, drawn: 0, best: 0, mirrored: None }
    }

    /// The first coherent sample, of at most `longest` points.
    pub(super) fn run(mut self, longest: usize) -> Result<Identification, Unidentified> {
        for q in (NEEDED..=self.lists.len().min(longest)).rev() {
            match self.samples_of(q) {
                // Three points have no orientation: these are what is left of a mirror image.
                Ok(Some(_)) if q == NEEDED && self.mirrored.is_some() => {
                    return Err(Unidentified::Mirrored { best: self.mirrored.unwrap_or(q), proved: true });
                }
                Ok(Some(mut pairs)) => {
                    pairs.sort_unstable();
                    // A longer sample was a mirror image: what is left of it is no fix.
                    let undecided = self.mirrored.map(|best| Unidentified::Mirrored { best, proved: false });
                    return Ok(Identification {
                        optimal: true,
                        undecided,
                        belief: None,
                        ..Identification::unproved(pairs, q, self.tests)
                    });
                }
                Ok(None) => {}
                Err(Spent) => {
                    let (budget, best) = (self.budget, self.best);
                    let ended = Unidentified::Budget { budget, best, bound: q, tests: self.tests };
                    return so_far(self.problem, self.orientation, ended);
                }
            }
        }
        // Two that agree and begin no sample of three were not met.
        if self.best < 2 && self.lists.len() >= 2 {
            match self.samples_of(2) {
                Ok(Some(_)) => self.best = 2,
                Ok(None) => {}
                Err(Spent) => {
                    let (budget, best) = (self.budget, self.best);
                    return Err(Unidentified::Budget { budget, best, bound: 2, tests: self.tests });
                }
            }
        }
        Err(Unidentified::NoConsensus { best: self.best, needed: NEEDED })
    }

    /// The first coherent choice of candidates among the samples of length `q`.
    fn samples_of(&mut self, q: usize) -> Result<Option<Vec<Correspondence>>, Spent> {
        let mut sample: Vec<usize> = (0..q).collect();
        loop {
            if let Some(found) = self.product_of(&sample)? {
                return Ok(Some(found));
            }
            let more = match self.samples {
                Samples::Combinations => next_combination(&mut sample, self.lists.len()),
                Samples::Permutations => next_arrangement(&mut sample, self.lists.len()),
            };
            if !more {
                return Ok(None);
            }
        }
    }

    /// The first coherent choice of one candidate for each of these model points.
    fn product_of(&mut self, sample: &[usize]) -> Result<Option<Vec<Correspondence>>, Spent> {
        let lists: Vec<(usize, &[usize])> = sample.iter().map(|&place| self.lists[place]).collect();
        let mut choice = vec![0; lists.len()];
        loop {
            let pair =
                |(&(model, list), &place): (&(usize, &[usize]), &usize)| Correspondence { model, cloud: list[place] };
            let pairs: Vec<Correspondence> = lists.iter().zip(&choice).map(pair).collect();
            self.drawn += (pairs.len() * pairs.len()) as u64 / DRAWING;
            if self.agrees(&pairs)? {
                return Ok(Some(pairs));
            }
            // The last point's candidate changes fastest.
            let Some(place) = (0..lists.len()).rev().find(|&place| choice[place] + 1 < lists[place].1.len()) else {
                return Ok(None);
            };
            choice[place] += 1;
            choice[place + 1..].fill(0);
        }
    }

    /// Whether all distances agree; the tests end at the first that does not.
    fn agrees(&mut self, pairs: &[Correspondence]) -> Result<bool, Spent> {
        for (place, &a) in pairs.iter().enumerate() {
            for &b in &pairs[..place] {
                if self.tests + self.drawn >= self.budget {
                    return Err(Spent);
                }
                self.tests += 1;
                if !self.problem.coherent(a, b) {
                    return Ok(false);
                }
            }
            self.best = self.best.max(place + 1);
        }
        if self.orientation {
            for four in fours(pairs) {
                if self.tests + self.drawn >= self.budget {
                    return Err(Spent);
                }
                self.tests += 1;
                if mirrored(self.problem, four) {
                    if self.mirrored.is_none() && wholly_mirrored(self.problem, pairs) {
                        self.mirrored = Some(pairs.len());
                    }
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }
}

/// The next subset of `0..n` in lexicographic order; false after the last.
fn next_combination(sample: &mut [usize], n: usize) -> bool {
    let q = sample.len();
    let Some(place) = (0..q).rev().find(|&place| sample[place] < n - q + place) else { return false };
    sample[place] += 1;
    for later in place + 1..q {
        sample[later] = sample[later - 1] + 1;
    }
    true
}

/// The next ordered sample of `0..n` without repetition, in lexicographic order; false after the last.
fn next_arrangement(sample: &mut [usize], n: usize) -> bool {
    for place in (0..sample.len()).rev() {
        let next = (sample[place] + 1..n).find(|value| !sample[..place].contains(value));
        if let Some(value) = next {
            sample[place] = value;
            for later in place + 1..sample.len() {
                let least = (0..n).find(|value| !sample[..later].contains(value));
                sample[later] = least.expect("a sample is not longer than what it is drawn from");
            }
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use seafix_geometry::{MeasuredPoint, Point, UncertainPoint};

    use super::*;
    use crate::{Candidates, ModelPoint, Tolerance};

    #[test]
    fn a_search_without_a_budget_is_refused() {
        assert_eq!(StructuralCoherence::default().check(), Ok(()));
        let message = StructuralCoherence { budget: 0, ..StructuralCoherence::default() }.check().unwrap_err();
        assert_eq!(message, "budget = 0; give 1 or more pair tests");
    }

    #[test]
    fn ordered_samples_come_in_lexicographic_order() {
        let mut sample = vec![0, 1];
        let mut all = vec![sample.clone()];
        while next_arrangement(&mut sample, 3) {
            all.push(sample.clone());
        }
        assert_eq!(all, [[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1]]);
    }

    #[test]
    fn subsets_come_in_lexicographic_order() {
        let mut sample = vec![0, 1, 2];
        let mut all = vec![sample.clone()];
        while next_combination(&mut sample, 4) {
            all.push(sample.clone());
        }
        assert_eq!(all, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]);
    }

    const PLACES: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 1.5, 0.0], [3.0, 0.4, 1.1]];

    /// Model points and a cloud, point i of it the only candidate of point i.
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

        fn search(&self, search: &StructuralCoherence) -> Result<Identification, Unidentified> {
            let problem = Problem {
                model: &self.model,
                cloud: &self.cloud,
                candidates: &self.candidates,
                tolerance: Tolerance::Fixed(0.01),
                prior: None,
            };
            search.search(&problem, &mut rand_chacha::ChaCha8Rng::seed_from_u64(0))
        }
    }

    fn search(samples: Samples, budget: u64) -> StructuralCoherence {
        StructuralCoherence { samples, budget, ..StructuralCoherence::default() }
    }

    /// Budget, best and bound of an answer that the budget ended.
    fn budget_of(ended: &Identification) -> (u64, usize, usize) {
        assert!(!ended.optimal);
        match ended.undecided {
            Some(Unidentified::Budget { budget, best, bound, .. }) => (budget, best, bound),
            ref other => panic!("{other:?}"),
        }
    }

    /// Four points that agree are the first sample: six distances and one volume.
    #[test]
    fn the_tests_of_a_sample_are_its_distances_and_its_fours() {
        for samples in [Samples::Permutations, Samples::Combinations] {
            let found = Scene::of(&PLACES, &PLACES).search(&search(samples, 7)).unwrap();
            assert_eq!((found.pairs.len(), found.tests, found.size_bound, found.optimal), (4, 7, 4, true));
            assert_eq!(found.undecided, None);
            let flat = StructuralCoherence { orientation: false, ..search(samples, 6) };
            assert_eq!(Scene::of(&PLACES, &PLACES).search(&flat).unwrap().tests, 6);
        }
        let ended = Scene::of(&PLACES, &PLACES).search(&search(Samples::Permutations, 6)).unwrap();
        assert_eq!(budget_of(&ended), (6, 4, 4));
    }

    /// The last of four points agrees with none: it is met at once in first and second place, after one test in third and after three
    /// in fourth, so that the 24 arrangements take 6 (1 + 1 + 2 + 4) tests and the first three points 3 more. Of subsets it is 4 + 3.
    #[test]
    fn a_point_that_agrees_with_none_costs_what_its_samples_cost() {
        let mut cloud = PLACES;
        cloud[3] = [9.0, 9.0, 9.0];
        let scene = Scene::of(&PLACES, &cloud);
        for (samples, tests) in [(Samples::Permutations, 51), (Samples::Combinations, 7)] {
            let found = scene.search(&search(samples, tests)).unwrap();
            assert_eq!((found.pairs.len(), found.tests, found.size_bound, found.optimal), (3, tests, 3, true));
            let ended = scene.search(&search(samples, tests - 1)).unwrap();
            assert_eq!(budget_of(&ended), (tests - 1, 3, 3));
        }
    }

    /// Sixteen points agree by 120 distances and 1820 volumes, and to draw them costs as much as one more.
    #[test]
    fn to_draw_sixteen_points_costs_as_much_as_a_test() {
        let places: Vec<[f64; 3]> =
            (0..16).map(f64::from).map(|k| [k, (k * 1.7).sin() * 3.0, (k * 0.9).cos() * 2.0]).collect();
        let scene = Scene::of(&places, &places);
        let found = scene.search(&search(Samples::Combinations, 1941)).unwrap();
        assert_eq!((found.pairs.len(), found.tests, found.undecided), (16, 1940, None));
        let ended = scene.search(&search(Samples::Combinations, 1940)).unwrap();
        assert_eq!(budget_of(&ended), (1940, 16, 16));
    }

    /// No three points agree: of three whose second and third do, the two are found, by arrangements or by pairs in the end.
    #[test]
    fn the_size_of_the_largest_set_is_told_where_it_is_too_small() {
        let (model, mut cloud) = (&PLACES[..3], [[9.0, 9.0, 9.0], PLACES[1], PLACES[2]]);
        let best = |cloud: &[[f64; 3]], samples, budget| match Scene::of(model, cloud).search(&search(samples, budget))
        {
            Err(Unidentified::NoConsensus { best, needed: 3 }) => Ok(best),
            Err(Unidentified::Budget { best, bound, tests, .. }) => Err((best, bound, tests)),
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
        let few = Unidentified::TooFew { with_candidates: 2, needed: 3 };
        assert_eq!(Scene::of(model, &cloud[..2]).search(&search(Samples::Permutations, 9)), Err(few));
    }

    /// Four points and their mirror image: no fix with orientation, and one without.
    #[test]
    fn a_mirror_image_is_told_with_its_size() {
        let image = PLACES.map(|[x, y, z]| [x, y, -z]);
        for samples in [Samples::Permutations, Samples::Combinations] {
            let refused = Scene::of(&PLACES, &image).search(&search(samples, 1000)).unwrap_err();
            assert_eq!(refused, Unidentified::Mirrored { best: 4, proved: true });
            let distances = StructuralCoherence { orientation: false, ..search(samples, 1000) };
            assert_eq!(Scene::of(&PLACES, &image).search(&distances).unwrap().pairs.len(), 4);
        }
    }

    /// The four flat points of a mirror image of six fit a motion as well: what they say is undecided.
    #[test]
    fn the_flat_part_of_a_mirror_image_is_undecided() {
        let model =
            [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [1.7, 1.5, 0.0], [0.2, 1.1, 0.0], [0.4, 0.3, 1.0], [0.9, 0.8, 1.4]];
        let image = model.map(|[x, y, z]| [x, y, -z]);
        let found = Scene::of(&model, &image).search(&search(Samples::Combinations, 10_000)).unwrap();
        assert_eq!(found.pairs.len(), 4);
        assert_eq!(found.undecided, Some(Unidentified::Mirrored { best: 6, proved: false }));
    }

    /// The first candidates of the list of each point are tried first, those of the last point in turn.
    #[test]
    fn every_choice_of_candidates_is_tried() {
        let cloud = [[50.0, 0.0, 0.0], [60.0, 9.0, 0.0], [70.0, 0.0, 7.0], PLACES[0], PLACES[1], PLACES[2]];
        let (model, cloud) = (Scene::of(&PLACES[..3], &[]).model, Scene::of(&cloud, &cloud).cloud);
        let scene = Scene { model, cloud, candidates: Candidates::all(3, 6) };
        let found = scene.search(&search(Samples::Combinations, 100_000)).unwrap();
        let expected: Vec<_> = (0..3).map(|i| Correspondence { model: i, cloud: 3 + i }).collect();
        assert_eq!(found.pairs, expected);
    }
}
