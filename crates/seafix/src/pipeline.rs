//! The pipeline from a sensor frame to fixes, one function a stage, in the paper's order.

use std::{sync::Arc, time::Instant};

use rand::Rng;
use seafix_geometry::{MeasuredLine, MeasuredPoint, StereoRig};
use seafix_navigation::Sensitivity;
use seafix_referencing::{
    Candidates, Correspondence, Degenerate, Edges, Fix, Gathered, Observations, Outcome, Prior, Problem, Search,
    Solver, Target, Tolerance, candidates, edge_candidates, judge, judge_labelled, problem_file::CoherenceProblem,
    search_with_expanding_gates,
};
use seafix_vision::{CornerView, FrontEnd, FrontEndOutput, LineFrontEnd, LineOutput, Regions};

use crate::{
    frame_result::{Cloud, FrameResult, SearchResult, TargetAttempt, View},
    in_view::{edges_in_view, in_view, regions, visible},
    pipeline_settings::{Attempts, PipelineSettings, UseOfEdges, UseOfPoints},
    sensor_frame::{FrameData, Hints, SensorFrame},
    times::{FrameTimes, milliseconds, timed},
};

/// A pipeline whose components are built and ready.
#[derive(Debug)]
pub struct Pipeline {
    pub(crate) front_end: FrontEnd,
    line_front_end: LineFrontEnd,
    pub(crate) search: Box<dyn Search>,
    pub(crate) solver: Box<dyn Solver>,
    settings: PipelineSettings,
}

impl Pipeline {
    /// A pipeline with these components.
    pub fn new(
        front_end: FrontEnd,
        line_front_end: LineFrontEnd,
        search: Box<dyn Search>,
        solver: Box<dyn Solver>,
        settings: PipelineSettings,
    ) -> Self {
        Self { front_end, line_front_end, search, solver, settings }
    }

    /// Whether the solver requires the points' pixels.
    pub fn needs_pixels(&self) -> bool {
        self.solver.needs_pixels()
    }

    /// The settings that it was built from.
    pub fn settings(&self) -> &PipelineSettings {
        &self.settings
    }

    /// Computes fixes from one sensor frame, in the paper's order: key points, matches, cloud; then for each target in
    /// view the candidates (Stage 1), the search (Stage 2) and the solution.
    pub fn run(
        &self,
        sensor_frame: &SensorFrame,
        targets: &[Target],
        rig: &StereoRig,
        rng: &mut dyn Rng,
    ) -> FrameResult {
        let priors = sensor_frame.target_priors(targets);
        let cloud = &self.cloud(&sensor_frame.frame_data, rig, targets, &self.regions(targets, &[&priors], rig));
        self.fix_from(View { sensor_frame, cloud, targets, rig }, &priors, None, rng)
    }

    /// Computes fixes from a cloud and from a prior pose relative to each target.
    ///
    /// `sought` are results of [`Pipeline::search_all`] for the same view; `None` searches here.
    pub fn fix_from(
        &self,
        view: View<'_>,
        priors: &[Option<Prior>],
        sought: Option<&[Option<SearchResult>]>,
        rng: &mut dyn Rng,
    ) -> FrameResult {
        let attempts = (0..view.targets.len())
            .filter_map(|index| {
                let sought = sought.map(|all| all[index].clone());
                let mut attempt = self.attempt(view, index, priors[index].as_ref(), sought, rng)?;
                attempt.times.total_ms = attempt.times.total_ms.map(|own| view.cloud.total_ms + own);
                Some(attempt)
            })
            .collect();
        let Cloud { keypoints, points, lines, times, .. } = view.cloud;
        let (keypoints, cloud, lines) = (Arc::clone(keypoints), Arc::clone(points), Arc::clone(lines));
        FrameResult { keypoints, cloud, lines, attempts, gathered: Gathered::default(), times: *times }
    }

