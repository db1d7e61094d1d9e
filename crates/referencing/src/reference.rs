//! From a search's answer to a pose that is believed, or a refusal.

use rand::Rng;
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    Correspondence, Degenerate, Identification, ModelPoint, Observations, Prior, PriorBound, Problem, Search, Solver,
    Unidentified,
    candidates::chi_square,
    chance::expected_sets,
    site::diameter,
    solve::likelihood::{self, Likelihood},
};

/// When an identified set is believed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Acceptance {
    /// Least number of identified points.
    pub least_points: usize,
    /// Largest expected number of chance sets of the found size (a-contrario acceptance).
    pub chance_budget: f64,
    /// Confidence of the χ² tests of residuals and prior: a true set fails with one minus this.
    pub confidence: f64,
    /// Poses further apart than this (m, RMS over the model points), or than 5 % of the model's
    /// diameter if that is less, are different answers; a pose that by its own covariance may be off
    /// by as much is none.
    pub alert_limit: f64,
}

impl Default for Acceptance {
    fn default() -> Self {
        Self { least_points: 3, chance_budget: 0.01, confidence: 0.999, alert_limit: 0.10 }
    }
}

impl Acceptance {
    /// What is wrong with the settings, if something is.
    ///
    /// # Errors
    /// The first setting out of its range, and the range.
    pub fn check(&self) -> Result<(), String> {
        let in_range = |ok: bool, name: &str, value: f64, range: &str| {
            if ok { Ok(()) } else { Err(format!("acceptance: {name} = {value}; give {range}")) }
        };
        in_range(self.least_points >= 3, "least-points", self.least_points as f64, "3 or more")?;
        in_range(self.chance_budget > 0.0, "chance-budget", self.chance_budget, "a positive number")?;
        let confident = self.confidence > 0.0 && self.confidence < 1.0;
        in_range(confident, "confidence", self.confidence, "a number between 0 and 1")?;
        let alert = self.alert_limit > 0.0 && self.alert_limit.is_finite();
        in_range(alert, "alert-limit", self.alert_limit, "a positive number of metres")
    }
}

/// A fix: the pose relative to the target and everything that supports it.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// The pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<Object, Camera>,
    /// The identified points.
    pub pairs: Vec<Correspondence>,
    /// The indices into `pairs` of the points the pose rests on (all of them, or the triad's three).
    pub used: Vec<usize>,
    /// Root mean square of the residuals C·H − P over the pairs (m).
    pub residual_rms: f64,
    /// How well it explains the data: the log-likelihood of its residuals and of the prior.
    pub score: f64,
}

/// Another pose that explains the data as well.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// The pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// Its pairs.
    pub pairs: Vec<Correspondence>,
    /// How well it explains the data: the log-likelihood of its residuals and of the prior; larger is better.
    pub score: f64,
}

/// Why an answer is not believed, or why there is none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The search found nothing.
    #[error(transparent)]
    Search(#[from] Unidentified),
    /// The set is smaller than asked for.
    #[error("{found} points were identified; {needed} are needed")]
    TooFew {
        /// Its size.
        found: usize,
        /// [`Acceptance::least_points`], or what the solver needs.
        needed: usize,
    },
    /// Chance alone would give sets as large.
    #[error("chance gives {expected:.2e} sets of {size} points; at most {budget:.1e} are accepted")]
    Chance {
        /// Size of the set.
        size: usize,
        /// Expected number of chance sets of this size.
        expected: f64,
        /// [`Acceptance::chance_budget`].
        budget: f64,
    },
    /// No rigid motion explains the set within its noise.
    #[error("the residuals have χ² = {chi2:.1}; at most {limit:.1} is likely of a true set")]
    Residuals {
        /// Σ rᵀ S⁻¹ r of the most likely rigid motion.
        chi2: f64,
        /// The quantile of χ² with 3k − 6 degrees of freedom.
        limit: f64,
    },
    /// By its own covariance the pose may be further off than the alert limit.
    #[error(
        "the model points are known to {rms:.3} m (RMS, one sigma); twice that exceeds the alert limit of {limit:.3} m"
    )]
    Imprecise {
        /// Root mean square over the model points of the predicted error (m).
        rms: f64,
        /// The alert limit (m).
        limit: f64,
    },
    /// The pose contradicts the prior.
    #[error("the pose is {off:.3} times as far from the prior as the prior allows")]
    Prior {
        /// Distance from the prior over the largest allowed.
        off: f64,
    },
}

