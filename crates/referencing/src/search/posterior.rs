//! What a search by likelihood believes.

use seafix_geometry::{Camera, Object, Transform};

use super::{RepeatedPattern, StructuredClutter};
use crate::{Alternative, Correspondence, ModelPoint, rms_apart};

/// Explanations less likely than the best by this much (nats) are not listed: a share of 0.05 %.
const NEGLIGIBLE: f64 = 7.6;

/// A pose that explains the data, with the weight of its evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct Explanation {
    /// The pairs, in the order of the model points.
    pub pairs: Vec<Correspondence>,
    /// The most likely pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// ln of the probability of the data given a pose about here, over that given no object at all (nats).
    pub ln_evidence: f64,
    /// By how much evenly spread clutter would have made that more (nats): the pairs lie where the cloud is crowded.
    pub ln_clutter_density: f64,
}

impl Explanation {
    /// The same as an alternative, its evidence as the score.
    pub(crate) fn alternative(&self) -> Alternative {
        Alternative { object_from_camera: self.object_from_camera, pairs: self.pairs.clone(), score: self.ln_evidence }
    }
}

/// The poses that may explain the data, the likeliest first.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Posterior {
    /// The poses; what is less likely than the best by many orders of magnitude is left out.
    pub explanations: Vec<Explanation>,
    /// What the cloud shows beside the likeliest: poses that explain points which it leaves, the likeliest first.
    pub beside: Vec<Explanation>,
    /// Whether every second copy of the object, whole or in part, is among them, as far as bounds of evidence tell; `None` where none
    /// was looked for, since nothing is likely enough to be believed.
    pub copies_sought: Option<bool>,
    /// What a pattern that goes on beyond the object explains of the cloud; `None` of an object without one.
    pub repeated_pattern: Option<RepeatedPattern>,
    /// What shows most that clutter imitates the object; `None` where nothing does.
    pub structured_clutter: Option<StructuredClutter>,
    /// The likeliest of what else was met elsewhere, or, where that is nothing, of what was followed however unlikely it is: the
    /// answer is held against it.
    pub unlikely: Option<Explanation>,
    /// No admissible set has more evidence than the likeliest pose by more than this (nats), clutter being spread evenly: zero where that
    /// is the most likely, proved. `None` where no proof was sought.
    pub evidence_gap: Option<f64>,
}

/// What has this evidence (nats) beside the likeliest pose is a second copy of the object, whole or in part.
pub(super) const COPY: f64 = 9.0;

/// Clutter alone shows this much evidence (nats) in one frame of twenty: E Σ Λ = 1 where it is spread as the terms have it.
const ACCIDENT: f64 = 3.0;

/// How often clutter imitates an object, before a frame shows it: so seldom that where nothing shows it no answer depends on it.
const LN_RESEMBLES: f64 = -11.5;

/// How the belief is shared out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosteriorProbabilities {
    /// That the pose is within the alert limit of the likeliest explanation.
    pub map_estimate: f64,
    /// That it is elsewhere.
    pub elsewhere: f64,
    /// That the object is not there.
    pub absent: f64,
    /// The part of that in which a pattern is there that looks like it.
    pub alike: f64,
    /// The part of it that is due to clutter doing more than evenly spread clutter would.
    pub clutter: f64,
}

impl Posterior {
    /// The explanations with a share beside the likeliest that place the object elsewhere, one a place.
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

    /// A second copy of the object, elsewhere, whole or in part: a pose that explains other cloud points than the likeliest
    /// does, and that alone would be believed: no object at all has at most the probability `absence`.
    ///
    /// Where two poses are each beyond chance, clutter explains neither: it is not the evidence that decides between
    /// them, but which of two things is the object. Of that the cloud says only how much of each is seen.
    /// Evidence of nine nats is another one in any case: where two things may be the object, less than certainty that the second is keeps
    /// from choosing.
    pub fn copy(&self, model: &[ModelPoint], limit: f64, absence: f64) -> Option<&Explanation> {
        let likely = libm::log((1.0 - absence) / absence).min(COPY);
        self.apart(&self.beside, model, limit).into_iter().find(|other| other.ln_evidence >= likely)
    }

    /// The likeliest pose of all that are elsewhere, however unlikely.
    pub fn next(&self, model: &[ModelPoint], limit: f64) -> Option<&Explanation> {
        let known = [&self.explanations[..], &self.beside, self.unlikely.as_slice()];
        let all = known.into_iter().filter_map(|some| self.apart(some, model, limit).first().copied());
        all.max_by(|a, b| a.ln_evidence.total_cmp(&b.ln_evidence))
    }

