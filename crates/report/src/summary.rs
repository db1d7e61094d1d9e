//! The summary of a run: one row of results for every trial.

use std::collections::BTreeMap;

use rayon::prelude::*;
use seafix_evaluation::quantile;
use seafix_log::{Axis, Outcome, Region, SharedStages, Totals};

use crate::{
    field::Field,
    format, paired,
    published::Published,
    rejections,
    run::{AttemptRow, Run, Trial},
};

/// The results of a run; [`Display`](std::fmt::Display) prints a table for a terminal.
#[derive(Debug, Clone, PartialEq)]
pub struct RunSummary {
    /// The name of the run.
    pub run: String,
    /// The question of the experiment.
    pub question: String,
    /// The sentences on published figures that the experiment states for comparison.
    pub published: Vec<String>,
    /// The sentence on the most common reason of attempts without a fix; `None` if every attempt has one.
    pub rejections: Option<String>,
    /// The results of the trials, sorted by trial name.
    pub rows: Vec<Row>,
    /// The sentences on logs that were recovered from incomplete ones.
    pub lacking: Vec<String>,
}

/// The results of one trial; `found`, `rejected` and `wrong` add up to `attempted`.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The name of the trial.
    pub trial: String,
    /// The values of the trial on the axes of the experiment.
    pub axes: Vec<Axis>,
    /// The name of the search.
    pub search: String,
    /// The name of the solver.
    pub solver: String,
    /// The number of frames.
    pub frames: usize,
    /// The number of frames with a fix on at least one target.
    pub fix_frames: usize,
    /// The number of frames with a wrong fix on at least one target.
    pub wrong_frames: usize,
    /// The number of attempts, one for every frame and target that the prior puts in view.
    pub attempted: usize,
    /// The number of fixes that are not known to be wrong.
    pub found: usize,
    /// The number of rejected attempts, those without a fix.
    pub rejected: usize,
    /// The number of wrong fixes, those with a TRE beyond the alert limit.
    pub wrong: usize,
    /// The number of fixes without ground truth; they count in `found`.
    pub unjudged: usize,
    /// The number of rejected attempts for each reason.
    pub reasons: BTreeMap<String, usize>,
    /// The number of logged frames without an attempt for each reason.
    pub idle: BTreeMap<String, usize>,
    /// The fit RMS (m) of the fixes that are not wrong.
    ///
    /// It is the RMS of C·H − P over the identified points.
    pub fit: Option<Distribution>,
    /// The fit RMS (m) over points that the solver did not use, of the fixes that are not wrong.
    pub fit_unused: Option<Distribution>,
    /// The target registration error (TRE, m) of the fixes that are not wrong.
    ///
    /// It is the RMS error over all model points of the target.
    pub tre: Option<Distribution>,
    /// The median TRE over all attempts (m), with rejected attempts and wrong fixes counted as infinite.
    pub tre_of_all: Option<f64>,
    /// The position error of the left camera (m), of the fixes that are not wrong.
    pub position_error: Option<Distribution>,
    /// The attitude error (rad), of the fixes that are not wrong.
    pub attitude_error: Option<Distribution>,
    /// The mean NEES of the fixes that are not wrong; 6 for a consistent covariance.
    pub nees_mean: Option<f64>,
    /// The number of fixes in the mean NEES.
    pub nees_count: usize,
    /// The number of identified points of the fixes that are not wrong.
    pub identified: Option<Distribution>,
    /// The number of fixes in each region of the Stanford diagram, in the order of [`Region::ALL`].
    ///
    /// `None` without ground truth, or for a decimated log without these totals.
    pub regions: Option<[usize; Region::ALL.len()]>,
    /// The RMS errors and Cramér–Rao bounds over all fixes with ground truth, wrong ones included.
    pub limits: Option<Limits>,
    /// The measured standard deviation of the disparity of correctly identified points (px).
    pub disparity_sigma: Option<f64>,
    /// The median times of the stages.
    pub times: StageTimeSummary,
    /// The stages shared with other trials, whose times are those of one common computation.
    pub shared: SharedStages,
    /// The 95 % quantile of the time from the images to the outcome (ms).
    pub total_p95: Option<f64>,
}

/// The RMS errors and their Cramér–Rao bounds over all fixes of a trial, logged or not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// The number of fixes.
    pub count: u64,
    /// The RMS TRE and its bound (m).
    pub tre: [f64; 2],
    /// The RMS position error and its bound (m).
    pub position: [f64; 2],
    /// The mean NEES.
    pub nees: f64,
    /// The fraction of the fixes whose NEES is below the 95 % quantile of χ²₆.
    pub coverage: f64,
}

