//! The support of a pose by independent putative pairs, compared with that of wrong poses in the same frame.

use nalgebra::Vector3;

use super::{
    bits::{ones, shared},
    fit::fit,
    graph::ConsistencyGraph,
    likelihood::{Mode, PairTerms, Term},
    motion::Motion,
    places::{LOOSE, Places},
    prior_terms::PriorTerms,
    seeds::guided::{beginning, fitted, stride, symmetric},
};
use crate::{a_contrario::coordinates::CONFIDENCE, chi_square::chi_square, search::limits::NEEDED};

/// Distance (standard deviations of a measurement) below which two points may be one place, as for
/// [`ClutterDensity`](super::clutter_density::ClutterDensity).
const ONE_PLACE: f64 = 5.0;
/// Distance (standard deviations) from their place under the best pose up to which pairs are withheld from wrong poses.
///
/// Pairs that are one place off support neighbouring poses, which are no sample of wrong ones.
const WITHHELD: f64 = 2.0 * ONE_PLACE;
/// Distance (standard deviations of a measurement) below which the errors of two pairs are correlated.
///
/// Descriptors of overlapping neighbourhoods are matched with a common error: in 116 sets of 28 pairs of scans from 16
/// sources (FPFH; outside of this repository) the errors of pairs within 5σ correlate at 0.32, within 10σ at 0.20,
/// within 20σ at 0.12. With one pair for each 10σ the median NEES of their fixes falls from 65 to 13 (5.3 expected); with
/// one for each 20σ to 5.2, but then the predicted error of 13 sound fixes exceeds the alert limit.
const CORRELATED: f64 = 2.0 * ONE_PLACE;
/// −ln of the probability that chance fits as many places to a pose alone: 1e-3.
const LN_ACCIDENTAL: f64 = 6.9;
/// Number of seeds of wrong poses: the largest of 256 is exceeded by one wrong pose in 256.
const WRONG_POSES: usize = 256;
/// Number of wrong poses of most places that are compared, since support grows with the number of places.
const COMPARED: usize = 16;
/// Maximum number of pairs whose partners are counted about a pose; the count of more is extrapolated.
const COUNTED: usize = 1024;

/// What independent pairs say about the poses of a large set of putative pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// ln of the number of false alarms of the best pose.
    pub ln_nfa: f64,
    /// ln of the odds of each explanation against the best pose, in their order.
    pub ln_odds: Vec<f64>,
    /// ln of the odds of the best wrong pose of other pairs against the best pose.
    pub ln_odds_elsewhere: f64,
    /// The number of pairs of the best pose for each place, one at least: neighbouring pairs have common errors.
    pub pairs_per_place: f64,
}

/// The independent pairs of a large putative set.
///
/// # Support
///
/// Descriptors of overlapping neighbourhoods are alike: wrong pairs come in groups, side by side in model and cloud,
/// and a pose that fits one of a group fits all. Pairs are therefore counted by places. Of pairs that are side by side
/// at both ends one is kept, and the number k of places of a pose is the smaller of those in the model and in the
/// cloud. If partners are shuffled among the kept pairs, the expected number that fit the pose is μ; it is large where
/// the pose puts a surface on a surface. Three pairs determine the pose, and the probability that k − 3 others fit is
/// at most e^(−s) (Chernoff's bound, Hoeffding 1963), with the support
///
/// s = (k − 3) ln ((k − 3)/μ) − (k − 3 − μ).
///
/// With N kept pairs of which two are compatible with the probability q, there are C(N, 3) q³ poses, and
/// NFA = C(N, 3) q³ e^(−s).
///
/// # Wrong poses
///
/// Without further structure the best wrong pose has the support ln C(N, 3) q³, since P(s ≥ x) ≤ e^(−x) for each. Wrong
/// poses are sampled in the frame itself, from pairs that the best pose does not explain (target–decoy competition,
/// Elias and Gygi 2007). Each of m seeds among M such pairs leads to the best pose that holds it, so that the best of
/// the sample is expected to have s₀ = ln C(N, 3) q³ − ln M/m. If it has more, s₁ > s₀, the pairs are not as independent
/// as assumed, and all supports are divided by s₁/s₀.
pub(in crate::search) struct IndependentPairs<'a> {
    terms: &'a PairTerms,
    graph: &'a ConsistencyGraph,
    prior_terms: &'a PriorTerms,
    /// The kept pairs, by the first coordinate of their cloud points.
    kept: Vec<usize>,
    /// The largest distance at which a kept cloud point fits a place (m).
    reach: f64,
    /// ln C(N, 3) q³.
    ln_poses: f64,
}

