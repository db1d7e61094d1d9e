//! Rigid consensus: the likeliest pose, with what else is likely.

use rand::Rng;
use seafix_component::{Component, in_range};
use serde::{Deserialize, Serialize};

use super::{
    Belief, Explanation, Identification, NEEDED, Search, Unidentified,
    consensus::{Graph, Rough, Seeds, Terms, mirror_image},
    grow::{feasible, grow, most_possible},
    orientation::Sense,
};
use crate::Problem;

/// The likeliest pose, every other pose that may explain the data, and how likely it is that there is none.
///
/// Maximises the evidence of a pose against clutter alone,
///
/// Λ = ∫ p(T) B(k) Π_i N(c_j(i) − T p_i; 0, Σ_j + σ_i² I)/ρ_i dT,
///
/// over the sets of pairs and, by Laplace's method, about the best pose T of each: p(T) is the prior (a
/// Gaussian; a box is read as three standard deviations; without a prior any attitude anywhere in the cloud's
/// box), ρ_i the density of cloud points where model point i is predicted, and B(k) = k! (n − k)!/(n + 1)!
/// the share of one set of k visible points when every number from 0 to n is equally likely. So a pose with
/// fewer but closer points, or nearer to the prior, can outweigh one with more.
///
/// Branch and bound over coherent threes, most promising first: three pairs give a pose, what fits it joins,
/// the pose is fitted again until the set stands. Complete up to a margin: no pose that begins with three
/// coherent pairs and whose evidence is within e¹⁰ of the best, and not below that of absence by e³, is
/// left out, given that its points lie about as well as the model's do on average. Time O(K²) for the graph
/// of K candidate pairs, then what the bounds leave: seldom more than for the graph, and never more than the
/// budget. The tolerance and the prior's greatest rotation prune the graph; they do not judge the
/// pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RigidConsensus {
    /// Work before the search ends, in words of the graph read (64 pairs each).
    pub budget: u64,
    /// More candidate pairs than this are not searched: their graph would not fit into memory
    /// (40 000 take 200 MB).
    pub most_pairs: usize,
}

impl Default for RigidConsensus {
    fn default() -> Self {
        Self { budget: 400_000_000, most_pairs: 40_000 }
    }
}

impl Component for RigidConsensus {
    const NAME: &'static str = "rigid-consensus";
    const SUMMARY: &'static str = "the likeliest pose, weighed against all others and against no object at all";
    const SOURCE: &'static str = "own; ideas: Grimson and Lozano-Pérez, 1987; Moisan and Stival, 2004; MacKay, \
                                  Information Theory, Inference, and Learning Algorithms, 2003, ch. 27";

    fn check(&self) -> Result<(), String> {
        in_range(self.budget > 0, "budget", self.budget, "1 or more")?;
        in_range(self.most_pairs >= NEEDED, "most-pairs", self.most_pairs, "3 or more candidate pairs")
    }
}

impl Search for RigidConsensus {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Unidentified> {
        feasible(problem, self.most_pairs, self.budget)?;
        let bound = most_possible(problem);
        let nothing = Unidentified::NotFound { bound, needed: NEEDED };
        let Some(rough) = Rough::of(problem) else { return Err(nothing) };
        let graph = Graph::of(problem, &rough);
        let terms = Terms::of(problem, &rough, &graph);
        let swept = Seeds::new(&terms, &rough, &graph, self.budget).sweep();
        let mut tests = graph.tests + swept.tests;
        let ended = |best: usize, tests| Unidentified::Budget { budget: self.budget, best, bound, tests };
        let Some(best) = swept.modes.first() else {
            return Err(if swept.complete { nothing } else { ended(0, tests) });
        };
        if let Some(image) = mirror_image(&terms, &rough, &graph, best) {
            return Err(Unidentified::Mirrored { best: image.members.len() });
        }
        // What is returned is coherent throughout: of twenty true points some two are usually further from each
        // other than the tolerance, and the worst fitting give way. The belief keeps them.
        let mut pairs = grow(problem, &best.closest_first(&terms, &graph), Sense::Proper, &mut tests);
        if pairs.len() < NEEDED {
            return Err(nothing);
        }
        pairs.sort_unstable();
        let explanations = swept.modes.iter().map(|mode| Explanation {
            pairs: mode.pairs(&graph),
            object_from_camera: mode.motion.transform().inverse(),
            ln_evidence: mode.ln_evidence,
        });
        Ok(Identification {
            rivals: Vec::new(),
            rivals_complete: false,
            optimal: swept.complete,
            size_bound: bound,
            tests,
            undecided: (!swept.complete).then(|| ended(pairs.len(), tests)),
            belief: Some(Belief { explanations: explanations.collect() }),
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
    fn answered(prior: Option<&Prior>, wrong: impl Fn(usize) -> Vector3<f64>) -> Result<Identification, Unidentified> {
        let model: Vec<ModelPoint> = PLACES.iter().map(|at| ModelPoint::exact("", Point::from(*at))).collect();
        let cloud: Vec<MeasuredPoint> = (0..PLACES.len())
            .map(|i| Vector3::from(PLACES[i]) + Vector3::new(0.0, 0.0, 3.0) + wrong(i))
            .map(|at| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), 0.01), pixels: None })
            .collect();
        let candidates = Candidates::from_pairs(PLACES.len(), (0..PLACES.len()).map(|i| (i, i)));
        let tolerance = Tolerance::Fixed(0.04);
        let problem = Problem { model: &model, cloud: &cloud, candidates: &candidates, tolerance, prior };
        RigidConsensus::default().search(&problem, &mut ChaCha8Rng::seed_from_u64(0))
    }

    #[test]
    fn a_point_that_agrees_in_distances_but_not_in_place_is_left_out() {
        // The last point moved by 2.8 cm along its own depth: less than Δ, more than five σ of a fit.
        let found = answered(None, |i| if i == 5 { Vector3::new(0.03, 0.03, 0.07) } else { Vector3::zeros() }).unwrap();
        let models: Vec<usize> = found.pairs.iter().map(|pair| pair.model).collect();
        assert_eq!(models, [0, 1, 2, 3, 4]);
        assert!(found.optimal && found.belief.is_some());
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
            found.belief.unwrap().explanations[0].ln_evidence
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
