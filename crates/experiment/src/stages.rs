//! From a sight to fixes: the method, one line a stage, in the paper's order.

use std::time::Instant;

use rand::Rng;
use seafix_geometry::{MeasuredPoint, StereoRig};
use seafix_log::{FrameTimes, TargetTimes};
use seafix_navigation::Share;
use seafix_referencing::{
    Candidates, Correspondence, Degenerate, Gathered, ModelPoint, Observations, Outcome, Prior, PriorBound, Problem,
    Reference, Search, Solver, Target, Tolerance, candidates, judge, judge_named, problem_file::CoherenceProblem,
    until_found,
};
use seafix_vision::{FrontEnd, Keypoint, Look};

use crate::{
    Pipeline,
    source::{Eyes, Sight, Told},
};

/// A pipeline, built.
#[derive(Debug)]
pub struct Stages {
    front_end: FrontEnd,
    search: Box<dyn Search>,
    solver: Box<dyn Solver>,
    settings: Pipeline,
}

/// Everything the pipeline made of one sight; nothing, where none was to be made.
#[derive(Debug, Default)]
pub struct Sighting {
    /// Key points of the left image.
    pub keypoints: Vec<Keypoint>,
    /// The cloud.
    pub cloud: Vec<MeasuredPoint>,
    /// One attempt for each target in view.
    pub attempts: Vec<Attempt>,
    /// What a joint fix takes of objects that were not fixed by themselves.
    pub gathered: Gathered,
    /// Times of the common stages.
    pub times: FrameTimes,
}

/// What came of one target.
#[derive(Debug)]
pub struct Attempt {
    /// Index among the site's targets.
    pub target: usize,
    /// The shells' content.
    pub candidates: Candidates,
    /// The answer.
    pub answer: seafix_referencing::Attempt,
    /// What became of the joint fix that was asked for.
    pub joint: Option<String>,
    /// Times of this target's stages.
    pub times: TargetTimes,
    started: Instant,
}

impl Attempt {
    /// `times` (ms) are those of candidates, search and solution.
    fn new(
        target: usize,
        candidates: Candidates,
        answer: seafix_referencing::Attempt,
        [candidates_ms, search_ms, solve_ms]: [Option<f64>; 3],
        started: Instant,
    ) -> Self {
        let times = TargetTimes { candidates_ms, search_ms, solve_ms, total_ms: None };
        Self { target, candidates, answer, joint: None, times, started }
    }
}

impl Stages {
    pub(crate) fn new(
        front_end: FrontEnd,
        search: Box<dyn Search>,
        solver: Box<dyn Solver>,
        settings: Pipeline,
    ) -> Self {
        Self { front_end, search, solver, settings }
    }

    /// Whether its solver works on pixels, and on nothing else.
    pub fn needs_pixels(&self) -> bool {
        self.solver.needs_pixels()
    }

    /// The settings it was built from.
    pub fn settings(&self) -> &Pipeline {
        &self.settings
    }

    /// The way from one sight to fixes, in the paper's order: key points, matches, cloud; then for
    /// each target in view candidates (Stage 1), the search (Stage 2) and the solution.
    pub fn reference(&self, sight: &Sight, targets: &[Target], rig: &StereoRig, rng: &mut dyn Rng) -> Sighting {
        self.reference_from(sight, targets, &sight.rough(targets), rig, rng)
    }

    /// The same from what is known before of the pose relative to each target.
    pub(crate) fn reference_from(
        &self,
        sight: &Sight,
        targets: &[Target],
        priors: &[Option<Prior>],
        rig: &StereoRig,
        rng: &mut dyn Rng,
    ) -> Sighting {
        let start = Instant::now();
        let (keypoints, cloud, times) = self.cloud(&sight.eyes, rig);
        let common = milliseconds(start);
        let attempts = targets
            .iter()
            .zip(priors)
            .enumerate()
            .filter_map(|(index, (target, prior))| {
                let prior = prior.as_ref();
                let mut attempt = match &sight.told {
                    Told::Problem(problem) => self.answer(index, target, problem, rng),
                    Told::Names(names) => self.named(index, target, &cloud, names, prior, rig)?,
                    Told::Nothing => {
                        self.attempt(index, target, &cloud, prior, &in_view(target, prior, rig)?, rig, rng)
                    }
                };
                attempt.times.total_ms = Some(common + milliseconds(attempt.started));
                Some(attempt)
            })
            .collect();
        Sighting { keypoints, cloud, attempts, gathered: Gathered::default(), times }
    }