    /// Repeats the search, with other priors, for the targets without a fix.
    pub fn retry_without_fix(
        &self,
        frame_result: &mut FrameResult,
        view: View<'_>,
        priors: &[Option<Prior>],
        rng: &mut dyn Rng,
    ) {
        for attempt in &mut frame_result.attempts {
            let (index, prior) = (attempt.target, priors[attempt.target].as_ref());
            if matches!(attempt.answer.outcome, Outcome::Fix(_)) || prior.is_none() {
                continue;
            }
            let Some(mut other) = self.attempt(view, index, prior, None, rng) else { continue };
            if matches!(other.answer.outcome, Outcome::Fix(_)) {
                other.times.total_ms = attempt.times.total_ms.zip(other.times.total_ms).map(|(a, b)| a + b);
                *attempt = other;
            }
        }
    }

    /// The sensitivity of a fix to its model errors, for each model point by its index.
    pub fn model_sensitivities(
        &self,
        fix: &Fix,
        target: &Target,
        (cloud, lines): (&[MeasuredPoint], &[MeasuredLine]),
        rig: &StereoRig,
    ) -> Result<Vec<(usize, Sensitivity)>, Degenerate> {
        let data = Observations::of(&fix.pairs, &target.points, cloud, Some(rig));
        let data = data.with_edges(&fix.edges, &target.edges, &target.points, lines);
        let sensitivities = self.solver.model_errors(&data, &fix.object_from_camera)?;
        Ok(fix.pairs.iter().map(|pair| pair.model).zip(sensitivities).collect())
    }

    /// Whether enough of `target` may be in view for a fix; true without a prior.
    pub fn shows(&self, target: &Target, prior: &Option<Prior>, rig: &StereoRig) -> bool {
        self.features(target, prior.as_ref(), rig, false).is_some()
    }

    /// The points and the edges of a target that may be in view; `None` if they are too few for an attempt.
    ///
    /// `has_lines` states whether lines were measured. Edges that do not count are omitted.
    fn features(
        &self,
        target: &Target,
        prior: Option<&Prior>,
        rig: &StereoRig,
        has_lines: bool,
    ) -> Option<[Vec<bool>; 2]> {
        let PipelineSettings { points: uses_points, attempts, .. } = self.settings;
        let points = &target.points;
        let by_model = attempts == Attempts::Model;
        let counts_edges = has_lines || by_model || uses_points == UseOfPoints::Off;
        let edges = if counts_edges { edges_in_view(target, prior, rig) } else { Vec::new() };
        let shown = count(&edges);
        let counts_points = by_model || uses_points == UseOfPoints::On;
        let mask = match in_view(points, prior, rig) {
            Some(mask) if counts_points => mask,
            _ => {
                let mask = prior.map_or_else(|| vec![true; points.len()], |prior| visible(points, prior, rig));
                let seen = if counts_points { count(&mask) } else { 0 };
                // Three edges can show that two of them are right.
                (shown >= 3 || (seen > 0 && shown >= 2)).then_some(mask)?
            }
        };
        Some([mask, edges])
    }

    /// Whether the cloud depends on where the targets are expected.
    pub fn is_guided(&self) -> bool {
        self.front_end.detector.is_guided()
    }

    /// The regions of both images where the points of the targets are expected.
    ///
    /// `priors` holds lists with one prior of each target; the regions of all lists are joined.
    ///
    /// They are empty for a front end that does not use them, and for targets without a prior.
    pub fn regions(&self, targets: &[Target], priors: &[&[Option<Prior>]], rig: &StereoRig) -> [Regions; 2] {
        if !self.is_guided() {
            return [Regions::NONE; 2];
        }
        let known = priors.iter().flat_map(|priors| targets.iter().zip(priors.iter()));
        regions(known.filter_map(|(target, prior)| Some((&target.points[..], prior.as_ref()?))), rig)
    }

