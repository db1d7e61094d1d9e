//! The columns of the table of results: one row a trial, frame and attempted target.

use seafix_log::{FrameRecord, InspectedPoint, Integrity, NavigationRecord, TargetRecord};

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
    fn inspected(&self) -> Option<&'a InspectedPoint> {
        let off = |point: &InspectedPoint| point.at[0].hypot(point.at[1]) / point.at[2];
        self.frame.inspected.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
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
    Real "m1_rms" = |r: &Row<'_>| r.target.evaluation.m1_rms,
    Real "m1_unused_rms" = |r: &Row<'_>| r.target.evaluation.m1_unused_rms,
    Real "m2_rms" = |r: &Row<'_>| r.target.evaluation.m2_rms,
    Real "m3_position" = |r: &Row<'_>| r.target.evaluation.m3_position,
    Real "m3_attitude" = |r: &Row<'_>| r.target.evaluation.m3_attitude,
    Real "nees" = |r: &Row<'_>| r.target.evaluation.nees,
    Real "m2_bound" = |r: &Row<'_>| r.target.evaluation.m2_bound,
    Real "m3_bound" = |r: &Row<'_>| r.target.evaluation.m3_bound,
    Real "residual_rms" = |r: &Row<'_>| r.target.residual_rms,
    Flag "optimal" = |r: &Row<'_>| r.target.optimal,
    Integer "size_bound" = |r: &Row<'_>| r.target.size_bound.map(|n| n as i64),
    Real "nfa" = |r: &Row<'_>| r.target.nfa,
    Integer "tests" = |r: &Row<'_>| r.target.tests.map(|n| n as i64),
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
    Real "navigated_m2_rms" = |r: &Row<'_>| r.navigation()?.errors.m2_rms,
    Real "navigated_m3_position" = |r: &Row<'_>| r.navigation()?.errors.m3_position,
    Real "navigated_m3_attitude" = |r: &Row<'_>| r.navigation()?.errors.m3_attitude,
    Real "navigated_nees" = |r: &Row<'_>| r.navigation()?.errors.nees,
    Real "unreferenced_m3_position" = |r: &Row<'_>| r.navigation()?.errors.unreferenced_m3_position,
    Integer "inspected_points" = |r: &Row<'_>| Some(r.frame.inspected.len() as i64),
    Text "inspected" = |r: &Row<'_>| r.inspected().map_or_else(String::new, |point| format!("{}/{}", point.object, point.point)),
    Real "inspected_range" = |r: &Row<'_>| r.inspected().map(InspectedPoint::range),
    Real "inspected_error" = |r: &Row<'_>| r.inspected()?.error(),
    Real "inspected_nees" = |r: &Row<'_>| r.inspected()?.nees,
    Text "redundancy" = |r: &Row<'_>| r.integrity().map_or_else(String::new, |it| it.redundancy.clone()),
    Real "chi2" = |r: &Row<'_>| Some(r.integrity()?.chi2),
    Integer "chi2_freedom" = |r: &Row<'_>| Some(r.integrity()?.freedom as i64),
    Real "chi2_limit" = |r: &Row<'_>| Some(r.integrity()?.chi2_limit),
    Real "separation" = |r: &Row<'_>| r.integrity()?.separation,
    Real "separation_two" = |r: &Row<'_>| r.integrity()?.separation_two,
    Real "protection_position" = |r: &Row<'_>| r.integrity()?.protection_position,
    Real "protection_attitude" = |r: &Row<'_>| r.integrity()?.protection_attitude,
    Real "stretch" = |r: &Row<'_>| r.integrity()?.stretch,
    Real "stretch_sigma" = |r: &Row<'_>| r.integrity()?.stretch_sigma,
    Real "alert_limit" = |r: &Row<'_>| r.target.evaluation.alert_limit,
    Text "region" = |r: &Row<'_>| r.target.region().map_or_else(String::new, |region| region.name().to_owned()),
];