impl Refusal {
    /// The reason as logs and tables have it, in kebab-case.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::Search(why) => why.reason(),
            Self::TooFew { .. } => "too-few",
            Self::Chance { .. } => "chance",
            Self::Residuals { .. } | Self::Prior { .. } => "gate",
            Self::Imprecise { .. } => "imprecise",
        }
    }
}

/// What came of one attempt at a fix.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// A pose that passed every test.
    Referenced(Box<Reference>),
    /// Several poses explain the data equally well; the likeliest first.
    Ambiguous(Vec<Alternative>),
    /// No set of points was identified, or the set was not believed.
    Unidentified(Refusal),
    /// The identified points determine no pose.
    Degenerate(Degenerate),
}

impl Outcome {
    /// Its name in logs and tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Referenced(_) => "referenced",
            Self::Ambiguous(_) => "ambiguous",
            Self::Unidentified(_) => "unidentified",
            Self::Degenerate(_) => "degenerate",
        }
    }

    /// Why there is no pose, in kebab-case; `None` where there is one.
    pub fn reason(&self) -> Option<&'static str> {
        match self {
            Self::Referenced(_) => None,
            Self::Ambiguous(_) => Some("rivals"),
            Self::Unidentified(refusal) => Some(refusal.reason()),
            Self::Degenerate(_) => Some("degenerate"),
        }
    }

    /// The same in a sentence with its numbers; `None` where there is a pose.
    pub fn explanation(&self) -> Option<String> {
        match self {
            Self::Referenced(_) => None,
            Self::Ambiguous(rivals) => Some(format!("{} different poses explain the data", rivals.len())),
            Self::Unidentified(refusal) => Some(refusal.to_string()),
            Self::Degenerate(degenerate) => Some(degenerate.to_string()),
        }
    }
}

/// An outcome and what led to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// What came of it.
    pub outcome: Outcome,
    /// The set that the search found, believed or not; empty where it found none.
    pub identified: Vec<Correspondence>,
    /// The best pose that differs from the answer by more than the alert limit, though it was not
    /// believed; for comparison only.
    pub runner_up: Option<Alternative>,
    /// Whether it is proved that no admissible set is larger.
    pub optimal: bool,
    /// No admissible set has more pairs than this, where the search says so.
    pub size_bound: Option<usize>,
    /// Expected number of chance sets as large as the one found.
    pub expected_chance_sets: Option<f64>,
    /// Pair tests spent by the search, where it says so.
    pub tests: Option<u64>,
}

impl Attempt {
    /// How much better than the runner-up the answer explains the data: the difference of their scores.
    pub fn margin(&self) -> Option<f64> {
        match (&self.outcome, &self.runner_up) {
            (Outcome::Referenced(reference), Some(other)) => Some(reference.score - other.score),
            (Outcome::Ambiguous(rivals), _) => Some(rivals.first()?.score - rivals.get(1)?.score),
            _ => None,
        }
    }
}

/// One attempt at a fix, after Stage 1: Stage 2 (which cloud points are which model points), the
/// rigid motion, and the tests that it must pass before it is believed.
pub fn reference(
    problem: &Problem<'_>,
    prior: Option<&Prior>,
    search: &dyn Search,
    solver: &dyn Solver,
    acceptance: &Acceptance,
    rig: Option<&StereoRig>,
    rng: &mut dyn Rng,
) -> Attempt {
    let found = search.search(problem, rng);
    judge(problem, prior, found, solver, acceptance, rig)
}

