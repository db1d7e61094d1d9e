//! The posterior of a search by likelihood.

use seafix_geometry::{Camera, Object, Transform};

use super::consensus::{
    influential_pairs::{InfluentialPairs, misled},
    structured_clutter::StructuredClutter,
    support::Support,
};
use crate::{
    a_contrario::absence::by_nfa, accept::apart::rms_apart, alternative::Alternative, problem::Correspondence,
    site::model::ModelPoint,
};

/// Evidence (nats) below the best at which an explanation is not listed; e⁻⁷·⁶ = 0.05 %.
const NEGLIGIBLE: f64 = 7.6;

/// A pose that explains the data, with its evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct Explanation {
    /// The pairs, in the order of the model points.
    pub pairs: Vec<Correspondence>,
    /// The edges, in the order of the model edges.
    pub edges: Vec<Correspondence>,
    /// The MAP pose of these pairs.
    pub object_from_camera: Transform<Object, Camera>,
    /// Log evidence ratio (nats): ln of p(data | a pose near this one) / p(data | no object).
    pub ln_evidence: f64,
    /// Evidence (nats) that the pose loses to dense clutter about its pairs, relative to uniform clutter.
    pub ln_clutter_density: f64,
}

impl Explanation {
    /// The explanation as an alternative; its score is the evidence.
    pub(crate) fn alternative(&self) -> Alternative {
        Alternative {
            object_from_camera: self.object_from_camera,
            pairs: self.pairs.clone(),
            edges: self.edges.clone(),
            score: self.ln_evidence,
        }
    }
}

/// The poses that may explain the data, the best first.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Posterior {
    /// The poses, without those whose evidence is orders of magnitude below the best.
    pub explanations: Vec<Explanation>,
    /// Poses that explain points which the best pose does not use, the best first.
    pub beside: Vec<Explanation>,
    /// Whether the search for second copies of the object was exhaustive, up to the bounds of evidence.
    ///
    /// A copy may be complete or partial. `None` if none was searched for: no pose has enough evidence to be accepted, or
    /// the set is large and putative, where a copy is one of the wrong poses of its [`Support`].
    pub copies_sought: Option<bool>,
    /// ln evidence (nats) of a pattern like the object's in its place, without the object; `None` for an object without
    /// a pattern.
    pub pattern_alone: Option<f64>,
    /// ln evidence (nats) of the object's own pattern with the object at another of its shifts; `None` for an object
    /// without a pattern.
    pub pattern_shifted: Option<f64>,
    /// The strongest evidence of structured clutter, which resembles the object; `None` without any.
    pub structured_clutter: Option<StructuredClutter>,
    /// A pose elsewhere beyond those of `explanations` and `beside`, for comparison with the answer.
    ///
    /// It is the best one with at least the evidence of absence. If no list has a pose elsewhere, it is a pose of
    /// three or more agreeing pairs that contradict the best pose, whatever its evidence.
    pub unlikely: Option<Explanation>,
    /// Upper bound of the evidence (nats) by which another set exceeds the best pose.
    ///
    /// It holds for admissible sets under uniform clutter. Zero: the best pose is proved optimal. `None`: no proof was
    /// requested.
    pub evidence_gap: Option<f64>,
    /// ln of the number of false alarms of the best pose by points and edges together; `None` without edges or prior.
    pub ln_nfa: Option<f64>,
    /// ln evidence (nats) of another structure of the object's kind in its place; `None` without edges, without a prior,
    /// and if no pose has enough evidence to be accepted.
    ///
    /// Such a structure has edges in the same directions, which meet as the object's do, but dimensions of its own.
    pub resembling: Option<f64>,
    /// The support of independent pairs, in place of all evidence of clutter; `None` but for a large putative set.
    pub support: Option<Support>,
    /// The pairs of the best pose that may be wrong matches: each single pair, and each two of a pose of 5 to 20 points.
    ///
    /// Empty for three points, for edges, and for an evidence below 3.8 nats. A large putative set has no limit of
    /// evidence, but one of forty pairs.
    pub influential_pairs: Vec<InfluentialPairs>,
}

/// Evidence (nats) that makes a pose beside the best a second copy of the object in any case, complete or partial.
///
/// Two possible objects forbid a choice even if the second is not certain.
pub(crate) const COPY: f64 = 9.0;

/// Evidence (nats) that clutter alone reaches in at most one frame of twenty.
///
/// Markov's inequality with E Σ Λ = 1 under uniform clutter.
const ACCIDENT: f64 = 3.0;

/// ln of the prior probability that clutter resembles the object: so small that it matters only with evidence for it.
pub(super) const LN_RESEMBLES: f64 = -11.5;

/// The posterior probabilities of the hypotheses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosteriorProbabilities {
    /// Probability that the true pose is within the alert limit of the best explanation.
    pub map_estimate: f64,
    /// Probability that the object is elsewhere.
    pub elsewhere: f64,
    /// Probability that the object is absent.
    pub absent: f64,
    /// Part of `absent` due to a repeated pattern or another structure that looks like the object.
    pub alike: f64,
    /// Part of `absent` due to clutter that is denser or more structured than uniform clutter.
    pub clutter: f64,
}