    /// The cloud of a frame's measurements: the front end's result, or the given points.
    ///
    /// The `regions` are those where the targets are expected ([`Pipeline::regions`]).
    ///
    /// Straight edges are measured if a target has some, or if corners are made of them (`edge-corners`). A pipeline
    /// without points has no points in its cloud.
    pub fn cloud(&self, frame_data: &FrameData, rig: &StereoRig, targets: &[Target], regions: &[Regions; 2]) -> Cloud {
        let uses_points = self.settings.points == UseOfPoints::On;
        let given = |cloud: &[MeasuredPoint], lines: &[MeasuredLine]| {
            let lines = if self.settings.edges == UseOfEdges::On { lines } else { &[] };
            Cloud::given(if uses_points { cloud } else { &[] }, lines)
        };
        let (left, right) = match frame_data {
            FrameData::Points(cloud) => return given(cloud, &[]),
            FrameData::Features(cloud, lines) => return given(cloud, lines),
            FrameData::Stereo(left, right) => (left, right),
        };
        let start = Instant::now();
        // Frames are processed in parallel. A single thread within a frame keeps the durations comparable.
        let mut output = FrontEndOutput::default();
        match uses_points {
            true => self.front_end.run_guided([left, right], rig, regions, &mut output),
            false => self.front_end.filter_pair([left, right], &mut output),
        }
        let keypoints = output.keypoints()[0].into();
        let mut points = std::mem::take(&mut output.cloud);
        let [l, r] = output.filtered();
        let images = [l.unwrap_or(left), r.unwrap_or(right)];
        let outlines_from = Instant::now();
        if uses_points && self.settings.outline_corners.enabled {
            let ([l, r], [of_l, of_r]) = (output.keypoints(), output.located());
            let view = |image, keypoints, located| CornerView { image, keypoints, located };
            let views = [view(images[0], l, of_l), view(images[1], r, of_r)];
            self.settings.outline_corners.add_to(&mut points, &views, rig, &*self.front_end.triangulator);
        }
        let times = FrameTimes {
            detect_ms: Some(output.times.filter_ms + output.times.detect_ms),
            locate_ms: Some(output.times.locate_ms),
            describe_ms: Some(output.times.describe_ms),
            match_ms: Some(output.times.match_ms + milliseconds(outlines_from)),
            refine_ms: Some(output.times.refine_ms),
            triangulate_ms: Some(output.times.triangulate_ms),
        };
        let identified = self.settings.edges == UseOfEdges::On && targets.iter().any(|target| !target.edges.is_empty());
        let corners = &self.settings.edge_corners;
        let mut measured = LineOutput::default();
        if identified || (corners.enabled && uses_points) {
            self.line_front_end.run(images, rig, &mut measured);
        }
        // An edge serves as itself or by its corners: as both, its errors would count twice.
        if !identified && uses_points {
            let triangulator = &*self.front_end.triangulator;
            corners.add_to(&mut points, measured.segments(), &measured.matches, rig, triangulator);
            measured.lines.clear();
        }
        let lines = measured.lines.into();
        let points = points.into();
        Cloud { keypoints, points, lines, times, total_ms: milliseconds(start) }
    }

    /// Stages 1 and 2 for every target in view, in order.
    pub fn search_all(&self, view: View<'_>, priors: &[Option<Prior>], rng: &mut dyn Rng) -> Vec<Option<SearchResult>> {
        (0..view.targets.len()).map(|index| self.seek(view, index, priors[index].as_ref(), rng)).collect()
    }

    /// Stages 1 and 2 for one target; `None` if it is out of view or if its points are labelled.
    fn seek(&self, view: View<'_>, index: usize, prior: Option<&Prior>, rng: &mut dyn Rng) -> Option<SearchResult> {
        let target = &view.targets[index];
        match &view.sensor_frame.hints {
            Hints::Labels(_) => None,
            Hints::Problem(problem) => Some(self.seek_posed(target, problem, rng)),
            Hints::Nothing => self.seek_near(target, view, prior, false, rng),
        }
    }

