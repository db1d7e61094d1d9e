//! A key frame found again by what it shows.

use nalgebra::{Matrix3, Vector3};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_component::{Choice, in_range};
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform, UncertainPoint};
use seafix_referencing::Observations;
use seafix_vision::{FrontEndOutput, Image, Threads, View, Workspace};
use serde::{Deserialize, Serialize};

use super::keyframe::{KeyFrame, StereoFeatures};
use crate::{
    ObjectPose, RelativeMotion, Stereo, StereoPair,
    fusion::{Contradiction, gate},
    stereo::{
        StereoStages,
        consensus::{Consensus, Rules, consensus, seen_again},
        front_end::{Seen, in_common},
        pose::{Found, joint, refine},
    },
};

/// How key frames are recognised.
///
/// Points of the pair in hand are paired with those of a key frame by their descriptors; the motion that most pairs agree
/// on is sought by sample consensus and is refined by maximum likelihood: four pixel residuals a point, weighed by the
/// noise of the pair and by the full covariance of the key frame's point, whose depth errs far more than its direction. (A
/// registered [`Solver`](seafix_referencing::Solver) takes a model's point as equally exact in all directions; it serves
/// inside the consensus.) What is found must agree with the prior, and not by chance: the expected number of motions that
/// as many of the pairs would agree on if they were paired at random stays below a budget.
///
/// Source: Fischler and Bolles, *Random sample consensus*, 1981; the number by chance: Moisan and Stival, *A probabilistic
/// criterion to detect rigid point matches*, IJCV 2004.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Recognition {
    /// Prepare each image, one after the other.
    pub filters: Vec<Choice>,
    /// Finds key points in each image.
    pub detector: Choice,
    /// Says where exactly they are.
    pub locator: Choice,
    /// Describes their surroundings; the vehicle may come back on another heading: not upright.
    pub descriptor: Choice,
    /// Pairs left with right.
    pub matcher: Choice,
    /// Aligns each pair between the cameras.
    pub refinement: Choice,
    /// Turns pairs into points.
    pub triangulator: Choice,
    /// Pairs points with those of a key frame, by their descriptors.
    pub between: Choice,
    /// The motion of three points, for the consensus.
    pub minimal: Choice,
    /// The motion of all that agree.
    pub solver: Choice,
    /// Points of a pair at most, the strongest.
    pub points: usize,
    /// How far from its expected place, in the mean of both images, a point may be seen and still agree (px).
    pub consensus_px: f64,
    /// Draws at most.
    pub draws: usize,
    /// Fewer points that agree are no recognition.
    pub min_points: usize,
    /// The expected number of recognitions by chance, over all key frames that are tried for a pair.
    pub budget: f64,
    /// The share of right recognitions that agree with the prior.
    pub confidence: f64,
    /// A motion known worse than this is no answer: one standard deviation over the three axes together (m).
    pub max_sigma: f64,
    /// Key frames that are tried for a pair at most.
    pub candidates: usize,
    /// What is drawn at random follows from this.
    pub seed: u64,
}

impl Default for Recognition {
    fn default() -> Self {
        let stereo = Stereo::default();
        Self {
            filters: stereo.filters,
            detector: stereo.detector,
            locator: stereo.locator,
            descriptor: Choice::named("sift").with("upright", false),
            matcher: stereo.matcher,
            refinement: stereo.refinement,
            triangulator: stereo.triangulator,
            between: stereo.between,
            minimal: stereo.minimal,
            solver: stereo.solver,
            points: 300,
            consensus_px: 2.0,
            draws: 500,
            min_points: 15,
            budget: 1e-6,
            confidence: 0.9999,
            max_sigma: 0.1,
            candidates: 5,
            seed: 0,
        }
    }
}

