//! The results, a row a trial.

use std::collections::BTreeMap;

use rayon::prelude::*;
use seafix_evaluation::quantile;
use seafix_log::{Axis, Outcome, Region, SharedStages, Totals};

use crate::{
    Field, paired,
    run::{AttemptRow, Run, Trial},
};

/// The results of a run.
///
/// `{}` prints them as a table for a terminal.
#[derive(Debug, Clone, PartialEq)]
pub struct RunSummary {
    /// The run's name.
    pub run: String,
    /// The question it asks.
    pub question: String,
    /// One row a trial, in the order of their names.
    pub rows: Vec<Row>,
    /// Logs that were saved of ones that were not whole, and what they lack.
    pub lacking: Vec<String>,
}

/// The results of one trial. Found, refused and wrong add up to attempted.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The trial's name.
    pub trial: String,
    /// Its values on the axes of the experiment.
    pub axes: Vec<Axis>,
    /// Name of the search.
    pub search: String,
    /// Name of the solver.
    pub solver: String,
    /// Frames of the trial.
    pub frames: usize,
    /// Frames with a fix of at least one target.
    pub fix_frames: usize,
    /// Frames with a wrong fix of at least one target.
    pub wrong_frames: usize,
    /// Attempts: one a frame and target that the prior puts in view.
    pub attempted: usize,
    /// Fixes that are not known to be wrong.
    pub found: usize,
    /// Attempts that gave no fix.
    pub refused: usize,
    /// Fixes beyond the alert limit.
    pub wrong: usize,
    /// Fixes that no truth could judge; they count as found.
    pub unjudged: usize,
    /// Why attempts were refused, and how often.
    pub reasons: BTreeMap<String, usize>,
    /// m1 of the fixes found: RMS of C·H − P over the identified points (m).
    pub fit: Option<Distribution>,
    /// m1 over the identified points that the solver did not use (m).
    pub fit_unused: Option<Distribution>,
    /// m2 of the fixes found: RMS error of the transferred model points (m).
    pub tre: Option<Distribution>,
    /// Median of m2 over all attempts, refused and wrong ones as infinitely far off (m).
    pub tre_of_all: Option<f64>,
    /// m3 of the fixes found, position of the left camera (m).
    pub position_error: Option<Distribution>,
    /// m3 of the fixes found, attitude (rad).
    pub attitude_error: Option<Distribution>,
    /// Mean of the normalised error squared of the fixes found; 6 for an honest covariance.
    pub nees_mean: Option<f64>,
    /// How many fixes that mean is over.
    pub nees_count: usize,
    /// Identified points of the fixes found.
    pub identified: Option<Distribution>,
    /// How many fixes are in each region of the Stanford diagram, in the order of [`Region::ALL`]; `None` where the log does
    /// not say of all frames, or truth is unknown.
    pub regions: Option<[usize; Region::ALL.len()]>,
    /// Root mean squares over all fixes that truth could judge, wrong ones included, beside their bounds.
    pub limits: Option<Limits>,
    /// Measured standard deviation of the disparity of correctly identified points (px).
    pub disparity_sigma: Option<f64>,
    /// Median times of the stages.
    pub times: StageTimeSummary,
    /// The stages that other trials share: their times are those of one computation for all.
    pub shared: SharedStages,
    /// The 95 % quantile of the time from the images to the answer (ms).
    pub total_p95: Option<f64>,
}

/// Root mean square errors and the Cramér–Rao bound on them, over all fixes of a trial, logged or not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// How many fixes.
    pub count: u64,
    /// Of m2 (m), and its bound.
    pub tre: [f64; 2],
    /// Of the position (m), and its bound.
    pub position: [f64; 2],
    /// Mean of the normalised error squared.
    pub nees: f64,
    /// Share of the fixes whose normalised error squared is below the 95 % quantile of χ²₆.
    pub coverage: f64,
}

impl Limits {
    /// Those of totals that have a bound for every fix.
    fn of(totals: &Totals) -> Option<Self> {
        (totals.bounded > 0 && totals.bounded == totals.judged).then(|| {
            let rms = |squares: f64| (squares / totals.judged as f64).sqrt();
            let nees = totals.nees_count as f64;
            Self {
                count: totals.judged,
                tre: [rms(totals.tre_squares), rms(totals.tre_crlb_squares)],
                position: [rms(totals.position_squares), rms(totals.position_crlb_squares)],
                nees: totals.nees_sum / nees,
                coverage: totals.nees_within as f64 / nees,
            }
        })
    }
}

/// How a quantity spreads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distribution {
    /// How many values there are.
    pub count: usize,
    /// The 5 % quantile.
    pub p5: f64,
    /// The median.
    pub median: f64,
    /// The 95 % quantile.
    pub p95: f64,
}

