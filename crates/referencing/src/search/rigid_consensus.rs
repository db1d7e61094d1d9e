//! Rigid consensus: the likeliest pose, with what else is likely.

use std::collections::BTreeSet;

use rand::Rng;
use seafix_component::Component;
use serde::{Deserialize, Serialize};

use super::{
    Explanation, Identification, NEEDED, Posterior, Rejected, Search, bounded,
    consensus::{
        ClutterDensity, ConsistencyGraph, Mode, Occupied, Pattern, PriorTerms, Proved, Seeds, StructuredClutter, Swept,
        Terms, mirror_image, prove,
    },
    grow::{feasible, grow, max_possible, so_far},
    orientation::Sense,
    posterior::COPY,
};
use crate::Problem;

/// The likeliest pose, every other pose that may explain the data, and how likely it is that there is none.
///
/// Maximises the evidence of a pose against clutter alone,
///
/// Λ = ∫ p(T) B(k) Π_i N(c_j(i) − T p_i; 0, Σ_j + σ_i² I)/ρ_i dT,
///
/// over the sets of pairs and, by Laplace's method, about the best pose T of each: p(T) is the prior (a
/// Gaussian; a box is read as three standard deviations; without a prior any attitude anywhere in the boxes
/// of the cloud's parts, between which no object reaches), ρ_i the density of cloud points where model point i is predicted, without
/// a prior that of the part, and B(k) = k! (n − k)!/(n + 1)!
/// the share of one set of k visible points when every number from 0 to n is equally likely. So a pose with
/// fewer but closer points, or nearer to the prior, can outweigh one with more.
///
/// Poses that put a model point outside the box of a prior are none. Where the likeliest poses lie in crowds (on the edges of
/// a box, in clumps), ρ_i is the density of the nearest points instead, or that about the predicted places of all model points where
/// clutter is bunched there, and B(k) Π is summed over the subsets of the
/// pairs, each model point's term over all candidates near its place: what fits in a crowd is as likely clutter. And
/// beside the object and clutter alone stand more explanations: a pattern that the object repeats in part goes on, with
/// the object in it or without; and where poses elsewhere explain what clutter spread evenly would not show, clutter
/// imitates the object, which is among the imitations or not ([`StructuredClutter`]). So do putative pairs that mistake points for their
/// like, where the model stands as well in other ways on the same places: each of them is met by many.
///
/// Branch and bound over coherent threes, most promising first: three pairs give a pose, what fits it joins,
/// the pose is fitted again until the set stands. Looked for are the poses that begin with three coherent
/// pairs and whose evidence is within e¹⁰ of the best and not below that of absence by e³. A three whose distances
/// differ much from the model's fits no pose well, and its bound falls by that. The bounds that
/// prune take the points of a set to lie about as well as the model's do on average, and to fit no better than noise
/// lets them, by up to four nats: what fits better may be missed where it is hardly of interest.
///
/// With `prove`, and where five nats of evidence make the likeliest believable, bounds that hold decide instead which coherent sets are
/// looked at, of clutter that is spread evenly and by geometry of the first order: what is found joins the poses, and where nothing is
/// left open the answer is optimal, but where some pairs of its pose had to go since they are not coherent.
///
/// Time O(K²) for the graph of K candidate pairs, then what the bounds leave: seldom more than for the graph, for the proof at worst
/// exponential in K, and never more than the budget, which is told when it ends the search; the proof has as much again. What is
/// looked for beside the likeliest pose comes on top: a whole second copy as thoroughly, parts of one for
/// up to two and a half times that work, imitations for an eighth. So among much clutter a partly seen object beside a whole
/// copy of it may be passed over, where [`Posterior::copies_sought`] is false; and what shows less evidence than nine nats is no
/// copy. The tolerance and the prior's greatest rotation prune the graph; they do not judge the pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RigidConsensus {
    /// Work before the search ends, in words of the graph read (64 pairs each).
    pub budget: u64,
    /// More candidate pairs than this are not searched: their graph would not fit into memory
    /// (40 000 take 200 MB).
    pub max_pairs: usize,
    /// Whether it is proved that no set is likelier, as far as the budget again does: then the answer is called optimal.
    pub prove: bool,
}

impl Default for RigidConsensus {
    fn default() -> Self {
        Self { budget: 400_000_000, max_pairs: 40_000, prove: false }
    }
}

