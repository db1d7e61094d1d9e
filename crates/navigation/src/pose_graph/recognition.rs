//! Place recognition: a key frame is found again by its descriptors.

use nalgebra::{Matrix3, Vector3};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_component::{Choice, Settings, in_range};
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform, UncertainPoint};
use seafix_referencing::Observations;
use seafix_vision::{FrontEndOutput, Image, Threads, View, Workspace};
use serde::{Deserialize, Serialize};

use super::keyframe::{KeyFrame, StereoFeatures};
use crate::{
    chain::ObjectPose,
    fusion::{Contradiction, gate},
    odometry::StereoPair,
    odometry_trajectory::RelativeMotion,
    stereo::{
        Stereo, StereoStages,
        consensus::{Consensus, Rules, consensus, seen_again},
        front_end::{Seen, in_common},
        pose::{Found, joint, refine},
    },
};

/// The settings of place recognition.
///
/// Points of the current pair are matched with those of a key frame by their descriptors. RANSAC finds the motion with
/// most inliers. Maximum likelihood refines it: four pixel residuals for each point, weighted by the noise of the pair
/// and by the full covariance of the key frame's point, whose depth is far less accurate than its direction. (A
/// registered [`Solver`](seafix_referencing::Solver) assumes isotropic model errors; it serves inside RANSAC only.) The
/// result must agree with the prior, and its number of false alarms (a contrario), the expected number of motions on
/// which as many random matches agree, must stay below a limit.
///
/// Source: Fischler and Bolles, *Random sample consensus*, 1981; Moisan and Stival, *A probabilistic criterion to
/// detect rigid point matches*, IJCV 2004.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Recognition {
    /// Image filters, in the order of their application.
    pub filters: Vec<Choice>,
    /// The detector of key points.
    pub detector: Choice,
    /// The locator of key points.
    pub locator: Choice,
    /// The descriptor; not upright, because the vehicle may return on another heading.
    pub descriptor: Choice,
    /// The matcher between left and right image.
    pub matcher: Choice,
    /// The refinement of each match between the cameras.
    pub refinement: Choice,
    /// The triangulator.
    pub triangulator: Choice,
    /// The matcher between the current pair and a key frame, by descriptors alone.
    #[setting(component = "matcher")]
    pub between: Choice,
    /// The minimal solver of RANSAC, for three points.
    #[setting(component = "solver")]
    pub minimal: Choice,
    /// The solver for all inliers of RANSAC.
    pub solver: Choice,
    /// Maximum number of points of a pair; the strongest are used.
    pub points: usize,
    /// Inlier threshold of RANSAC: RMS distance over both images from the predicted position (px).
    pub consensus_px: f64,
    /// Maximum number of RANSAC samples.
    pub draws: usize,
    /// Minimum number of inliers of a recognition, at least 6.
    pub min_points: usize,
    /// Maximum number of false alarms, over all key frames that are tried for a pair.
    pub budget: f64,
    /// The fraction of correct recognitions that passes the gate of the prior, between 0 and 1.
    pub confidence: f64,
    /// Maximum standard deviation of the position over the three axes together (m); a less certain motion is rejected.
    pub max_sigma: f64,
    /// Maximum number of key frames that are tried for a pair.
    pub candidates: usize,
    /// Seed of the random samples.
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
    /// Checks the settings.
    ///
    /// # Errors
    /// A sentence that names the invalid setting.
    pub fn check(&self) -> Result<(), String> {
        let stages = self.stages()?;
        if !stages.between.compares_descriptors() {
            return Err("between: a key frame keeps descriptors and no images; choose `mutual-ratio`".to_owned());
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

    /// The stages of stereo odometry with these components.
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

/// A recognised key frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Recognized {
    /// Its index among the candidates.
    pub keyframe: usize,
    /// The motion `keyframe_from_camera`.
    pub motion: RelativeMotion,
    /// Number of descriptor matches.
    pub matches: usize,
    /// Number of matches that agree with the motion.
    pub found: usize,
    /// log₁₀ of the number of false alarms.
    pub nfa: f64,
}

/// The reason why no key frame was recognised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotRecognized {
    /// No key frame that may be in view.
    #[error("no key frame may be in view")]
    Nowhere,
    /// Too few matches.
    #[error("{found} points match the key frame; at least {needed} are needed")]
    FewMatches {
        /// Number of matches.
        found: usize,
        /// Minimum number of matches.
        needed: usize,
    },
    /// No motion that explains enough matches.
    #[error("no motion explains more than {found} of {matches} matches; at least {needed} are needed")]
    NoConsensus {
        /// Number of matches that the best motion explains.
        found: usize,
        /// Number of matches.
        matches: usize,
        /// Minimum number of explained matches.
        needed: usize,
    },
    /// An agreement that random matches would reach as well.
    #[error(
        "{found} of {matches} matches agree: the number of false alarms is 10^{expected:.1}; the limit is {budget:e}"
    )]
    AContrario {
        /// Number of matches that agree.
        found: usize,
        /// Number of matches.
        matches: usize,
        /// log₁₀ of the number of false alarms.
        expected: f64,
        /// Maximum number of false alarms.
        budget: f64,
    },
    /// A motion with a position uncertainty above the limit (m).
    #[error("the motion from the key frame is too uncertain: its position has a standard deviation of {0:.3} m")]
    Weak(f64),
    /// A motion that contradicts the prior.
    #[error("the recognised pose contradicts the prior: {0}")]
    Contradicts(Contradiction),
    /// Two recognised key frames that contradict each other.
    #[error("key frames {0} and {1} are both recognised and contradict each other")]
    Ambiguous(usize, usize),
}

