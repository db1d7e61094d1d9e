//! The columns of the table of results: one row a trial, frame and attempted target.

use seafix_log::{FrameRecord, Integrity, NavigationRecord, PointOfInterest, TargetRecord};

/// One row: an attempt, its frame and its trial.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row<'a> {
    trial: &'a str,
    frame: &'a FrameRecord,
    target: &'a TargetRecord,
}

impl<'a> Row<'a> {
    /// The rows of one frame.
    pub(crate) fn of(trial: &'a str, frame: &'a FrameRecord) -> impl Iterator<Item = Self> {
        frame.targets.iter().map(move |target| Self { trial, frame, target })
    }

    fn integrity(&self) -> Option<&'a Integrity> {
        self.target.integrity.as_ref()
    }

    /// Of the points of interest in view the one that is nearest to the line of sight of the left camera.
    fn poi(&self) -> Option<&'a PointOfInterest> {
        let off = |point: &PointOfInterest| point.at[0].hypot(point.at[1]) / point.at[2];
        self.frame.poi.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    fn navigation(&self) -> Option<&'a NavigationRecord> {
        self.frame.navigation.as_deref()
    }
}

/// A value of the table; `None` where it is unknown.
pub(super) enum Cell {
    Text(String),
    Integer(Option<i64>),
    Real(Option<f64>),
    Flag(Option<bool>),
}

/// What the values of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Text,
    Integer,
    Real,
    Flag,
}