impl Component for RigidConsensus {
    const NAME: &'static str = "rigid-consensus";
    const SUMMARY: &'static str = "the likeliest pose, weighed against all others and against no object at all";
    const SOURCE: &'static str = "own; ideas: Grimson and Lozano-Pérez, 1987; Moisan and Stival, 2004; MacKay, \
                                  Information Theory, Inference, and Learning Algorithms, 2003, ch. 27";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the evidence of a pose against clutter alone: prior, residuals, how many points are seen, and how dense clutter is about each",
        ),
        (
            "exact",
            "to within what its bounds let pass; with `prove` proved, within its budget, that no coherent set is likelier where clutter is spread evenly",
        ),
        (
            "time",
            "K²/2 pair tests for K candidate pairs, then mostly as much again; never more than its budget, and two and a half times that for what stands beside the likeliest",
        ),
    ];

    fn check(&self) -> Result<(), String> {
        bounded(self.budget, self.max_pairs)
    }
}

/// Poses less likely than no object at all by this much (nats) are not looked for.
const FLOOR: f64 = 3.0;
/// A pose that is more likely than no object by this much (nats) may be believed: only then what else the cloud shows is
/// looked for.
const STRONG: f64 = 5.0;
/// What is found beside the likeliest pose matters where it is not less likely by this much (nats), and where it is a copy by itself
/// ([`COPY`]).
const BESIDE: f64 = 14.0;
/// What explains so many points fewer than the likeliest pose is no copy of the object but of a part of it. Where the object has a
/// pattern that goes on, parts are to be seen beside it anyway, and are not looked for.
const LEAD: usize = 4;
/// The looks for parts of a copy, and the tenth of it those for imitations, may always cost as much (words read: a fraction of a
/// millisecond), where the whole was found at once.
const MIN_EFFORT: u64 = 50_000;
/// Sums in another order differ by less (nats).
const ROUNDING: f64 = 1e-9;
/// Pair tests of the graph that take as long as a word read.
const PAIRS_A_WORD: u64 = 16;