/// The second half of [`reference()`], for callers that time the search by itself: from what a
/// search said to a pose that is believed, or a refusal.
pub fn judge(
    problem: &Problem<'_>,
    prior: Option<&Prior>,
    found: Result<Identification, Unidentified>,
    solver: &dyn Solver,
    acceptance: &Acceptance,
    rig: Option<&StereoRig>,
) -> Attempt {
    let found = match found {
        Ok(found) => found,
        Err(why) => return Attempt::without(why),
    };
    let alert_limit = acceptance.alert_limit.min(ALERT_SHARE * diameter(problem.model));
    let judge = Judge { problem, prior, solver, acceptance, alert_limit, rig };
    let (outcome, runner_up) = match judge.size(&found.pairs).and_then(|()| judge.chance(&found.pairs)) {
        Ok(()) => judge.poses(&found),
        Err(refusal) => (Outcome::Unidentified(refusal), None),
    };
    let believed = match &outcome {
        Outcome::Referenced(reference) => &reference.pairs,
        _ => &found.pairs,
    };
    Attempt {
        expected_chance_sets: Some(expected_sets(problem, believed)),
        outcome,
        runner_up,
        optimal: found.optimal,
        size_bound: Some(found.size_bound),
        tests: Some(found.tests),
        identified: found.pairs,
    }
}

impl Attempt {
    /// The attempt that a search refused.
    pub(crate) fn without(why: Unidentified) -> Self {
        let size_bound = match why {
            Unidentified::Budget { bound, .. } => Some(bound),
            Unidentified::NoConsensus { best, .. } | Unidentified::Mirrored { best } => Some(best),
            Unidentified::TooFew { with_candidates, .. } => Some(with_candidates),
        };
        Self {
            optimal: !matches!(why, Unidentified::Budget { .. }),
            outcome: Outcome::Unidentified(why.into()),
            identified: Vec::new(),
            runner_up: None,
            size_bound,
            expected_chance_sets: None,
            tests: None,
        }
    }
}

/// The alert limit is at most this share of the model's diameter.
const ALERT_SHARE: f64 = 0.05;
/// One pair in so many may be left out.
const EXCLUDABLE: usize = 5;

/// A set with its pose.
struct Hypothesis {
    pairs: Vec<Correspondence>,
    pose: Transform<Object, Camera>,
    likelihood: Likelihood,
    score: f64,
}

impl Hypothesis {
    fn alternative(self) -> Alternative {
        Alternative { object_from_camera: self.pose, pairs: self.pairs, score: self.score }
    }
}

/// Why a hypothesis falls.
enum Fallen {
    Refused(Refusal),
    Degenerate(Degenerate),
}

struct Judge<'a> {
    problem: &'a Problem<'a>,
    prior: Option<&'a Prior>,
    solver: &'a dyn Solver,
    acceptance: &'a Acceptance,
    alert_limit: f64,
    rig: Option<&'a StereoRig>,
}