    /// Those of these poses that are not about the likeliest, in their order.
    fn apart<'a>(&self, of: &'a [Explanation], model: &[ModelPoint], limit: f64) -> Vec<&'a Explanation> {
        let Some(best) = self.explanations.first() else { return Vec::new() };
        let near =
            |other: &&Explanation| rms_apart(model, &best.object_from_camera, &other.object_from_camera) <= limit;
        of.iter().filter(|other| !near(other)).collect()
    }

    /// The posterior probabilities: P_m = Λ_m/(1 + Σ Λ), Λ the evidence, presence and absence being
    /// equally likely beforehand; poses within `limit` (m, RMS over the model points) of the likeliest count
    /// as one with it. A pattern like the object's, alone or around the object, is as likely beforehand. And what looks
    /// like the object beside it, in the points that it leaves, is what clutter of this cloud can do: without the object it
    /// would be as likely that clutter did it here. Where another pose shows that the clutter imitates the object
    /// ([`StructuredClutter`]), the likeliest pose is such an imitation, or the object among them.
    pub fn probabilities(&self, model: &[ModelPoint], limit: f64) -> PosteriorProbabilities {
        let Some(best) = self.explanations.first() else {
            return PosteriorProbabilities { map_estimate: 0.0, elsewhere: 0.0, absent: 1.0, alike: 0.0, clutter: 0.0 };
        };
        let pattern =
            self.repeated_pattern.unwrap_or(RepeatedPattern { alone: f64::NEG_INFINITY, around: f64::NEG_INFINITY });
        let beside = self.apart(&self.beside, model, limit).first().map_or(0.0, |other| other.ln_evidence);
        let clutter = if beside > ACCIDENT { beside } else { 0.0 };
        // The object among imitations, and imitations alone.
        let among =
            self.structured_clutter.map_or(f64::NEG_INFINITY, |of| best.ln_evidence + of.ln_evidence + LN_RESEMBLES);
        let imitated = self.structured_clutter.map_or(f64::NEG_INFINITY, |of| among + of.ln_alone);
        let max =
            [clutter, pattern.alone, pattern.around, among, imitated].into_iter().fold(best.ln_evidence, f64::max);
        let (mut map_estimate, mut elsewhere) = (0.0, 0.0);
        for other in &self.explanations {
            let fraction = libm::exp(other.ln_evidence - max);
            if rms_apart(model, &best.object_from_camera, &other.object_from_camera) <= limit {
                map_estimate += fraction;
            } else {
                elsewhere += fraction;
            }
        }
        map_estimate += libm::exp(pattern.around - max) + libm::exp(among - max);
        let alike = libm::exp(pattern.alone - max);
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Transform;

    /// Seen to fail where a copy must be believed by itself.
    #[test]
    fn nine_nats_are_a_copy_however_sure_a_first_one_must_be() {
        let pose = |x: f64| Transform::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::new(x, 0.0, 0.0));
        let at = |x: f64, ln_evidence: f64| Explanation {
            pairs: Vec::new(),
            object_from_camera: pose(x),
            ln_evidence,
            ln_clutter_density: 0.0,
        };
        let model = [ModelPoint::exact("", [0.0; 3].into())];
        let reported = |beside: Explanation, absence: f64| {
            let (explanations, beside) = (vec![at(0.0, 40.0)], vec![beside]);
            let posterior = Posterior { explanations, beside, ..Posterior::default() };
            posterior.copy(&model, 0.1, absence).is_some()
        };
        // ln(1/2e-5) = 10.8, ln(1/1e-2) = 4.6.
        assert_eq!([4.0, 5.0, 8.9, 9.1].map(|evidence| reported(at(1.0, evidence), 2e-5)), [false, false, false, true]);
        assert_eq!([4.0, 5.0, 8.9, 9.1].map(|evidence| reported(at(1.0, evidence), 1e-2)), [false, true, true, true]);
        assert!(!reported(at(0.05, 30.0), 1e-2), "the same place");
    }

    #[test]
    fn where_clutter_resembles_the_object_it_decides_how_the_places_are_filled() {
        let pose = Transform::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::zeros());
        let best =
            Explanation { pairs: Vec::new(), object_from_camera: pose, ln_evidence: 40.0, ln_clutter_density: 0.0 };
        let absent = |structured_clutter: Option<StructuredClutter>| {
            let posterior = Posterior { explanations: vec![best.clone()], structured_clutter, ..Posterior::default() };
            let probabilities = posterior.probabilities(&[], 0.1);
            assert!(
                (probabilities.absent - probabilities.clutter) * 0.99 <= (-40.0_f64).exp(),
                "all else is no object at all"
            );
            probabilities.absent
        };
        let structured_clutter = |ln_evidence, ln_alone| Some(StructuredClutter { ln_evidence, ln_alone });
        assert!(absent(None) < 1e-15 && absent(structured_clutter(-20.0, 0.0)) < 1e-13);
        // As many of the places elsewhere are filled as of the object's: even odds; far fewer: one to e¹².
        assert!((absent(structured_clutter(60.0, 0.0)) - 0.5).abs() < 1e-9);
        assert!((absent(structured_clutter(60.0, -12.0)) * 12.0_f64.exp() - 1.0).abs() < 1e-4);
    }
}