impl Search for RigidConsensus {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let bound = max_possible(problem);
        let nothing = Rejected::NotFound { bound, needed: NEEDED };
        let Some(prior_terms) = PriorTerms::of(problem) else { return Err(nothing) };
        let graph = ConsistencyGraph::of(problem, &prior_terms);
        let terms = Terms::of(problem, &prior_terms, &graph);
        let parts = (&terms, &prior_terms, &graph);
        let none = BTreeSet::new();
        let mut swept = Seeds::new(problem.model, parts, &none, (NEEDED, -FLOOR), self.budget).sweep();
        let mut pair_tests = graph.pair_tests + swept.pair_tests;
        let strong = |swept: &Swept| swept.modes.first().is_some_and(|best| best.ln_evidence >= STRONG);
        // What nothing makes believe needs no proof.
        let proved =
            if self.prove && strong(&swept) { prove(problem.model, parts, &mut swept, self.budget) } else { None };
        pair_tests += proved.as_ref().map_or(0, |proved| proved.pair_tests);
        // Up to a hundred megabytes that nobody needs from here on.
        swept.pairs = Vec::new();
        let mut clutter_density = ClutterDensity::default();
        let mut weighted = |swept: &mut Swept| {
            for mode in &mut swept.modes {
                clutter_density.weigh(problem, parts, mode);
            }
            let by =
                |a: &Mode, b: &Mode| b.ln_evidence.total_cmp(&a.ln_evidence).then_with(|| a.members.cmp(&b.members));
            swept.modes.sort_by(by);
        };
        // What is not likely even in evenly spread clutter is refused whatever the clutter is like.
        if strong(&swept) {
            weighted(&mut swept);
        }
        let ended = |best: usize, pair_tests| Rejected::Budget { budget: self.budget, best, bound, pair_tests };
        let Some(best) = swept.modes.first() else {
            return if swept.complete { Err(nothing) } else { so_far(problem, true, ended(0, pair_tests)) };
        };
        if let Some(image) = mirror_image(problem.model, parts, best) {
            return Err(Rejected::Mirrored { best: image.members.len(), proved: false });
        }
        // A second copy of the object in what is left of the cloud, and a pose to hold the likeliest against.
        let mut repeated_pattern = None;
        let mut beside = Swept { complete: true, parts: true, ..Swept::default() };
        let mut copies_sought = None;
        let mut structured_clutter = None;
        let mut unlikely = None;
        if best.ln_evidence >= STRONG {
            let pattern = Pattern::of(problem.model);
            let elsewhere = |mode: &Mode| mode.members.iter().filter(|&&v| best.holds(v)).count() < NEEDED;
            let taken = best.members.iter().map(|&v| graph.vertices[v].cloud).collect();
            let min = (best.members.len() + 1).saturating_sub(LEAD).max(NEEDED);
            let left = self.budget.saturating_sub(swept.pair_tests);
            let work = swept.pair_tests + graph.pair_tests / PAIRS_A_WORD;
            let full = work.max(MIN_EFFORT);
            beside = if pattern.is_some() {
                Seeds::new(problem.model, parts, &taken, (min, STRONG), left).sweep()
            } else {
                // Parts of it: pairs are looked at for twice, and followed for half of the time that the whole took.
                let floor = (best.ln_evidence - BESIDE).clamp(0.0, COPY);
                let seeds = Seeds::new(problem.model, parts, &taken, (NEEDED, floor), left);
                seeds.with_parts(min, left.min(2 * full), left.min(full / 2)).sweep()
            };
            // Where the object has a pattern that goes on, parts of it are to be seen anyway.
            copies_sought = Some(beside.complete && beside.parts && pattern.is_none());
            // What poses elsewhere say of the clutter, those that are as likely as no object, in an eighth of that time.
            let effort = left.min((work / 8).max(MIN_EFFORT / 10));
            let mut others = Seeds::new(problem.model, parts, &none, (NEEDED, 0.0), effort).contradicting(best).sweep();
            pair_tests += others.pair_tests;
            weighted(&mut others);
            let occupied = Occupied::of(problem, best, pattern.as_ref().and_then(Pattern::distinctive));
            let mistaken = occupied.mistaken(problem, (&terms, &graph), &others.modes);
            others.modes.retain(elsewhere);
            let clutter_patterns = others.modes.iter().map(|other| occupied.structured_clutter(problem, parts, other));
            let weight = |of: &StructuredClutter| of.ln_evidence + of.ln_alone;
            structured_clutter = clutter_patterns.chain(mistaken).max_by(|a, b| weight(a).total_cmp(&weight(b)));
            weighted(&mut beside);
            pair_tests += beside.pair_tests;
            repeated_pattern = pattern.map(|pattern| pattern.repeated_pattern(problem, &terms, &graph, best));
            unlikely = others.modes.into_iter().next();
            if unlikely.is_none() && swept.modes.iter().chain(&beside.modes).all(|mode| !elsewhere(mode)) {
                unlikely = Seeds::new(problem.model, parts, &none, (NEEDED, f64::NEG_INFINITY), 0).elsewhere(best);
            }
        }
        let complete = swept.complete && beside.complete;
        let gap = |proved: Proved| Some(proved.bound - best.ln_even).filter(|gap| *gap > ROUNDING).unwrap_or(0.0);
        let evidence_gap = proved.map(gap);
        // What is returned is coherent throughout: of twenty true points some two are usually further from each
        // other than the tolerance, and the worst fitting give way. The belief keeps them.
        let mut pairs = grow(problem, &best.closest_first(&terms, &graph), Sense::Proper, &mut pair_tests);
        if pairs.len() < NEEDED {
            return if complete { Err(nothing) } else { so_far(problem, true, ended(pairs.len(), pair_tests)) };
        }
        pairs.sort_unstable();
        let explanation = |mode: &Mode| Explanation {
            pairs: mode.pairs(&graph),
            object_from_camera: mode.motion.transform().inverse(),
            ln_evidence: mode.ln_evidence,
            ln_clutter_density: mode.ln_clutter_density,
        };
        let explain = |swept: &Swept| swept.modes.iter().map(explanation).collect::<Vec<_>>();
        Ok(Identification {
            alternatives: Vec::new(),
            alternatives_complete: false,
            // What is proved of a pose is not proved of what is left of its pairs where some contradict each other.
            optimal: evidence_gap == Some(0.0) && pairs.len() == best.members.len(),
            consensus_bound: bound,
            pair_tests,
            undecided: (!complete).then(|| ended(pairs.len(), pair_tests)),
            posterior: Some(Posterior {
                explanations: explain(&swept),
                beside: explain(&beside),
                copies_sought,
                repeated_pattern,
                structured_clutter,
                unlikely: unlikely.as_ref().map(explanation),
                evidence_gap,
            }),
            pairs,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Candidates, ModelPoint, Prior, PriorBound, Tolerance};
    use nalgebra::{UnitQuaternion, Vector3};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use seafix_geometry::{Covariance6, MeasuredPoint, Point, Transform, UncertainPoint};

    const PLACES: [[f64; 3]; 6] =
        [[0.0, 0.0, 0.0], [1.3, 0.0, 0.0], [0.3, -0.9, 0.0], [0.8, 0.6, 0.5], [-0.4, 0.7, 0.9], [0.1, -0.3, 1.2]];

    /// The points 3 m before the camera, as far off as `wrong` says, each its own candidate.
    fn answered(prior: Option<&Prior>, wrong: impl Fn(usize) -> Vector3<f64>) -> Result<Identification, Rejected> {
        answered_by(&RigidConsensus::default(), prior, wrong)
    }

    fn answered_by(
        search: &RigidConsensus,
        prior: Option<&Prior>,
        wrong: impl Fn(usize) -> Vector3<f64>,
    ) -> Result<Identification, Rejected> {
        let model: Vec<ModelPoint> = PLACES.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect();
        let cloud: Vec<MeasuredPoint> = (0..PLACES.len())
            .map(|i| Vector3::from(PLACES[i]) + Vector3::new(0.0, 0.0, 3.0) + wrong(i))
            .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), 0.01), pixels: None })
            .collect();
        let candidates = Candidates::from_pairs(PLACES.len(), (0..PLACES.len()).map(|i| (i, i)));
        let tolerance = Tolerance::Fixed(0.04);
        let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior };
        search.search(&problem, &mut ChaCha8Rng::seed_from_u64(0))
    }

    /// Seen to fail where nothing is asked of the proof, and where the gap is that to no object.
    #[test]
    fn an_answer_is_optimal_where_that_is_asked_and_proved() {
        let proving = RigidConsensus { prove: true, ..RigidConsensus::default() };
        let noise = |i: usize| Vector3::new(0.005, -0.005, 0.0025) * (i as f64 - 2.5);
        let [plain, proved] = [&RigidConsensus::default(), &proving].map(|by| answered_by(by, None, noise).unwrap());
        let gap = |found: &Identification| found.posterior.as_ref().expect("one is weighed").evidence_gap;
        assert_eq!((plain.optimal, gap(&plain)), (false, None));
        assert_eq!((proved.optimal, gap(&proved)), (true, Some(0.0)));
        assert_eq!(plain.pairs, proved.pairs);
        assert!(proved.pair_tests > plain.pair_tests);
    }

    /// The first two points are pushed apart by 44 mm, more than Δ, each to 2.2 σ of where the pose of all puts it: one of them goes.
    ///
    /// Seen to fail where what is proved of the pose is said of the pairs that are left.
    #[test]
    fn what_is_left_of_pairs_that_contradict_each_other_is_not_optimal() {
        let proving = RigidConsensus { prove: true, ..RigidConsensus::default() };
        let apart = |i: usize| Vector3::new([-0.022, 0.022, 0.0, 0.0, 0.0, 0.0][i], 0.0, 0.0);
        let found = answered_by(&proving, None, apart).unwrap();
        let posterior = found.posterior.as_ref().expect("one is weighed");
        assert_eq!((found.pairs.len(), posterior.explanations[0].pairs.len()), (5, 6));
        assert_eq!((found.optimal, posterior.evidence_gap), (false, Some(0.0)));
    }

    #[test]
    fn a_point_that_agrees_in_distances_but_not_in_place_is_left_out() {
        // The last point is off by 3 cm across and 7 cm in depth: its distances to the others differ by less than
        // Δ = 4 cm, but it lies eight σ from where their pose puts it.
        let found = answered(None, |i| if i == 5 { Vector3::new(0.03, 0.03, 0.07) } else { Vector3::zeros() }).unwrap();
        let models: Vec<usize> = found.pairs.iter().map(|pair| pair.model).collect();
        assert_eq!(models, [0, 1, 2, 3, 4]);
        assert!(found.undecided.is_none());
        assert_eq!(found.posterior.expect("one is weighed").copies_sought, Some(true));
    }

    #[test]
    fn a_mirror_image_is_no_explanation() {
        let reflected = |i: usize| Vector3::new(0.0, 0.0, -2.0 * PLACES[i][2]);
        let size = answered(None, reflected).map_or(0, |found| found.pairs.len());
        assert!(size <= 3, "{size} points of a mirror image");
    }

    #[test]
    fn the_prior_weighs_on_the_pose() {
        let evidence = |off: f64| {
            let at = Vector3::new(off, 0.0, -3.0);
            let bound = PriorBound::Gaussian(Covariance6::isotropic(0.02, 0.05));
            let prior = Prior { object_from_camera: Transform::new(UnitQuaternion::identity(), at), bound };
            let found = answered(Some(&prior), |_| Vector3::zeros()).unwrap();
            found.posterior.unwrap().explanations[0].ln_evidence
        };
        // Two standard deviations cost two nats; the pose itself is known to 0.015 m at the camera, 3 m from the
        // points: ½ · 0.1²/(0.05² + 0.015²) = 1.83.
        let cost = evidence(0.0) - evidence(0.1);
        assert!((1.73..1.93).contains(&cost), "{cost}");
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        assert_eq!(RigidConsensus::default().check(), Ok(()));
        assert!(RigidConsensus { budget: 0, ..RigidConsensus::default() }.check().is_err());
    }
}