    /// The candidates for the points and edges that may be in view, and the search among them.
    ///
    /// `None` if too few may be in view, unless the attempt is `forced`.
    fn seek_near(
        &self,
        target: &Target,
        view: View<'_>,
        prior: Option<&Prior>,
        forced: bool,
        rng: &mut dyn Rng,
    ) -> Option<SearchResult> {
        let PipelineSettings { gate, tolerance, .. } = &self.settings;
        let Cloud { points: cloud, lines, .. } = view.cloud;
        let (points, started) = (&target.points, Instant::now());
        let uses_lines = !lines.is_empty() && !target.edges.is_empty();
        let all = || [vec![true; points.len()], edges_in_view(target, prior, view.rig)];
        let [of_points, of_edges] = match forced && in_view(points, prior, view.rig).is_none() {
            true => all(),
            false => self.features(target, prior, view.rig, uses_lines).or_else(|| forced.then(all))?,
        };
        // Points that the pipeline does not identify have no candidates.
        let of_points = match self.settings.points {
            UseOfPoints::On => of_points,
            UseOfPoints::Off => vec![false; points.len()],
        };
        let candidates = candidates(points, cloud, prior, gate, Some(&of_points));
        let edges = match uses_lines {
            true => edge_candidates(&target.edges, points, lines, prior, gate, Some(&of_edges)),
            false => Vec::new(),
        };
        let stage1 = milliseconds(started);
        let problem = Problem {
            model: points,
            cloud,
            candidates: &candidates,
            tolerance: *tolerance,
            prior,
            edges: edges_of(target, lines, &edges),
        };
        let (found, stage2) = timed(|| self.search.search(&problem, rng));
        Some(SearchResult { candidates, edges, found, spent: [stage1, stage2] })
    }

    /// Stages 1 and 2 of a problem with candidates, tolerance and prior pose of its own.
    fn seek_posed(&self, target: &Target, problem: &CoherenceProblem, rng: &mut dyn Rng) -> SearchResult {
        let none = || Candidates::from_pairs(target.points.len(), []);
        let (listed, stage1) = timed(|| match self.settings.points {
            UseOfPoints::On => problem.candidates(),
            UseOfPoints::Off => Ok(none()),
        });
        let (candidates, rejected) = match listed {
            Ok(candidates) => (candidates, None),
            Err(rejected) => (none(), Some(rejected)),
        };
        let edges = match self.settings.edges {
            UseOfEdges::On => problem.edges.candidates(&target.points, problem.prior.as_ref()),
            UseOfEdges::Off => Vec::new(),
        };
        let posed = self.posed(target, problem, &candidates, &edges);
        let (found, stage2) = timed(|| rejected.map_or_else(|| self.search.search(&posed, rng), Err));
        SearchResult { candidates, edges, found, spent: [stage1, stage2] }
    }

    /// The attempt on one target; `None` if it is out of view. `sought` is an earlier result of Stages 1 and 2.
    fn attempt(
        &self,
        view: View<'_>,
        index: usize,
        prior: Option<&Prior>,
        sought: Option<Option<SearchResult>>,
        rng: &mut dyn Rng,
    ) -> Option<TargetAttempt> {
        if let Hints::Labels(names) = &view.sensor_frame.hints {
            return self.labelled(view, index, names, prior);
        }
        let sought = sought.unwrap_or_else(|| self.seek(view, index, prior, rng))?;
        match &view.sensor_frame.hints {
            Hints::Problem(problem) => Some(self.answer(index, &view.targets[index], problem, sought)),
            _ => Some(self.solve(view, index, prior, sought, rng)),
        }
    }

    /// Solves and tests the result of a search. If it found no pose and `expand-gates` is set, the search is repeated with
    /// larger gates.
    fn solve(
        &self,
        view: View<'_>,
        index: usize,
        prior: Option<&Prior>,
        sought: SearchResult,
        rng: &mut dyn Rng,
    ) -> TargetAttempt {
        let started = Instant::now();
        let View { cloud, targets, rig, .. } = view;
        let (target, lines, cloud) = (&targets[index], &cloud.lines, &cloud.points);
        let PipelineSettings { tolerance, acceptance, expand_gates, .. } = &self.settings;
        let points = &target.points;
        let before: f64 = sought.spent.iter().sum();
        let mut times = [0.0; 3];
        let mut judged = |sought: SearchResult, prior: Option<&Prior>| {
            let SearchResult { candidates, edges, found, spent: [stage1, stage2] } = sought;
            let edges = edges_of(target, lines, &edges);
            let problem =
                Problem { model: points, cloud, candidates: &candidates, tolerance: *tolerance, prior, edges };
            let (answer, solution) = timed(|| judge(&problem, found, &*self.solver, acceptance, Some(rig)));
            times.iter_mut().zip([stage1, stage2, solution]).for_each(|(sum, spent)| *sum += spent);
            (candidates, answer)
        };
        let (mut candidates, mut answer) = judged(sought, prior);
        if *expand_gates {
            let mut wider = Candidates::default();
            answer = search_with_expanding_gates(answer, prior, |prior| {
                let sought = self.seek_near(target, view, prior, true, rng).expect("a forced attempt");
                let (listed, answer) = judged(sought, prior);
                wider = listed;
                answer
            });
            if !matches!(answer.outcome, Outcome::Rejected(_)) && !wider.lists.is_empty() {
                candidates = wider;
            }
        }
        TargetAttempt::new(index, candidates, answer, times.map(Some), before + milliseconds(started))
    }