impl Limits {
    /// The values of totals in which every fix has a bound; `None` for others.
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

/// The quantiles of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distribution {
    /// The number of values.
    pub count: usize,
    /// The 5 % quantile.
    pub p5: f64,
    /// The median.
    pub median: f64,
    /// The 95 % quantile.
    pub p95: f64,
}

impl Distribution {
    /// The quantiles of `values`; `None` without values.
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

/// The median times of the stages (ms); `None` for a stage that did not run.
///
/// Times of the first seven stages are per frame, the others per attempt.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageTimeSummary {
    /// The detection of key points in both images (ms).
    pub detect_ms: Option<f64>,
    /// The sub-pixel location of key points in both images (ms).
    pub locate_ms: Option<f64>,
    /// The description of key points in both images (ms).
    pub describe_ms: Option<f64>,
    /// The stereo matching (ms).
    pub match_ms: Option<f64>,
    /// The refinement of matches between the views (ms).
    pub refine_ms: Option<f64>,
    /// The triangulation (ms).
    pub triangulate_ms: Option<f64>,
    /// The odometry (ms).
    pub odometry_ms: Option<f64>,
    /// The selection of candidates (ms).
    pub candidates_ms: Option<f64>,
    /// The search (ms).
    pub search_ms: Option<f64>,
    /// The solver (ms).
    pub solve_ms: Option<f64>,
    /// The time from the images to the outcome (ms).
    pub total_ms: Option<f64>,
}

impl StageTimeSummary {
    /// The names and times of the stages, in the order of the pipeline.
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
        let rows: Vec<Row> = run.trials.par_iter().map(Row::of).collect();
        Self {
            run: header.run.clone(),
            question: header.question.clone(),
            published: Published::of(run).iter().map(Published::sentence).collect(),
            rejections: {
                let total = |of: fn(&Row) -> usize| rows.iter().map(of).sum::<usize>();
                let counts = [total(|row| row.attempted), total(|row| row.rejected), total(|row| row.frames)];
                let reasons = rows.iter().map(|row| &row.reasons).collect();
                rejections::sentence(run, counts, [reasons, rows.iter().map(|row| &row.idle).collect()])
            },
            rows,
            lacking: run.trials.iter().filter_map(Trial::lacking).collect(),
        }
    }

    /// Whether any trial has Cramér–Rao bounds.
    pub(crate) fn has_limits(&self) -> bool {
        self.rows.iter().any(|row| row.limits.is_some())
    }

    /// A sentence on stages shared by several trials; `None` without shared stages.
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
                "Shared stages: {}. Each was computed once for all trials with the same settings, and each of these trials has its time; --separate measures every trial alone.",
                shared.join("; ")
            )
        })
    }

    /// The name of a trial in figures: its varying values, or its method if nothing varies.
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
            rejected: 0,
            wrong: 0,
            unjudged: 0,
            reasons: BTreeMap::new(),
            idle: BTreeMap::new(),
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
            for without in trial.rows_of(frame).filter(|row| !row.is_attempt()) {
                *row.idle.entry(trial.reason(without).to_owned()).or_default() += 1;
            }
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
                row.rejected += 1;
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
            // The lower median, because the mean of a number and infinity would be infinite.
            let mut all_tre: Vec<f64> = trial.attempts().map(|(_, row)| row.error_or_failure(Field::Tre)).collect();
            all_tre.sort_by(f64::total_cmp);
            row.tre_of_all = all_tre.get((all_tre.len().max(1) - 1) / 2).copied();
        }
        if let Some(totals) = &trial.totals {
            row.count(totals);
        }
        row
    }

    /// Replaces the counts of the sample by those of all frames.
    fn count(&mut self, totals: &Totals) {
        let full = |count: u64| count as usize;
        (self.frames, self.attempted) = (full(totals.frames), full(totals.attempted));
        (self.fix_frames, self.wrong_frames) = (full(totals.fix_frames), full(totals.wrong_frames));
        (self.found, self.wrong, self.unjudged) = (full(totals.found), full(totals.wrong), full(totals.unjudged));
        self.rejected = full(totals.rejected());
        self.reasons = totals.reasons.iter().map(|(reason, &count)| (reason.clone(), full(count))).collect();
    }

    /// The name of the method in tables: search and solver.
    pub fn method(&self) -> String {
        format!("{} + {}", self.search, self.solver)
    }

    /// The axes other than search and solver, which the method names already.
    pub(crate) fn conditions(&self) -> impl Iterator<Item = &Axis> {
        self.axes.iter().filter(|axis| !matches!(format::short(&axis.key), "search" | "solver"))
    }
}

/// The counts of the regions from the totals, or from the frames of a complete log.
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