impl Recognition {
    /// What cannot be built or worked with, as a sentence.
    ///
    /// # Errors
    /// The sentence.
    pub fn check(&self) -> Result<(), String> {
        let stages = self.stages()?;
        if !stages.between.compares_descriptors() {
            return Err("between: of a key frame only descriptors are kept; choose `mutual-ratio`".to_owned());
        }
        let positive = |name, x: f64, what| in_range(x > 0.0 && x.is_finite(), name, x, what);
        positive("consensus-px", self.consensus_px, "a positive number of pixels")?;
        in_range(self.draws > 0, "draws", self.draws, "at least 1")?;
        in_range(self.min_points >= 6, "min-points", self.min_points, "at least 6")?;
        in_range(self.points >= self.min_points, "points", self.points, "at least min-points")?;
        positive("budget", self.budget, "a positive number")?;
        let confident = self.confidence > 0.0 && self.confidence < 1.0;
        in_range(confident, "confidence", self.confidence, "a number between 0 and 1")?;
        positive("max-sigma", self.max_sigma, "a positive length (m)")?;
        in_range(self.candidates > 0, "candidates", self.candidates, "at least 1")
    }

    /// The odometry's stages with these components.
    fn stages(&self) -> Result<StereoStages, String> {
        let Self { filters, detector, locator, descriptor, .. } = self.clone();
        let Self { matcher, refinement, triangulator, between, minimal, solver, .. } = self.clone();
        let rest = Stereo::default();
        let stereo = Stereo {
            filters,
            detector,
            locator,
            descriptor,
            matcher,
            refinement,
            triangulator,
            between,
            minimal,
            solver,
            ..rest
        };
        stereo.stages()
    }
}

/// A key frame that was found again.
#[derive(Debug, Clone, PartialEq)]
pub struct Recognized {
    /// Which: its place among those that were offered.
    pub keyframe: usize,
    /// Where the camera is relative to it, `keyframe_from_camera`.
    pub motion: RelativeMotion,
    /// Points that look alike.
    pub matches: usize,
    /// Those that agree with the motion.
    pub found: usize,
    /// log₁₀ of the expected number of recognitions as good by chance.
    pub nfa: f64,
}

/// Why no key frame was found again.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotRecognized {
    /// There is none where the camera may be.
    #[error("no key frame was laid where the camera may be")]
    Nowhere,
    /// Too few points look alike.
    #[error("{found} points look like points of the key frame; {needed} are needed")]
    FewMatches {
        /// How many do.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// No motion explains enough of them.
    #[error("no motion explains more than {found} of {matches} points that look alike; {needed} are needed")]
    NoConsensus {
        /// How many the best motion explains.
        found: usize,
        /// Of how many.
        matches: usize,
        /// How many are needed.
        needed: usize,
    },
    /// As many would agree by chance.
    #[error(
        "{found} of {matches} points agree; by chance 10^{expected:.1} motions are as good, at most {budget:e} may be"
    )]
    AContrario {
        /// How many agree.
        found: usize,
        /// Of how many.
        matches: usize,
        /// log₁₀ of how many motions are as good by chance.
        expected: f64,
        /// How many may be.
        budget: f64,
    },
    /// The motion is not determined well enough.
    #[error("the motion from the key frame is known to {0:.3} m only")]
    Weak(f64),
    /// The motion contradicts the prior.
    #[error("what was found contradicts what was known: {0}")]
    Contradicts(Contradiction),
    /// Two key frames say different things.
    #[error("key frames {0} and {1} are both recognised, and contradict each other")]
    Ambiguous(usize, usize),
}

impl NotRecognized {
    /// How near it came to an answer.
    fn progress(&self) -> usize {
        match self {
            Self::Nowhere => 0,
            Self::FewMatches { .. } => 1,
            Self::NoConsensus { .. } => 2,
            Self::AContrario { .. } => 3,
            Self::Weak(_) => 4,
            Self::Contradicts(_) => 5,
            Self::Ambiguous(..) => 6,
        }
    }
}

/// A key frame that may be in view.
#[derive(Debug, Clone, Copy)]
pub struct LoopCandidate<'a> {
    /// What is kept of it.
    pub keyframe: &'a KeyFrame,
    /// Where the camera should be relative to it, `keyframe_from_camera`.
    pub prior: RelativeMotion,
}

/// Recognises key frames of one rig.
#[derive(Debug)]
pub struct PlaceRecognizer<'a> {
    settings: &'a Recognition,
    stages: StereoStages,
    rig: &'a StereoRig,
    output: FrontEndOutput,
    work: Workspace,
    /// Stands for images that are not kept.
    blank: Image,
}