    /// The answer for labelled points; `None` for a target without any, and for a pipeline without points.
    fn labelled(
        &self,
        view: View<'_>,
        index: usize,
        names: &[(usize, usize)],
        prior: Option<&Prior>,
    ) -> Option<TargetAttempt> {
        let started = Instant::now();
        let target = &view.targets[index];
        let (pairs, stage1) = timed(|| labelled(names, index, target));
        if pairs.is_empty() || self.settings.points == UseOfPoints::Off {
            return None;
        }
        let places = pairs.iter().map(|pair| (pair.model, pair.cloud));
        let candidates = Candidates::from_pairs(target.points.len(), places);
        let PipelineSettings { tolerance, acceptance, .. } = &self.settings;
        let cloud = &view.cloud.points;
        let problem = Problem {
            model: &target.points,
            cloud,
            candidates: &candidates,
            tolerance: *tolerance,
            prior,
            edges: Default::default(),
        };
        let (answer, solution) = timed(|| judge_labelled(&problem, pairs, &*self.solver, acceptance, Some(view.rig)));
        Some(TargetAttempt::new(index, candidates, answer, [Some(stage1), None, Some(solution)], milliseconds(started)))
    }

    /// The answer to a problem with candidates, tolerance and prior pose of its own.
    fn answer(&self, index: usize, target: &Target, problem: &CoherenceProblem, sought: SearchResult) -> TargetAttempt {
        let SearchResult { candidates, edges, found, spent: [stage1, stage2] } = sought;
        let posed = self.posed(target, problem, &candidates, &edges);
        let (answer, solution) = timed(|| judge(&posed, found, &*self.solver, &self.settings.acceptance, None));
        let times = [stage1, stage2, solution];
        TargetAttempt::new(index, candidates, answer, times.map(Some), times.iter().sum())
    }

    /// The input of the search for a problem with tolerance and prior pose of its own.
    fn posed<'a>(
        &self,
        target: &'a Target,
        problem: &'a CoherenceProblem,
        candidates: &'a Candidates,
        edges: &'a [Vec<usize>],
    ) -> Problem<'a> {
        let cloud: &[MeasuredPoint] = match self.settings.points {
            UseOfPoints::On => &problem.cloud,
            UseOfPoints::Off => &[],
        };
        let (tolerance, prior) = (Tolerance::Fixed(problem.delta), problem.prior.as_ref());
        let edges = edges_of(target, &problem.edges.lines, edges);
        Problem { model: &target.points, cloud, candidates, tolerance, prior, edges }
    }
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|shown| **shown).count()
}

/// The edges of a problem; none without candidates.
fn edges_of<'a>(target: &'a Target, lines: &'a [MeasuredLine], candidates: &'a [Vec<usize>]) -> Edges<'a> {
    match candidates.is_empty() {
        true => Edges::default(),
        false => Edges { model: &target.edges, lines, candidates },
    }
}

/// The pairs that the labels of the cloud points state, in the order of the model. A target of one object takes the
/// labels of that object, a target of the site those of all its objects.
fn labelled(names: &[(usize, usize)], index: usize, target: &Target) -> Vec<Correspondence> {
    let pair = |(cloud, &name)| Some(Correspondence { model: target.place_of(index, name)?, cloud });
    let mut pairs: Vec<Correspondence> = names.iter().enumerate().filter_map(pair).collect();
    pairs.sort_unstable();
    // The first of two points with the same label is taken.
    pairs.dedup_by_key(|pair| pair.model);
    pairs
}