impl Distribution {
    /// The spread of `values`; `None` without any.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.into_iter().collect();
        if values.is_empty() {
            return None;
        }
        let count = values.len();
        let [p5, median, p95] = [0.05, 0.5, 0.95].map(|p| quantile(&mut values, p));
        Some(Self { count, p5, median, p95 })
    }
}

/// Median times (ms): of the first seven a frame, of the others an attempt; `None` where a stage did not run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageTimeSummary {
    /// Detection, both images.
    pub detect_ms: Option<f64>,
    /// Location of the exact corners, both images.
    pub locate_ms: Option<f64>,
    /// Description, both images.
    pub describe_ms: Option<f64>,
    /// Matching.
    pub match_ms: Option<f64>,
    /// Alignment between the views.
    pub refine_ms: Option<f64>,
    /// Triangulation.
    pub triangulate_ms: Option<f64>,
    /// Odometry.
    pub odometry_ms: Option<f64>,
    /// Choosing candidates.
    pub candidates_ms: Option<f64>,
    /// Search.
    pub search_ms: Option<f64>,
    /// Solve.
    pub solve_ms: Option<f64>,
    /// From the images to the answer.
    pub total_ms: Option<f64>,
}

impl StageTimeSummary {
    /// The stages and their times, in the order of the method.
    pub fn stages(&self) -> [(&'static str, Option<f64>); 11] {
        [
            ("detect", self.detect_ms),
            ("locate", self.locate_ms),
            ("describe", self.describe_ms),
            ("match", self.match_ms),
            ("refine", self.refine_ms),
            ("triangulate", self.triangulate_ms),
            ("odometry", self.odometry_ms),
            ("candidates", self.candidates_ms),
            ("search", self.search_ms),
            ("solve", self.solve_ms),
            ("total", self.total_ms),
        ]
    }
}

impl RunSummary {
    /// The results of `run`.
    pub(crate) fn of(run: &Run) -> Self {
        let header = run.header();
        Self {
            run: header.run.clone(),
            question: header.question.clone(),
            rows: run.trials.par_iter().map(Row::of).collect(),
            lacking: run.trials.iter().filter_map(Trial::lacking).collect(),
        }
    }

    /// A sentence on the durations of stages that trials share; `None` where every duration is a trial's own, or none was
    /// logged.
    pub(crate) fn shared_times(&self) -> Option<String> {
        let any = |is_shared: fn(&SharedStages) -> bool| self.rows.iter().any(|row| is_shared(&row.shared));
        let stages = [
            ("the front end (detect to triangulate)", any(|shared| shared.front_end)),
            ("candidates and search", any(|shared| shared.search)),
            ("odometry", any(|shared| shared.odometry)),
        ];
        let shared: Vec<&str> =
            stages.into_iter().filter(|(_, is_shared)| *is_shared).map(|(stage, _)| stage).collect();
        (!shared.is_empty()).then(|| {
            format!(
                "Shared stages: {}. Each was computed once for all trials with the same settings, and its time stands in each of them; --separate measures every trial alone.",
                shared.join("; ")
            )
        })
    }