impl<'a> PlaceRecognizer<'a> {
    /// Ready to work; the result does not depend on who works.
    ///
    /// # Panics
    /// When the settings were not checked.
    pub fn new(settings: &'a Recognition, rig: &'a StereoRig, threads: Threads) -> Self {
        Self {
            settings,
            stages: settings.stages().expect("settings are checked before"),
            rig,
            output: FrontEndOutput::new(threads),
            work: Workspace::new(threads),
            blank: Image::new(1, 1, vec![0.0]).expect("one pixel"),
        }
    }

    /// What a pair shows.
    pub fn stereo_features(&mut self, pair: &StereoPair<'_>) -> StereoFeatures {
        let seen = Seen::new(pair, &self.stages, self.rig, &mut self.output, &mut self.work);
        let (cloud, keypoints, descriptors) = seen.strongest(self.settings.points);
        StereoFeatures { stamp_ns: pair.stamp_ns, cloud, keypoints, descriptors }
    }

    /// Which of the candidates the pair shows, and from where. `between` says how two of them lie to each other, as far as
    /// that is known: `first_from_second`.
    ///
    /// # Errors
    /// [`NotRecognized`], of the candidate that came nearest to an answer.
    pub fn recognize(
        &mut self,
        stereo_features: &StereoFeatures,
        candidates: &[LoopCandidate<'_>],
        between: impl Fn(usize, usize) -> Option<RelativeMotion>,
    ) -> Result<Recognized, NotRecognized> {
        let tried = candidates.len().min(self.settings.candidates);
        let mut reason = NotRecognized::Nowhere;
        let mut found: Vec<Recognized> = Vec::new();
        for (index, candidate) in candidates.iter().enumerate().take(tried) {
            match self.one(stereo_features, candidate, index, tried) {
                Ok(one) => found.push(one),
                Err(why) if why.progress() >= reason.progress() => reason = why,
                Err(_) => {}
            }
        }
        found.sort_by(|a, b| b.found.cmp(&a.found).then(a.keyframe.cmp(&b.keyframe)));
        let Some(best) = found.first() else { return Err(reason) };
        for other in &found[1..] {
            let Some(known) = between(best.keyframe, other.keyframe) else { continue };
            // Over the other key frame the camera is where the best one says.
            let over = as_object_pose(&known).after(&other.motion);
            if gate(&over, &as_object_pose(&best.motion), self.settings.confidence).is_err() {
                return Err(NotRecognized::Ambiguous(best.keyframe, other.keyframe));
            }
        }
        Ok(best.clone())
    }

    fn one(
        &mut self,
        stereo_features: &StereoFeatures,
        candidate: &LoopCandidate<'_>,
        index: usize,
        tried: usize,
    ) -> Result<Recognized, NotRecognized> {
        let settings = self.settings;
        let (needed, keyframe) = (settings.min_points, candidate.keyframe);
        let view = |keypoints, descriptors| View { image: &self.blank, keypoints, descriptors };
        let pairs = in_common(
            &view(&keyframe.keypoints, &keyframe.descriptors),
            &view(&stereo_features.keypoints, &stereo_features.descriptors),
            &*self.stages.between,
            self.rig,
            &mut self.work,
        );
        let matches = pairs.len();
        if matches < needed {
            return Err(NotRecognized::FewMatches { found: matches, needed });
        }
        let points = pairs.iter().map(|&(kept, seen)| seen_again(&keyframe.points[kept], &stereo_features.cloud[seen]));
        let data = Observations { points: points.collect(), rig: Some(self.rig) };
        let rules = Rules { px: settings.consensus_px, confidence: 0.999, draws: settings.draws };
        let guesses = [candidate.prior.motion.relabel()];
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed ^ stereo_features.stamp_ns ^ ((index as u64) << 48));
        let solvers = (&*self.stages.minimal, &*self.stages.solver);
        let agreed = consensus(&data, self.rig, &rules, solvers, &guesses, &mut rng);
        let found = agreed.as_ref().map_or(0, |agreed| agreed.inliers.len());
        let few = |found| NotRecognized::NoConsensus { found, matches, needed };
        let Some(Consensus { motion, .. }) = agreed.filter(|_| found >= needed) else {
            return Err(few(found));
        };
        let size = self.stages.minimal.minimum();
        let nfa = self.nfa(matches, found, size, tried);
        if !(nfa <= libm::log10(settings.budget)) {
            return Err(NotRecognized::AContrario { found, matches, expected: nfa, budget: settings.budget });
        }
        // All pairs, not those of the consensus alone: it counts pixels, and where the views lie apart what the depths err by
        // is pixels too. A choice by residuals would make the pose seem better known than it is.
        let mut seen: Vec<Found> = pairs
            .iter()
            .filter_map(|&(kept, seen)| {
                let pixels = stereo_features.cloud[seen].pixels?;
                let (at, covariance) = inverse_depth(&keyframe.points[kept])?;
                let world_from_anchor = Transform::identity();
                Some(Found {
                    world_from_anchor,
                    at,
                    covariance,
                    pixels: pixels.at.coordinates(),
                    noise: pixels.covariance,
                })
            })
            .collect();
        let initial = refine(self.rig, &seen, &motion.relabel()).ok_or_else(|| few(0))?;
        let mut agree = initial.agrees.iter();
        seen.retain(|_| agree.next() == Some(&true));
        if seen.len() < needed {
            return Err(few(seen.len()));
        }
        let pose = joint(self.rig, &seen, &initial.world_from_camera).ok_or_else(|| few(0))?;
        let motion = RelativeMotion::new(pose.world_from_camera.relabel(), Covariance6::new(pose.covariance));
        let sigma = motion.covariance.position_sigma();
        if !(sigma <= settings.max_sigma) {
            return Err(NotRecognized::Weak(sigma));
        }
        gate(&as_object_pose(&candidate.prior), &as_object_pose(&motion), settings.confidence)
            .map_err(NotRecognized::Contradicts)?;
        Ok(Recognized { keyframe: index, motion, matches, found: seen.len(), nfa })
    }