impl<'a> IndependentPairs<'a> {
    pub(in crate::search) fn of(
        (terms, prior_terms, graph): (&'a PairTerms, &'a PriorTerms, &'a ConsistencyGraph),
    ) -> Self {
        let mut kept = apart(terms, 0..terms.pairs.len(), one_place, |pair| [pair.cloud, pair.model]);
        kept.sort_by(|&a, &b| terms.pairs[a].cloud.x.total_cmp(&terms.pairs[b].cloud.x).then(a.cmp(&b)));
        let count = terms.pairs.len() as f64;
        let edges: usize = (0..terms.pairs.len()).map(|v| shared(graph.row(v), graph.row(v), 0)).sum();
        let compatible = edges as f64 / (0.5 * count * (count - 1.0));
        let n = kept.len() as f64;
        let ln_poses = libm::log(n * (n - 1.0) * (n - 2.0) / 6.0) + 3.0 * libm::log(compatible);
        let variance = terms.pairs.iter().map(|pair| pair.variance).fold(0.0, f64::max);
        Self { terms, graph, prior_terms, kept, reach: (far() * variance).sqrt(), ln_poses: ln_poses.max(1.0) }
    }

    /// The support of the best pose, of other explanations, and of wrong poses.
    pub(in crate::search) fn support(&self, modes: &[Mode]) -> Option<Support> {
        let best = modes.first()?;
        let places = Places::of(self.terms);
        let (wrong, ln_sampled) = self.wrong(best, &places);
        let scale = ((self.ln_poses - ln_sampled).max(1.0) / wrong).min(1.0);
        let own = self.of_motion(&best.motion, &places);
        let ln_odds = |other: &Mode| {
            let common = other.members.iter().filter(|&&v| best.holds(v)).count();
            match 2 * common > other.members.len() {
                true => other.ln_uniform - best.ln_uniform,
                false => scale * (self.of_motion(&other.motion, &places) - own),
            }
        };
        let apart = self.places(&best.members, correlated).max(1);
        Some(Support {
            ln_nfa: self.ln_poses - scale * own,
            ln_odds: modes.iter().map(ln_odds).collect(),
            ln_odds_elsewhere: scale * (wrong - own),
            pairs_per_place: (best.members.len() as f64 / apart as f64).max(1.0),
        })
    }

    /// Whether the mirror image of a pose explains it away: the pose is the part of the image that lies in a plane.
    ///
    /// Then nothing but chance fits the pose alone. An object with a plane of symmetry has a mirror image too, by
    /// descriptors that do not tell left from right, but its pose explains places that the image does not.
    pub(in crate::search) fn explains(&self, image: &Motion, pose: &Motion) -> bool {
        let places = Places::of(self.terms);
        let near = places.near(self.terms, self.graph, pose, 0).unwrap_or_default();
        let alone = near.into_iter().filter(|&v| self.d2(v, pose) <= far() && !(self.d2(v, image) <= LOOSE));
        chernoff(self.places(&alone.collect::<Vec<_>>(), correlated) as f64, self.expected(pose)) <= LN_ACCIDENTAL
    }

    /// The support (nats) of a motion by all pairs that fit it, counted as for wrong poses.
    ///
    /// The pairs of a mode are fewer: each of their cloud points has one partner.
    fn of_motion(&self, motion: &Motion, places: &Places) -> f64 {
        let of = || {
            let near = places.near(self.terms, self.graph, motion, NEEDED)?;
            let (fitted, _) = fit(self.terms, self.prior_terms, &near, motion, 2)?;
            // A fit that loses the pairs of the motion is another pose.
            let kept = near.iter().filter(|&&v| self.d2(v, &fitted) <= LOOSE).count();
            let motion = if 2 * kept > near.len() { fitted } else { *motion };
            Some(self.of_pose(&places.near(self.terms, self.graph, &motion, NEEDED)?, &motion))
        };
        of().unwrap_or(0.0)
    }

    /// The support of a pose with these pairs (nats).
    fn of_pose(&self, members: &[usize], motion: &Motion) -> f64 {
        let far = far();
        let near: Vec<usize> = members.iter().copied().filter(|&v| self.d2(v, motion) <= far).collect();
        let more = self.places(&near, one_place) as f64 - NEEDED as f64;
        chernoff(more, self.expected(motion))
    }

    /// χ² of a pair under a pose.
    fn d2(&self, v: usize, motion: &Motion) -> f64 {
        let pair = &self.terms.pairs[v];
        pair.distance(&(pair.cloud - motion.apply(&pair.model)))
    }

    /// The number of places of some pairs, the smaller of those in the model and in the cloud.
    ///
    /// Ends up to the distance `wide` (m) apart are one place.
    fn places(&self, members: &[usize], wide: fn(&Term) -> f64) -> usize {
        let of = || members.iter().copied();
        let model = apart(self.terms, of(), wide, |pair| [pair.model]);
        let cloud = apart(self.terms, of(), wide, |pair| [pair.cloud]);
        model.len().min(cloud.len())
    }

    /// The expected number of kept pairs that fit a pose if their partners are shuffled; half a coincidence at least.
    fn expected(&self, motion: &Motion) -> f64 {
        let (far, every) = (far(), self.kept.len().div_ceil(COUNTED).max(1));
        let at = |v: usize| &self.terms.pairs[v].cloud;
        let fitting = |&v: &usize| {
            let place = motion.apply(&self.terms.pairs[v].model);
            let from = self.kept.partition_point(|&w| at(w).x < place.x - self.reach);
            let beside = self.kept[from..].iter().take_while(|&&w| at(w).x <= place.x + self.reach);
            beside.filter(|&&w| self.terms.pairs[w].distance(&(at(w) - place)) <= far).count()
        };
        let (mut fits, mut counted) = (0, 0);
        for v in self.kept.iter().step_by(every) {
            fits += fitting(v);
            counted += 1;
        }
        (fits as f64).max(0.5) / f64::from(counted.max(1))
    }

    /// The greatest support among sampled poses of the pairs that a pose does not explain, and −ln of the fraction of
    /// these pairs that were seeds.
    fn wrong(&self, best: &Mode, places: &Places) -> (f64, f64) {
        let (terms, graph) = (self.terms, self.graph);
        let adjacency = symmetric(graph);
        let others: Vec<usize> =
            (0..terms.pairs.len()).filter(|&v| !(self.d2(v, &best.motion) <= WITHHELD * WITHHELD)).collect();
        let mut free = vec![0; terms.pairs.len().div_ceil(64)];
        others.iter().for_each(|&v| free[v / 64] |= 1 << (v % 64));
        let step = stride(others.len());
        let near = |motion: &Motion| {
            let mut members = places.near(terms, graph, motion, NEEDED)?;
            members.retain(|&v| super::bits::is_set(&free, v));
            (members.len() > NEEDED).then_some(members)
        };
        let seeded = |k: usize| {
            let seed = others[k * step % others.len()];
            let row: Vec<u64> = adjacency.row(seed).iter().zip(&free).map(|(row, free)| row & free).collect();
            let ranked: Vec<(usize, usize)> = ones(&row, 0).map(|v| (shared(&row, adjacency.row(v), 0), v)).collect();
            let start = fitted(terms, &beginning(&adjacency, seed, ranked)?)?;
            let (motion, _) = fit(terms, self.prior_terms, &near(&start)?, &start, 2)?;
            let members = near(&motion)?;
            Some((self.places(&members, one_place), members, motion))
        };
        let mut sampled: Vec<_> = (0..WRONG_POSES.min(others.len())).filter_map(seeded).collect();
        sampled.sort_by_key(|(places, ..)| std::cmp::Reverse(*places));
        let all = sampled.iter().take(COMPARED).map(|(_, members, motion)| self.of_pose(members, motion));
        (all.fold(0.0, f64::max), libm::log(others.len() as f64 / WRONG_POSES as f64).max(0.0))
    }
}

/// The distance (m) up to which two points may be one place.
fn one_place(pair: &Term) -> f64 {
    ONE_PLACE * pair.variance.sqrt()
}

/// The distance (m) up to which errors are correlated: of the mean noise, not of its longest axis, since descriptors
/// have the same extent in depth.
fn correlated(pair: &Term) -> f64 {
    let mean = pair.weight.determinant().powf(-1.0 / 3.0);
    CORRELATED * mean.min(pair.variance).sqrt()
}

/// −ln of Chernoff's bound of the probability of `count` events or more of `expected`.
fn chernoff(count: f64, expected: f64) -> f64 {
    if count > expected { count * libm::log(count / expected) - (count - expected) } else { 0.0 }
}

/// Gate of a pair (χ²₃).
fn far() -> f64 {
    chi_square(3, CONFIDENCE)
}

/// Some of these pairs of which no two are together at all `ends`, in their order.
///
/// Ends are together up to the distance `wide` (m).
fn apart<const N: usize>(
    terms: &PairTerms,
    of: impl Iterator<Item = usize>,
    wide: impl Fn(&Term) -> f64,
    ends: impl Fn(&Term) -> [Vector3<f64>; N],
) -> Vec<usize> {
    let (mut kept, mut places): (Vec<usize>, Vec<[Vector3<f64>; N]>) = (Vec::new(), Vec::new());
    for v in of {
        let (own, reach2) = (ends(&terms.pairs[v]), wide(&terms.pairs[v]).powi(2));
        let together = |known: &[Vector3<f64>; N]| own.iter().zip(known).all(|(a, b)| (a - b).norm_squared() <= reach2);
        if !places.iter().any(together) {
            places.push(own);
            kept.push(v);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};

    use crate::{
        accept::{Acceptance, Attempt, Outcome, compute_fix},
        candidates::Candidates,
        problem::{Problem, Tolerance},
        search::rigid_consensus::RigidConsensus,
        site::model::ModelPoint,
        solve::mahalanobis::Mahalanobis,
    };
    use nalgebra::Vector3;

    const SIGMA: f64 = 0.01;
    const PAIRS: usize = 500;

    fn truth() -> Transform<Object, Camera> {
        Transform::exp(&[0.3, -0.2, 0.5, 0.1, 0.2, -3.0].into())
    }

    /// The answer to pairs of a model of 2 m; the first are true with `noise` standard deviations of error, and the
    /// tolerance is in standard deviations too.
    ///
    /// `place` gives the model point of a true pair, and its place in the object frame where it is measured.
    fn answer(
        true_pairs: usize,
        (noise, tolerance): (f64, f64),
        place: impl Fn(usize, Vector3<f64>) -> [Vector3<f64>; 2],
    ) -> Attempt {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut uniform = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let (mut model, mut cloud) = (Vec::new(), Vec::new());
        for i in 0..PAIRS {
            // The sum of three has the variance of one and is nearly normal.
            let (at, elsewhere, error) = (uniform(), uniform(), uniform() + uniform() + uniform());
            let [own, seen] = if i < true_pairs { place(i, at) } else { [at, elsewhere] };
            let seen = if i < true_pairs { seen + error * (noise * SIGMA) } else { seen };
            model.push(own);
            let position = UncertainPoint::isotropic(truth().inverse() * Point::from(seen), SIGMA);
            cloud.push(MeasuredPoint { position, pixels: None });
        }
        let model: Vec<ModelPoint> = model.iter().map(|at| ModelPoint::exact("", (*at).into())).collect();
        let candidates = Candidates::from_pairs(PAIRS, (0..PAIRS).map(|i| (i, i)));
        let tolerance = Tolerance::Fixed(tolerance * SIGMA);
        let problem = Problem {
            model: &model,
            cloud: &cloud,
            candidates: &candidates,
            tolerance,
            prior: None,
            edges: Default::default(),
        };
        let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        compute_fix(&problem, &search, &solver, &Acceptance::default(), None, &mut rng)
    }

    #[test]
    fn five_percent_of_true_pairs_suffice_and_none_do_not() {
        let attempt = answer(25, (1.0, 4.0), |_, at| [at; 2]);
        let Outcome::Fix(fix) = &attempt.outcome else { panic!("{}", attempt.outcome) };
        assert!(truth().error_to(&fix.object_from_camera).norm() < 0.02 && attempt.p_wrong < Some(1e-9));
        assert!(attempt.nfa < Some(1e-9), "{:?}", attempt.nfa);
        let absent = answer(0, (1.0, 4.0), |_, at| [at; 2]);
        assert!(matches!(absent.outcome, Outcome::Rejected(_)), "{}", absent.outcome);
        assert!(absent.p_absent > Some(0.1), "{:?}", absent.p_absent);
    }

    /// Forty pairs in four groups, each two standard deviations wide, have four places.
    ///
    /// Fails if every pair counts.
    #[test]
    fn pairs_side_by_side_count_once() {
        let centres = [[0.5, 0.1, 0.0], [-0.4, 0.3, 0.2], [0.1, -0.6, 0.4], [-0.2, -0.2, -0.5]].map(Vector3::from);
        let grouped = |i: usize, at: Vector3<f64>| [centres[i % 4] + at * (2.0 * SIGMA); 2];
        let attempt = answer(40, (0.2, 4.0), grouped);
        assert!(matches!(attempt.outcome, Outcome::Rejected(_)), "{}", attempt.outcome);
        assert!(attempt.identified.len() > 20, "{} pairs", attempt.identified.len());
        assert!(attempt.p_absent > Some(0.1), "{:?}", attempt.p_absent);
    }

    /// Pairs in groups of three, six standard deviations wide, are a third of the independent pairs.
    ///
    /// Fails if the covariance counts every pair.
    #[test]
    fn pairs_side_by_side_have_a_common_error() {
        let centre =
            |i: usize| Vector3::new((i % 5) as f64, (i / 5 % 5) as f64, (i / 25) as f64) * 0.4 - Vector3::repeat(0.8);
        let variance = |groups: usize| {
            let attempt = answer(120, (1.0, 4.0), |i, at| [centre(i % groups) + at * (3.0 * SIGMA); 2]);
            let Outcome::Fix(fix) = attempt.outcome else { panic!("{}", attempt.outcome) };
            fix.covariance.matrix.trace()
        };
        let ratio = variance(40) / variance(120);
        assert!((2.0..5.0).contains(&ratio), "{ratio}");
    }

    /// Descriptors of an object with a plane of symmetry match most points to their mirror images.
    ///
    /// Fails if the larger mirror image refutes the pose.
    #[test]
    fn an_object_with_a_plane_of_symmetry_is_found() {
        let mirrored = |at: Vector3<f64>| Vector3::new(-at.x, at.y, at.z);
        let attempt = answer(180, (1.0, 4.0), |i, at| [at, if i % 3 == 0 { at } else { mirrored(at) }]);
        let Outcome::Fix(fix) = attempt.outcome else { panic!("{}", attempt.outcome) };
        assert!(truth().error_to(&fix.object_from_camera).norm() < 0.02, "{:?}", fix.object_from_camera);
    }

    /// A mirrored cloud whose pose is the half of the points that lie in a plane.
    #[test]
    fn the_plane_of_a_mirrored_cloud_is_no_pose() {
        let flat = |i: usize, at: Vector3<f64>| Vector3::new(at.x * (i % 2) as f64, at.y, at.z);
        let mirrored = |at: Vector3<f64>| Vector3::new(-at.x, at.y, at.z);
        let attempt = answer(200, (1.0, 4.0), |i, at| [flat(i, at), mirrored(flat(i, at))]);
        assert_eq!(attempt.outcome.reason(), Some("mirrored"), "{}", attempt.outcome);
    }

    /// Half of the true pairs show the object at one place, half at another.
    ///
    /// Fails if the best pose is not compared with wrong poses.
    #[test]
    fn one_of_two_copies_is_not_answered() {
        let beside = |i: usize, at: Vector3<f64>| [at, at + Vector3::new(1.0, 0.5, 0.0) * (i % 2) as f64];
        let attempt = answer(50, (1.0, 4.0), beside);
        assert!(!matches!(attempt.outcome, Outcome::Fix(_)), "{}", attempt.outcome);
        assert!(attempt.p_absent > Some(0.1), "{:?}", attempt.p_absent);
    }

    /// The noise is two fifths larger than stated: the residuals of 150 pairs show it, and the covariance allows for it.
    ///
    /// Fails if the χ² test stands, and if the covariance does not grow.
    #[test]
    fn a_large_set_states_its_own_noise() {
        let sigma = |noise: f64| {
            let attempt = answer(150, (noise, 6.0), |_, at| [at; 2]);
            let Outcome::Fix(fix) = attempt.outcome else { panic!("{}", attempt.outcome) };
            (fix.covariance.matrix.trace().sqrt(), fix.integrity.chi2 / fix.integrity.dof as f64)
        };
        let ((stated, _), (larger, ratio)) = (sigma(0.9), sigma(1.4));
        assert!(ratio > 1.3 && larger > 1.2 * stated, "{stated} {larger} {ratio}");
    }
}