impl Posterior {
    /// The explanations of appreciable probability that place the object elsewhere, one for each place.
    pub fn elsewhere(&self, model: &[ModelPoint], limit: f64) -> Vec<&Explanation> {
        let mut different: Vec<&Explanation> = self.explanations.iter().take(1).collect();
        for other in &self.explanations {
            let apart = |known: &&Explanation| {
                !(rms_apart(model, &known.object_from_camera, &other.object_from_camera) <= limit)
            };
            if other.ln_evidence >= self.explanations[0].ln_evidence - NEGLIGIBLE && different.iter().all(apart) {
                different.push(other);
            }
        }
        different.drain(..different.len().min(1));
        different
    }

    /// A second copy of the object elsewhere, complete or partial.
    ///
    /// The copy is a pose that explains other cloud points than the best pose, with evidence (nats) that `suffices` by
    /// itself. Two poses with such evidence are not explained by clutter, and their evidence does not decide which of
    /// them is the object: it reports only how much of each is visible.
    pub(crate) fn copy(
        &self,
        model: &[ModelPoint],
        limit: f64,
        suffices: impl Fn(f64) -> bool,
    ) -> Option<&Explanation> {
        self.apart(&self.beside, model, limit).into_iter().find(|other| suffices(other.ln_evidence))
    }

    /// The best pose elsewhere, whatever its evidence.
    pub fn next(&self, model: &[ModelPoint], limit: f64) -> Option<&Explanation> {
        let known = [&self.explanations[..], &self.beside, self.unlikely.as_slice()];
        let all = known.into_iter().filter_map(|some| self.apart(some, model, limit).first().copied());
        all.max_by(|a, b| a.ln_evidence.total_cmp(&b.ln_evidence))
    }