    /// What a figure calls a trial: what varies, or the method where nothing does.
    pub(crate) fn name(run: &Run, trial: &Trial) -> String {
        let members: Vec<usize> = (0..run.trials.len()).collect();
        let place = run.trials.iter().position(|other| std::ptr::eq(other, trial)).unwrap_or(0);
        paired::names(run, &members).1.swap_remove(place)
    }
}

impl Row {
    fn of(trial: &Trial) -> Self {
        let [search, solver] = trial.method();
        let mut row = Self {
            trial: trial.header.trial.clone(),
            axes: trial.header.axes.clone(),
            search,
            solver,
            frames: trial.sample().count(),
            fix_frames: 0,
            wrong_frames: 0,
            attempted: 0,
            found: 0,
            refused: 0,
            wrong: 0,
            unjudged: 0,
            reasons: BTreeMap::new(),
            fit: None,
            fit_unused: None,
            tre: None,
            tre_of_all: None,
            position_error: None,
            attitude_error: None,
            nees_mean: None,
            nees_count: 0,
            identified: None,
            regions: regions(trial),
            limits: trial.totals.as_ref().and_then(Limits::of),
            disparity_sigma: Some(trial.disparity)
                .filter(|(_, n)| *n > 0)
                .map(|(squares, n)| (squares / n as f64).sqrt()),
            times: times(trial),
            shared: trial.shared,
            total_p95: Distribution::of(trial.attempts().filter_map(|(_, row)| row.get(Field::TotalTime)))
                .map(|s| s.p95),
        };
        for frame in trial.sample() {
            row.fix_frames += usize::from(trial.attempts_of(frame).any(|row| row.found() || row.wrong()));
            row.wrong_frames += usize::from(trial.attempts_of(frame).any(AttemptRow::wrong));
        }
        let mut found: Vec<&AttemptRow> = Vec::new();
        for (_, attempt) in trial.attempts() {
            row.attempted += 1;
            if attempt.found() {
                row.found += 1;
                row.unjudged += usize::from(attempt.wrong.is_none());
                found.push(attempt);
            } else if attempt.wrong() {
                row.wrong += 1;
            } else {
                row.refused += 1;
                *row.reasons.entry(trial.reason(attempt).to_owned()).or_default() += 1;
            }
        }
        let values = |field: Field| found.iter().filter_map(move |fix| fix.get(field));
        let spread = |field: Field| Distribution::of(values(field));
        row.fit = spread(Field::Fit);
        row.fit_unused = spread(Field::FitUnused);
        row.tre = spread(Field::Tre);
        row.position_error = spread(Field::Position);
        row.attitude_error = spread(Field::Attitude);
        row.identified = spread(Field::Identified);
        let nees: Vec<f64> = values(Field::Nees).collect();
        row.nees_count = nees.len();
        row.nees_mean = (!nees.is_empty()).then(|| nees.iter().sum::<f64>() / nees.len() as f64);
        if row.tre.is_some() && row.unjudged == 0 {
            // The lower middle order statistic: between a number and infinity there is no mean.
            let mut all_tre: Vec<f64> = trial.attempts().map(|(_, row)| row.error_or_failure(Field::Tre)).collect();
            all_tre.sort_by(f64::total_cmp);
            row.tre_of_all = all_tre.get((all_tre.len().max(1) - 1) / 2).copied();
        }
        if let Some(totals) = &trial.totals {
            row.count(totals);
        }
        row
    }

    /// Takes the counts of all frames in place of those of the sample.
    fn count(&mut self, totals: &Totals) {
        let full = |count: u64| count as usize;
        (self.frames, self.attempted) = (full(totals.frames), full(totals.attempted));
        (self.fix_frames, self.wrong_frames) = (full(totals.fix_frames), full(totals.wrong_frames));
        (self.found, self.wrong, self.unjudged) = (full(totals.found), full(totals.wrong), full(totals.unjudged));
        self.refused = full(totals.refused());
        self.reasons = totals.reasons.iter().map(|(reason, &count)| (reason.clone(), full(count))).collect();
    }

    /// Search and solver, as tables name the method.
    pub fn method(&self) -> String {
        format!("{} + {}", self.search, self.solver)
    }

    /// The axes that the method does not say already.
    pub(crate) fn conditions(&self) -> impl Iterator<Item = &Axis> {
        self.axes.iter().filter(|axis| !matches!(crate::format::short(&axis.key), "search" | "solver"))
    }
}

/// As the totals count them, or the frames where all are logged.
fn regions(trial: &Trial) -> Option<[usize; Region::ALL.len()]> {
    if let Some(counts) = trial.totals.as_ref().and_then(|totals| totals.regions) {
        return Some(counts.map(|count| count as usize));
    }
    let mut counts = [0; Region::ALL.len()];
    for (_, row) in trial.attempts().filter(|(_, row)| row.outcome == Outcome::Fix) {
        if let (Some(error), Some(limit)) = (row.get(Field::Position), row.get(Field::Limit)) {
            counts[Region::of(error, row.get(Field::Level), limit) as usize] += 1;
        }
    }
    (trial.every() == 1 && counts.iter().any(|count| *count > 0)).then_some(counts)
}

fn times(trial: &Trial) -> StageTimeSummary {
    let median = |values: Vec<f64>| Distribution::of(values).map(|spread| spread.median);
    let frames =
        |stage: usize| median(trial.sample().map(|frame| frame.times[stage]).filter(|time| !time.is_nan()).collect());
    let attempts = |field: Field| median(trial.attempts().filter_map(|(_, row)| row.get(field)).collect());
    StageTimeSummary {
        detect_ms: frames(0),
        locate_ms: frames(1),
        describe_ms: frames(2),
        match_ms: frames(3),
        refine_ms: frames(4),
        triangulate_ms: frames(5),
        odometry_ms: frames(6),
        candidates_ms: attempts(Field::CandidatesTime),
        search_ms: attempts(Field::SearchTime),
        solve_ms: attempts(Field::SolveTime),
        total_ms: attempts(Field::TotalTime),
    }
}