impl Judge<'_> {
    fn size(&self, pairs: &[Correspondence]) -> Result<(), Refusal> {
        let needed = self.acceptance.least_points.max(self.solver.minimum());
        match pairs.len() {
            enough if enough >= needed => Ok(()),
            few => Err(Refusal::TooFew { found: few, needed }),
        }
    }

    fn chance(&self, pairs: &[Correspondence]) -> Result<(), Refusal> {
        let (expected, budget) = (expected_sets(self.problem, pairs), self.acceptance.chance_budget);
        // Written so that a NaN is refused too.
        if expected <= budget { Ok(()) } else { Err(Refusal::Chance { size: pairs.len(), expected, budget }) }
    }

    /// The pose of the set and of its rivals: the only one that passes, several, or none.
    fn poses(&self, found: &Identification) -> (Outcome, Option<Alternative>) {
        let mut passed: Vec<Hypothesis> = Vec::new();
        let mut refused: Vec<Hypothesis> = Vec::new();
        let mut first_fall = None;
        for pairs in std::iter::once(&found.pairs).chain(&found.rivals) {
            let fall = match self.hypothesis(pairs) {
                Ok(hypothesis) => match self.believable(&hypothesis) {
                    Ok(()) => {
                        passed.push(hypothesis);
                        continue;
                    }
                    Err(fall) => {
                        refused.push(hypothesis);
                        fall
                    }
                },
                Err(degenerate) => Fallen::Degenerate(degenerate),
            };
            first_fall.get_or_insert(fall);
        }
        if passed.is_empty() {
            passed =
                std::iter::once(&found.pairs).chain(&found.rivals).flat_map(|pairs| self.excluding(pairs)).collect();
        }
        let by_score = |a: &Hypothesis, b: &Hypothesis| b.score.total_cmp(&a.score).then_with(|| a.pairs.cmp(&b.pairs));
        passed.sort_by(by_score);
        refused.sort_by(by_score);
        let mut different: Vec<Hypothesis> = Vec::new();
        for hypothesis in passed {
            if different.iter().all(|known| self.apart(&known.pose, &hypothesis.pose)) {
                different.push(hypothesis);
            }
        }
        if different.len() > 1 {
            return (Outcome::Ambiguous(different.into_iter().map(Hypothesis::alternative).collect()), None);
        }
        match (different.pop(), first_fall) {
            (Some(best), _) => {
                let runner_up = refused.into_iter().find(|other| self.apart(&best.pose, &other.pose));
                (self.fix(best), runner_up.map(Hypothesis::alternative))
            }
            (None, Some(Fallen::Degenerate(why))) => (Outcome::Degenerate(why), None),
            (None, Some(Fallen::Refused(why))) => (Outcome::Unidentified(why), None),
            (None, None) => unreachable!("every set either passed or fell"),
        }
    }

    fn observations(&self, pairs: &[Correspondence]) -> Observations<'_> {
        Observations::of(pairs, self.problem.model, self.problem.cloud, self.rig)
    }

    fn hypothesis(&self, pairs: &[Correspondence]) -> Result<Hypothesis, Degenerate> {
        let data = self.observations(pairs);
        let pose = self.solver.solve(&data)?;
        let likelihood = likelihood::maximum(&data, &pose);
        let prior = match self.prior {
            Some(Prior { object_from_camera, bound: PriorBound::Gaussian(covariance) }) => {
                let xi = object_from_camera.error_to(&likelihood.pose);
                covariance.matrix.cholesky().map_or(0.0, |c| -0.5 * xi.dot(&c.solve(&xi)))
            }
            _ => 0.0,
        };
        Ok(Hypothesis { pairs: pairs.to_vec(), pose, likelihood, score: likelihood.log + prior })
    }

    /// The set without its worst pairs: as few are left out as make it believable, at most one in five,
    /// so that at least four points bear witness. A pair may agree with the distances of the others
    /// and still be badly measured: a corner before a distant ground, say. Every way of leaving out the
    /// last one that passes is given, so that their poses can contradict each other.
    fn excluding(&self, pairs: &[Correspondence]) -> Vec<Hypothesis> {
        let mut kept = pairs.to_vec();
        for _ in 0..pairs.len() / EXCLUDABLE {
            let fewer = |out: usize| {
                let mut fewer = kept.clone();
                fewer.remove(out);
                self.hypothesis(&fewer).ok()
            };
            let hypotheses: Vec<Hypothesis> = (0..kept.len()).filter_map(fewer).collect();
            let Some(best) = hypotheses.iter().min_by(|a, b| a.likelihood.cost.total_cmp(&b.likelihood.cost)) else {
                break;
            };
            kept.clone_from(&best.pairs);
            if self.size(&kept).and_then(|()| self.chance(&kept)).is_err() {
                break;
            }
            let passed: Vec<Hypothesis> = hypotheses.into_iter().filter(|h| self.believable(h).is_ok()).collect();
            if !passed.is_empty() {
                return passed;
            }
        }
        Vec::new()
    }

    /// Whether residuals, precision and prior let the pose pass.
    fn believable(&self, hypothesis: &Hypothesis) -> Result<(), Fallen> {
        let freedom = 3 * hypothesis.pairs.len() - 6;
        let (chi2, limit) = (hypothesis.likelihood.cost, chi_square(freedom, self.acceptance.confidence));
        // Written so that a NaN is refused too.
        if !(chi2 <= limit) {
            return Err(Fallen::Refused(Refusal::Residuals { chi2, limit }));
        }
        let data = self.observations(&hypothesis.pairs);
        let covariance = self.solver.covariance(&data, &hypothesis.pose).map_err(Fallen::Degenerate)?;
        let (rms, limit) = (self.predicted_rms(hypothesis, &covariance), self.alert_limit);
        if !(2.0 * rms <= limit) {
            return Err(Fallen::Refused(Refusal::Imprecise { rms, limit }));
        }
        let Some(prior) = self.prior else { return Ok(()) };
        let off = match &prior.bound {
            PriorBound::Gaussian(of_prior) => {
                let xi = prior.object_from_camera.error_to(&hypothesis.pose);
                let sum = (of_prior.matrix + covariance.matrix).cholesky();
                let chi2 = sum.map_or(f64::INFINITY, |c| xi.dot(&c.solve(&xi)));
                (chi2 / chi_square(6, self.acceptance.confidence)).sqrt()
            }
            PriorBound::Box(half) => self.off_box(hypothesis, &covariance, &prior.object_from_camera, *half),
        };
        if off <= 1.0 { Ok(()) } else { Err(Fallen::Refused(Refusal::Prior { off })) }
    }

    /// The predicted error of the model points that the pose transfers: root mean square over all of
    /// them, one standard deviation (m).
    fn predicted_rms(&self, hypothesis: &Hypothesis, covariance: &Covariance6<Object, Camera>) -> f64 {
        let camera_from_object = hypothesis.pose.inverse();
        let model = self.problem.model;
        let sum: f64 = model.iter().map(|point| covariance.of_point(&(camera_from_object * point.at)).trace()).sum();
        (sum / model.len() as f64).sqrt()
    }

    /// How far the identified model points, placed by the pose, are from where the prior places them:
    /// the largest step along a camera axis over the half-size and the noise allowed with it.
    fn off_box(
        &self,
        hypothesis: &Hypothesis,
        covariance: &Covariance6<Object, Camera>,
        prior: &Transform<Object, Camera>,
        half: f64,
    ) -> f64 {
        let sigmas = chi_square(1, self.acceptance.confidence).sqrt();
        let (by_pose, by_prior) = (hypothesis.pose.inverse(), prior.inverse());
        let offs = hypothesis.pairs.iter().flat_map(|pair| {
            let at = self.problem.model[pair.model].at;
            let placed = by_pose * at;
            let (step, noise) = (placed - by_prior * at, covariance.of_point(&placed));
            (0..3).map(move |axis| step[axis].abs() / (half + sigmas * noise[(axis, axis)].max(0.0).sqrt()))
        });
        offs.fold(0.0, f64::max)
    }

    /// Whether two poses are different answers.
    fn apart(&self, a: &Transform<Object, Camera>, b: &Transform<Object, Camera>) -> bool {
        !(rms_apart(self.problem.model, a, b) <= self.alert_limit)
    }

    fn fix(&self, hypothesis: Hypothesis) -> Outcome {
        let data = self.observations(&hypothesis.pairs);
        match self.solver.covariance(&data, &hypothesis.pose) {
            Ok(covariance) => Outcome::Referenced(Box::new(Reference {
                object_from_camera: hypothesis.pose,
                covariance,
                used: self.solver.used(&data),
                residual_rms: data.residual_rms(&hypothesis.pose),
                score: hypothesis.score,
                pairs: hypothesis.pairs,
            })),
            Err(why) => Outcome::Degenerate(why),
        }
    }
}

/// How far two poses place the model points apart: root mean square over all of them (m).
pub fn rms_apart(model: &[ModelPoint], a: &Transform<Object, Camera>, b: &Transform<Object, Camera>) -> f64 {
    let (a, b) = (a.inverse(), b.inverse());
    let sum: f64 = model.iter().map(|point| (a * point.at - b * point.at).norm_squared()).sum();
    (sum / model.len().max(1) as f64).sqrt()
}