impl NotRecognized {
    /// The stage of recognition at which this reason applies; later stages are nearer to success.
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
    /// The key frame.
    pub keyframe: &'a KeyFrame,
    /// The predicted motion `keyframe_from_camera`.
    pub prior: RelativeMotion,
}

/// A place recognizer for the key frames of one rig.
#[derive(Debug)]
pub struct PlaceRecognizer<'a> {
    settings: &'a Recognition,
    stages: StereoStages,
    rig: &'a StereoRig,
    output: FrontEndOutput,
    work: Workspace,
    /// A placeholder for the images of key frames, which are not kept.
    blank: Image,
}

impl<'a> PlaceRecognizer<'a> {
    /// A recognizer with these settings; the result does not depend on the number of threads.
    ///
    /// # Panics
    /// If the settings were not checked.
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

    /// The measured points of a pair with their descriptors.
    pub fn stereo_features(&mut self, pair: &StereoPair<'_>) -> StereoFeatures {
        let seen = Seen::new(pair, &self.stages, self.rig, &mut self.output, &mut self.work);
        let (cloud, keypoints, descriptors) = seen.strongest(self.settings.points);
        StereoFeatures { stamp_ns: pair.stamp_ns, cloud, keypoints, descriptors }
    }

    /// The candidate that the pair shows, and the motion from it.
    ///
    /// `between` gives the known motion `first_from_second` between two candidates, if there is one.
    ///
    /// # Errors
    /// The [`NotRecognized`] of the candidate that came nearest to recognition.
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
            // The camera's pose relative to the best key frame, by way of the other one.
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
        let data = Observations { points: points.collect(), edges: Vec::new(), rig: Some(self.rig) };
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
        // All matches are used, not only the inliers of RANSAC. RANSAC counts pixels, and with a change of viewpoint
        // depth errors cause pixel errors too. A selection by residuals would make the covariance too small.
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
        let sigma = motion.covariance.position_rms();
        if !(sigma <= settings.max_sigma) {
            return Err(NotRecognized::Weak(sigma));
        }
        gate(&as_object_pose(&candidate.prior), &as_object_pose(&motion), settings.confidence)
            .map_err(NotRecognized::Contradicts)?;
        Ok(Recognized { keyframe: index, motion, matches, found: seen.len(), nfa })
    }

    /// log₁₀ of the number of false alarms: the expected number of motions on which `found` of `matches` random pairs
    /// agree.
    ///
    /// Each set of `size` pairs gives one motion. Another pair agrees if it falls on a disc with twice the allowed
    /// squared radius.
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

/// The motion from a key frame, with the key frame in the role of the object.
fn as_object_pose(local: &RelativeMotion) -> ObjectPose {
    ObjectPose::new(local.motion.relabel::<Object, Camera>(), Covariance6::new(local.covariance.matrix))
}

/// The inverse-depth coordinates (x/z, y/z, 1/z) of a point, with their covariance.
fn inverse_depth(point: &UncertainPoint<Camera>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let p = point.at.coords;
    if !(p.z > 0.0) {
        return None;
    }
    let w = 1.0 / p.z;
    let by = Matrix3::new(w, 0.0, -p.x * w * w, 0.0, w, -p.y * w * w, 0.0, 0.0, -w * w);
    Some((Vector3::new(p.x * w, p.y * w, w), by * point.covariance * by.transpose()))
}