    /// log₁₀ of the expected number of motions that `found` of `matches` random pairs agree on: each set of `size`
    /// pairs gives one, and another pair agrees when it falls on the disc of twice the squared distance that is allowed.
    fn nfa(&self, matches: usize, found: usize, size: usize, tried: usize) -> f64 {
        let [width, height] = self.rig.left().size();
        let disc = std::f64::consts::PI * 2.0 * self.settings.consensus_px * self.settings.consensus_px;
        let p = f64::min(disc / (f64::from(width) * f64::from(height)), 0.5);
        let choose = |n: usize, k: usize| {
            let ln = |n: usize| libm::lgamma(n as f64 + 1.0);
            ln(n) - ln(k) - ln(n - k)
        };
        let (rest, agree) = (matches - size, found - size);
        let one = |k: usize| choose(rest, k) + k as f64 * libm::log(p) + (rest - k) as f64 * libm::log1p(-p);
        let first = one(agree);
        let tail: f64 = (agree..=rest).map(|k| libm::exp(one(k) - first)).sum();
        (libm::log(tried as f64) + choose(matches, size) + first + libm::log(tail)) / std::f64::consts::LN_10
    }
}

/// A motion from a key frame, as a pose relative to an object: the key frame takes its place.
fn as_object_pose(local: &RelativeMotion) -> ObjectPose {
    ObjectPose::new(local.motion.relabel::<Object, Camera>(), Covariance6::new(local.covariance.matrix))
}

/// A point as direction and inverse depth (x/z, y/z, 1/z), with the covariance of that.
fn inverse_depth(point: &UncertainPoint<Camera>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let p = point.at.coords;
    if !(p.z > 0.0) {
        return None;
    }
    let w = 1.0 / p.z;
    let by = Matrix3::new(w, 0.0, -p.x * w * w, 0.0, w, -p.y * w * w, 0.0, 0.0, -w * w);
    Some((Vector3::new(p.x * w, p.y * w, w), by * point.covariance * by.transpose()))
}