/// One column: its name and how a row fills it.
#[derive(Debug)]
pub struct Column {
    /// The name, in the head of both files.
    pub name: &'static str,
    pub(super) kind: Kind,
    pub(super) fill: fn(&Row<'_>) -> Cell,
}

macro_rules! columns {
    ($($kind:ident $name:literal = $fill:expr),* $(,)?) => {
        &[$(Column { name: $name, kind: Kind::$kind, fill: |row| Cell::$kind($fill(row)) }),*]
    };
}

/// The columns, in order. Times are milliseconds, lengths metres, angles radians.
pub static COLUMNS: &[Column] = columns![
    Text "trial" = |r: &Row<'_>| r.trial.to_owned(),
    Integer "frame" = |r: &Row<'_>| Some(r.frame.frame as i64),
    Integer "stamp_ns" = |r: &Row<'_>| Some(r.frame.stamp_ns as i64),
    Text "object" = |r: &Row<'_>| r.target.object.clone(),
    Text "search" = |r: &Row<'_>| r.target.search.clone(),
    Text "solver" = |r: &Row<'_>| r.target.solver.clone(),
    Text "outcome" = |r: &Row<'_>| r.target.outcome.to_string(),
    Text "reason" = |r: &Row<'_>| r.target.reason.clone(),
    Flag "wrong" = |r: &Row<'_>| r.target.evaluation.wrong,
    Flag "wrong_pairs" = |r: &Row<'_>| r.target.evaluation.wrong_pairs,
    Integer "visible" = |r: &Row<'_>| r.target.evaluation.visible.map(i64::from),
    Integer "identified" = |r: &Row<'_>| r.target.evaluation.identified.map(i64::from),
    Integer "correct_pairs" = |r: &Row<'_>| r.target.evaluation.correct_pairs.map(i64::from),
    Real "fit_rms" = |r: &Row<'_>| r.target.evaluation.fit_rms,
    Real "fit_rms_unused" = |r: &Row<'_>| r.target.evaluation.fit_rms_unused,
    Real "tre_rms" = |r: &Row<'_>| r.target.evaluation.tre_rms,
    Real "position_error" = |r: &Row<'_>| r.target.evaluation.position_error,
    Real "attitude_error" = |r: &Row<'_>| r.target.evaluation.attitude_error,
    Real "nees" = |r: &Row<'_>| r.target.evaluation.nees,
    Real "tre_crlb" = |r: &Row<'_>| r.target.evaluation.tre_crlb,
    Real "position_crlb" = |r: &Row<'_>| r.target.evaluation.position_crlb,
    Real "residual_rms" = |r: &Row<'_>| r.target.residual_rms,
    Flag "optimal" = |r: &Row<'_>| r.target.optimal,
    Integer "consensus_bound" = |r: &Row<'_>| r.target.consensus_bound.map(|n| n as i64),
    Real "nfa" = |r: &Row<'_>| r.target.nfa,
    Integer "pair_tests" = |r: &Row<'_>| r.target.pair_tests.map(|n| n as i64),
    Real "detect_ms" = |r: &Row<'_>| r.frame.times.detect_ms,
    Real "locate_ms" = |r: &Row<'_>| r.frame.times.locate_ms,
    Real "describe_ms" = |r: &Row<'_>| r.frame.times.describe_ms,
    Real "match_ms" = |r: &Row<'_>| r.frame.times.match_ms,
    Real "refine_ms" = |r: &Row<'_>| r.frame.times.refine_ms,
    Real "triangulate_ms" = |r: &Row<'_>| r.frame.times.triangulate_ms,
    Real "candidates_ms" = |r: &Row<'_>| r.target.times.candidates_ms,
    Real "search_ms" = |r: &Row<'_>| r.target.times.search_ms,
    Real "solve_ms" = |r: &Row<'_>| r.target.times.solve_ms,
    Real "total_ms" = |r: &Row<'_>| r.target.times.total_ms,
    Real "odometry_ms" = |r: &Row<'_>| r.frame.times.odometry_ms,
    Text "navigation" = |r: &Row<'_>| r.navigation().map_or_else(String::new, |known| known.state.clone()),
    Text "navigated_object" = |r: &Row<'_>| r.navigation().and_then(|known| known.pose.as_ref()).map_or_else(String::new, |pose| pose.object.clone()),
    Real "navigated_tre_rms" = |r: &Row<'_>| r.navigation()?.errors.tre_rms,
    Real "navigated_position_error" = |r: &Row<'_>| r.navigation()?.errors.position_error,
    Real "navigated_attitude_error" = |r: &Row<'_>| r.navigation()?.errors.attitude_error,
    Real "navigated_nees" = |r: &Row<'_>| r.navigation()?.errors.nees,
    Real "odometry_only_position_error" = |r: &Row<'_>| r.navigation()?.errors.odometry_only_position_error,
    Integer "poi_in_view" = |r: &Row<'_>| Some(r.frame.poi.len() as i64),
    Text "poi" = |r: &Row<'_>| r.poi().map_or_else(String::new, |point| format!("{}/{}", point.object, point.point)),
    Real "poi_range" = |r: &Row<'_>| r.poi().map(PointOfInterest::range),
    Real "poi_error" = |r: &Row<'_>| r.poi()?.error(),
    Real "poi_nees" = |r: &Row<'_>| r.poi()?.nees,
    Text "redundancy" = |r: &Row<'_>| r.integrity().map_or_else(String::new, |it| it.redundancy.clone()),
    Real "chi2" = |r: &Row<'_>| Some(r.integrity()?.chi2),
    Integer "chi2_dof" = |r: &Row<'_>| Some(r.integrity()?.dof as i64),
    Real "chi2_limit" = |r: &Row<'_>| Some(r.integrity()?.chi2_limit),
    Real "solution_separation" = |r: &Row<'_>| r.integrity()?.solution_separation,
    Real "solution_separation_two" = |r: &Row<'_>| r.integrity()?.solution_separation_two,
    Real "protection_position" = |r: &Row<'_>| r.integrity()?.protection_position,
    Real "protection_attitude" = |r: &Row<'_>| r.integrity()?.protection_attitude,
    Real "scale_error" = |r: &Row<'_>| r.integrity()?.scale_error,
    Real "scale_error_sigma" = |r: &Row<'_>| r.integrity()?.scale_error_sigma,
    Real "alert_limit" = |r: &Row<'_>| r.target.evaluation.alert_limit,
    Text "region" = |r: &Row<'_>| r.target.region().map_or_else(String::new, |region| region.name().to_owned()),
];