    /// The poses that are not near the best, in their order.
    fn apart<'a>(&self, of: &'a [Explanation], model: &[ModelPoint], limit: f64) -> Vec<&'a Explanation> {
        let Some(best) = self.explanations.first() else { return Vec::new() };
        let near =
            |other: &&Explanation| rms_apart(model, &best.object_from_camera, &other.object_from_camera) <= limit;
        of.iter().filter(|other| !near(other)).collect()
    }

    /// The posterior probabilities of presence, elsewhere and absence.
    ///
    /// P_m = Λ_m/(1 + Σ Λ), with evidence Λ and equal prior probabilities of presence and absence. Poses within `limit`
    /// (m, RMS over the model points) of the best count as one with it. Further hypotheses:
    ///
    /// - A pattern like the object's is in its place, without the object.
    /// - Another structure of the object's kind is in its place.
    /// - The object's own pattern is in its place, and the object at another shift of it: the object is elsewhere.
    /// - A pose beside the best, in points that the best does not use, shows how much evidence clutter of this cloud
    ///   produces. Without the object, clutter would have produced the best pose with the same probability.
    /// - Structured clutter ([`StructuredClutter`]): if another pose shows that clutter resembles the object, the best
    ///   pose is such clutter too, or the object is present beside such clutter.
    pub fn probabilities(&self, model: &[ModelPoint], limit: f64) -> PosteriorProbabilities {
        let Some(best) = self.explanations.first() else {
            return PosteriorProbabilities { map_estimate: 0.0, elsewhere: 0.0, absent: 1.0, alike: 0.0, clutter: 0.0 };
        };
        if let Some(support) = &self.support {
            return self.by_support(support, model, limit);
        }
        let pattern = self.pattern_alone.unwrap_or(f64::NEG_INFINITY);
        let resembling = self.resembling.unwrap_or(f64::NEG_INFINITY);
        let shifted = self.pattern_shifted.unwrap_or(f64::NEG_INFINITY);
        let beside = self.apart(&self.beside, model, limit).first().map_or(0.0, |other| other.ln_evidence);
        let clutter = if beside > ACCIDENT { beside } else { 0.0 };
        // The object beside structured clutter, and structured clutter alone.
        let among =
            self.structured_clutter.map_or(f64::NEG_INFINITY, |of| best.ln_evidence + of.ln_evidence + LN_RESEMBLES);
        let imitated = self.structured_clutter.map_or(f64::NEG_INFINITY, |of| among + of.ln_alone);
        let max = [clutter, pattern, resembling, shifted, among, imitated].into_iter().fold(best.ln_evidence, f64::max);
        let (mut map_estimate, mut elsewhere) = (0.0, libm::exp(shifted - max));
        for other in &self.explanations {
            // Structured clutter may be beside the object wherever the object is.
            let less = other.ln_evidence - best.ln_evidence;
            let fraction = libm::exp(other.ln_evidence - max) + libm::exp(among + less - max);
            if rms_apart(model, &best.object_from_camera, &other.object_from_camera) <= limit {
                map_estimate += fraction;
            } else {
                elsewhere += fraction;
            }
        }
        let alike = libm::exp(pattern - max) + libm::exp(resembling - max);
        let of_clutter = libm::exp(clutter - max) + libm::exp(imitated - max);
        let absent = of_clutter + alike;
        let all = map_estimate + elsewhere + absent;
        let more = of_clutter - libm::exp(-max);
        PosteriorProbabilities {
            map_estimate: map_estimate / all,
            elsewhere: elsewhere / all,
            absent: absent / all,
            alike: alike / all,
            clutter: more / all,
        }
    }

    /// The probability that a wrong match puts the best pose off by more than `limit` (m), if it is near the true one.
    pub fn misled(&self, limit: f64) -> f64 {
        misled(&self.influential_pairs, limit).0
    }

    /// The probabilities of a large putative set, from the support of independent pairs.
    fn by_support(&self, support: &Support, model: &[ModelPoint], limit: f64) -> PosteriorProbabilities {
        let absent = by_nfa(libm::exp(support.ln_nfa));
        let (mut near, mut elsewhere) = (0.0, libm::exp(support.ln_odds_elsewhere.min(0.0)));
        for (other, ln_odds) in self.explanations.iter().zip(&support.ln_odds) {
            let apart = rms_apart(model, &self.explanations[0].object_from_camera, &other.object_from_camera);
            *if apart <= limit { &mut near } else { &mut elsewhere } += libm::exp(*ln_odds);
        }
        let present = (1.0 - absent) / (near + elsewhere);
        let (map_estimate, elsewhere) = (present * near, present * elsewhere);
        PosteriorProbabilities { map_estimate, elsewhere, absent, alike: 0.0, clutter: absent }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Transform;

    /// The object at another shift of its pattern is as probable as this pose if the evidence is equal, and not absent.
    #[test]
    fn a_shift_within_the_pattern_is_elsewhere() {
        let pose = Transform::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::zeros());
        let (pairs, edges) = (Vec::new(), Vec::new());
        let best = Explanation { pairs, edges, object_from_camera: pose, ln_evidence: 40.0, ln_clutter_density: 0.0 };
        let posterior = Posterior { explanations: vec![best], pattern_shifted: Some(40.0), ..Posterior::default() };
        let found = posterior.probabilities(&[ModelPoint::exact("", [0.0; 3].into())], 0.1);
        assert!((found.elsewhere - 0.5).abs() < 1e-12 && found.absent < 1e-12, "{found:?}");
    }

    #[test]
    fn a_copy_is_elsewhere_and_suffices() {
        let pose = |x: f64| Transform::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::new(x, 0.0, 0.0));
        let at = |x: f64, ln_evidence: f64| Explanation {
            pairs: Vec::new(),
            edges: Vec::new(),
            object_from_camera: pose(x),
            ln_evidence,
            ln_clutter_density: 0.0,
        };
        let model = [ModelPoint::exact("", [0.0; 3].into())];
        let reported = |beside: Explanation| {
            let (explanations, beside) = (vec![at(0.0, 40.0)], vec![beside]);
            let posterior = Posterior { explanations, beside, ..Posterior::default() };
            posterior.copy(&model, 0.1, |ln_evidence| ln_evidence >= 5.0).is_some()
        };
        assert_eq!([4.9, 5.0].map(|evidence| reported(at(1.0, evidence))), [false, true]);
        assert!(!reported(at(0.05, 30.0)), "the same place");
    }

    #[test]
    fn where_clutter_resembles_the_object_it_decides_how_the_places_are_filled() {
        let pose = Transform::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::zeros());
        let best = Explanation {
            pairs: Vec::new(),
            edges: Vec::new(),
            object_from_camera: pose,
            ln_evidence: 40.0,
            ln_clutter_density: 0.0,
        };
        let absent = |structured_clutter: Option<StructuredClutter>| {
            let posterior = Posterior { explanations: vec![best.clone()], structured_clutter, ..Posterior::default() };
            let probabilities = posterior.probabilities(&[], 0.1);
            assert!(
                (probabilities.absent - probabilities.clutter) * 0.99 <= (-40.0_f64).exp(),
                "the other causes of absence have the prior odds of no object"
            );
            probabilities.absent
        };
        let structured_clutter = |ln_evidence, ln_alone| Some(StructuredClutter { ln_evidence, ln_alone });
        assert!(absent(None) < 1e-15 && absent(structured_clutter(-20.0, 0.0)) < 1e-13);
        // As many places elsewhere are filled as places of the object: even odds. Far fewer: odds of one to e¹².
        assert!((absent(structured_clutter(60.0, 0.0)) - 0.5).abs() < 1e-9);
        assert!((absent(structured_clutter(60.0, -12.0)) * 12.0_f64.exp() - 1.0).abs() < 1e-4);
    }
}