    /// Seeks once more, from other priors, what was not found.
    pub(crate) fn again(
        &self,
        sighting: &mut Sighting,
        sight: &Sight,
        targets: &[Target],
        priors: &[Option<Prior>],
        rig: &StereoRig,
        rng: &mut dyn Rng,
    ) {
        for attempt in &mut sighting.attempts {
            let (index, prior) = (attempt.target, priors[attempt.target].as_ref());
            if matches!(attempt.answer.outcome, Outcome::Referenced(_)) || prior.is_none() {
                continue;
            }
            let (target, cloud) = (&targets[index], &sighting.cloud);
            let again = match &sight.told {
                Told::Names(names) => self.named(index, target, cloud, names, prior, rig),
                _ => in_view(target, prior, rig)
                    .map(|in_view| self.attempt(index, target, cloud, prior, &in_view, rig, rng)),
            };
            let Some(mut other) = again else { continue };
            if matches!(other.answer.outcome, Outcome::Referenced(_)) {
                let spent = milliseconds(other.started);
                other.times.total_ms = attempt.times.total_ms.map(|before| before + spent);
                *attempt = other;
            }
        }
    }

    /// What a fix owes to the errors of its model: for each point that it rests on, by its place in the model.
    pub(crate) fn model_errors(
        &self,
        fix: &Reference,
        target: &Target,
        cloud: &[MeasuredPoint],
        rig: &StereoRig,
    ) -> Result<Vec<(usize, Share)>, Degenerate> {
        let data = Observations::of(&fix.pairs, &target.points, cloud, Some(rig));
        let shares = self.solver.model_errors(&data, &fix.object_from_camera)?;
        Ok(fix.pairs.iter().map(|pair| pair.model).zip(shares).collect())
    }

    /// Whether enough of `target` should be in view for a fix, by what is known of the pose; without that it may be.
    pub(crate) fn shows(target: &Target, prior: &Option<Prior>, rig: &StereoRig) -> bool {
        in_view(target, prior.as_ref(), rig).is_some()
    }

    fn cloud(&self, eyes: &Eyes, rig: &StereoRig) -> (Vec<Keypoint>, Vec<MeasuredPoint>, FrameTimes) {
        let (left, right) = match eyes {
            Eyes::Points(cloud) => return (Vec::new(), cloud.clone(), FrameTimes::default()),
            Eyes::Pair(left, right) => (left, right),
        };
        // Frames are worked on side by side: within one, a single thread keeps the times honest.
        let mut look = Look::default();
        self.front_end.look(left, right, rig, &mut look);
        let times = FrameTimes {
            detect_ms: Some(look.times.filter_ms + look.times.detect_ms),
            locate_ms: Some(look.times.locate_ms),
            describe_ms: Some(look.times.describe_ms),
            match_ms: Some(look.times.match_ms),
            refine_ms: Some(look.times.refine_ms),
            triangulate_ms: Some(look.times.triangulate_ms),
            odometry_ms: None,
        };
        (look.keypoints()[0].to_vec(), look.cloud, times)
    }

    #[expect(clippy::too_many_arguments, reason = "one call site; each is a different thing")]
    fn attempt(
        &self,
        index: usize,
        target: &Target,
        cloud: &[MeasuredPoint],
        prior: Option<&Prior>,
        in_view: &[bool],
        rig: &StereoRig,
        rng: &mut dyn Rng,
    ) -> Attempt {
        let started = Instant::now();
        let Pipeline { gate, tolerance, acceptance, widen, .. } = &self.settings;
        let points = &target.points;
        let mut times = [0.0; 3];
        let mut seek = |prior: Option<&Prior>, in_view: &[bool]| {
            let (candidates, stage1) = timed(|| candidates(points, cloud, prior, gate, Some(in_view)));
            let problem = Problem { model: points, cloud, candidates: &candidates, tolerance: *tolerance, prior };
            let (found, stage2) = timed(|| self.search.search(&problem, rng));
            let (answer, solution) = timed(|| judge(&problem, found, &*self.solver, acceptance, Some(rig)));
            times.iter_mut().zip([stage1, stage2, solution]).for_each(|(sum, spent)| *sum += spent);
            (candidates, answer)
        };
        let (mut candidates, mut answer) = seek(prior, in_view);
        if *widen {
            let mut wider = Candidates::default();
            answer = until_found(answer, prior, |prior| {
                let in_view = self::in_view(target, prior, rig).unwrap_or_else(|| vec![true; points.len()]);
                let (listed, answer) = seek(prior, &in_view);
                wider = listed;
                answer
            });
            if !matches!(answer.outcome, Outcome::Unidentified(_)) && !wider.lists.is_empty() {
                candidates = wider;
            }
        }
        Attempt::new(index, candidates, answer, times.map(Some), started)
    }

    /// The answer where every point says which one it is; `None` of a target that no point belongs to.
    fn named(
        &self,
        index: usize,
        target: &Target,
        cloud: &[MeasuredPoint],
        names: &[(usize, usize)],
        prior: Option<&Prior>,
        rig: &StereoRig,
    ) -> Option<Attempt> {
        let started = Instant::now();
        let (pairs, stage1) = timed(|| named(names, index, target));
        if pairs.is_empty() {
            return None;
        }
        let places = pairs.iter().map(|pair| (pair.model, pair.cloud));
        let candidates = Candidates::from_pairs(target.points.len(), places);
        let Pipeline { tolerance, acceptance, .. } = &self.settings;
        let problem = Problem { model: &target.points, cloud, candidates: &candidates, tolerance: *tolerance, prior };
        let (answer, solution) = timed(|| judge_named(&problem, pairs, &*self.solver, acceptance, Some(rig)));
        Some(Attempt::new(index, candidates, answer, [Some(stage1), None, Some(solution)], started))
    }

    /// The answer to a problem that states its own candidates, tolerance and rough pose.
    fn answer(&self, index: usize, target: &Target, problem: &CoherenceProblem, rng: &mut dyn Rng) -> Attempt {
        let started = Instant::now();
        let (listed, stage1) = timed(|| problem.candidates());
        let (candidates, refused) = match listed {
            Ok(candidates) => (candidates, None),
            Err(refused) => (Candidates::from_pairs(target.points.len(), []), Some(refused)),
        };
        let (tolerance, prior) = (Tolerance::Fixed(problem.delta), problem.prior.as_ref());
        let posed = Problem { model: &target.points, cloud: &problem.cloud, candidates: &candidates, tolerance, prior };
        let (found, stage2) = timed(|| refused.map_or_else(|| self.search.search(&posed, rng), Err));
        let (answer, solution) = timed(|| judge(&posed, found, &*self.solver, &self.settings.acceptance, None));
        Attempt::new(index, candidates, answer, [Some(stage1), Some(stage2), Some(solution)], started)
    }
}

/// The pairs of points that say which ones they are, in the order of the model: of an object its own, of the site those
/// of all its objects.
fn named(names: &[(usize, usize)], index: usize, target: &Target) -> Vec<Correspondence> {
    let pair = |(cloud, &name)| Some(Correspondence { model: target.place_of(index, name)?, cloud });
    let mut pairs: Vec<Correspondence> = names.iter().enumerate().filter_map(pair).collect();
    pairs.sort_unstable();
    // Of two that say the same the first is believed.
    pairs.dedup_by_key(|pair| pair.model);
    pairs
}

/// Which points of `target` may be in view: predicted in both images, or out of them by no more than
/// three standard deviations of the prediction, and not from behind. `None` when fewer than three are
/// predicted inside, so that no fix is attempted. Without a prior everything may be in view.
fn in_view(target: &Target, prior: Option<&Prior>, rig: &StereoRig) -> Option<Vec<bool>> {
    /// Cosine of the angle between a point's normal and the line of sight below which it shows its back.
    const BACK: f64 = -0.2;
    let Some(prior) = prior else { return Some(vec![true; target.points.len()]) };
    let camera_from_object = prior.object_from_camera.inverse();
    let faces = |point: &ModelPoint| {
        point.normal.is_none_or(|normal| {
            let sight = prior.object_from_camera.translation() - point.at.coords;
            normal.normalize().dot(&sight.normalize()) > BACK
        })
    };
    let inside = |point: &ModelPoint| faces(point) && rig.sees(&(camera_from_object * point.at), 0.0).is_some();
    // Most targets of a large site are nowhere near: that is known before any covariance is.
    if target.points.iter().filter(|point| inside(point)).take(3).count() < 3 {
        return None;
    }
    let focal = rig.left().focal()[0];
    let near = |point: &ModelPoint| {
        let at = camera_from_object * point.at;
        let spread = match &prior.bound {
            PriorBound::Gaussian(covariance) => covariance.of_point(&at).trace().sqrt(),
            PriorBound::Box(half) => *half,
        };
        rig.sees(&at, -3.0 * focal * spread / at.coords.z).is_some()
    };
    Some(target.points.iter().map(|point| inside(point) || faces(point) && near(point)).collect())
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, milliseconds(start))
}

pub(crate) fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
