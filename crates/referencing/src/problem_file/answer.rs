//! The printed answer to a problem.

use std::{borrow::Cow, path::Path, time::Instant};

use rand::Rng;
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::Serialize;

use super::{
    edges::is_behind,
    input::{CoherenceProblem, read},
    method::Method,
};
use crate::{
    accept::{
        alert_limit,
        integrity::Integrity,
        outcome::{Attempt, BestPose, Outcome},
    },
    alternative::Alternative,
    anchors::anchors,
    observations::Observations,
    problem::Correspondence,
};

/// The printed form of a pose other than the answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherPose {
    /// The pose, camera_from_object.
    #[serde(rename = "T_cam_obj")]
    pub t_cam_obj: [[f64; 4]; 4],
    /// The pairs (model, cloud).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<[usize; 2]>,
    /// The score of the pose; larger is better.
    pub score: f64,
}

/// The printed form of the best pose of an answer that is no fix.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Best {
    /// The pose, camera_from_object.
    #[serde(rename = "T_cam_obj")]
    pub t_cam_obj: [[f64; 4]; 4],
    /// The pairs (model, cloud).
    pub pairs: Vec<[usize; 2]>,
    /// The edges (edge, line), if there are any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<[usize; 2]>,
    /// The covariance, of object_from_camera; null if the pairs determine none.
    pub covariance: Option<[[f64; 6]; 6]>,
}

impl From<&BestPose> for Best {
    fn from(best: &BestPose) -> Self {
        Self {
            t_cam_obj: rows(&best.object_from_camera),
            pairs: indices(&best.pairs),
            edges: indices(&best.edges),
            covariance: best.covariance.as_ref().map(rows6),
        }
    }
}

/// The printed form of a fix's integrity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Support {
    /// The grade of redundancy: `unmonitored` (three points), `detectable` (four) or `excludable`.
    pub redundancy: &'static str,
    /// χ² of the residuals at the maximum-likelihood pose.
    pub chi2: f64,
    /// The degrees of freedom of χ².
    pub dof: usize,
    /// The limit of χ², which a correct set exceeds with probability one minus the confidence.
    pub chi2_limit: f64,
    /// The largest shift of the position (m) when one point is excluded.
    pub solution_separation: Option<f64>,
    /// The largest shift of the position (m) when two points are excluded.
    ///
    /// Absent if two wrong matches are assumed impossible.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solution_separation_two: Option<f64>,
    /// The probability of a wrong pose or of an absent object; null for a counting search.
    pub misidentified: Option<f64>,
    /// The risk: the probability with which an error may exceed its protection level.
    pub risk: f64,
    /// The protection levels; null without redundancy, or if the probability of misidentification exceeds the risk.
    pub protection: Option<Levels>,
    /// The alert limit (m); a fix whose position level is missing or larger is unavailable for uses that require
    /// integrity.
    pub alert_limit: f64,
    /// The scale error between measurement and model; null with fewer than four points.
    pub scale_error: Option<Estimate>,
    /// The depth error between measurement and model, along the optical axis.
    ///
    /// Absent with fewer than four points, or if the points do not determine it, as those of a plane seen face-on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_error: Option<Estimate>,
}

/// The printed form of a number with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// The standard deviation.
    pub sigma: f64,
}

/// The printed form of protection levels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Levels {
    /// The level of the position (m).
    pub position: f64,
    /// The level of the attitude (rad).
    pub attitude: f64,
}

impl Support {
    fn of(integrity: &Integrity, risk: f64, alert_limit: f64) -> Self {
        Self {
            redundancy: integrity.redundancy.name(),
            chi2: integrity.chi2,
            dof: integrity.dof,
            chi2_limit: integrity.chi2_limit,
            solution_separation: integrity.solution_separation,
            solution_separation_two: integrity.solution_separation_two,
            misidentified: integrity.misidentified,
            risk,
            protection: integrity.protection.map(|level| Levels { position: level.position, attitude: level.attitude }),
            alert_limit,
            scale_error: integrity.scale_error.map(|it| Estimate { value: it.value, sigma: it.sigma }),
            depth_error: integrity.depth_error.map(|it| Estimate { value: it.value, sigma: it.sigma }),
        }
    }
}

/// The answer to one problem, with the keys of `docs/formats.md`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The file.
    pub file: String,
    /// The problem's name.
    pub id: String,
    /// The outcome: `fix`, `ambiguous`, `rejected` or `degenerate`.
    pub outcome: &'static str,
    /// The reason for a missing pose, in kebab-case.
    pub reason: Option<&'static str>,
    /// The reason for a missing pose as a sentence.
    pub explanation: Option<String>,
    /// What helps against the missing pose, in one phrase.
    pub remedy: Option<Cow<'static, str>>,
    /// The likely cause of a missing pose with its remedy, if one is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diagnosis: Option<String>,
    /// The pose of a fix, camera_from_object.
    #[serde(rename = "T_cam_obj")]
    pub t_cam_obj: Option<[[f64; 4]; 4]>,
    /// The covariance of a fix, of object_from_camera.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// The identified pairs (model, cloud) of a fix.
    pub pairs: Option<Vec<[usize; 2]>>,
    /// The identified edges (edge, line) of a fix, if there are any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<[usize; 2]>,
    /// The scale of the model relative to the cloud.
    ///
    /// Present for a fix whose solver estimates a similarity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// The identified cloud points behind the camera (z ≤ 0), if a fix has any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub behind: Vec<usize>,
    /// The identified lines with an end behind the camera (z ≤ 0), if a fix has any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lines_behind: Vec<usize>,
    /// The rejected pairs (model, cloud), if there is no fix; after an exhausted budget, the best so far.
    pub unbelieved: Option<Vec<[usize; 2]>>,
    /// The best pose of an answer that is no fix; null if its pairs determine none.
    pub best: Option<Best>,
    /// The integrity of a fix.
    pub integrity: Option<Support>,
    /// The poses between which the data do not decide.
    pub alternatives: Vec<OtherPose>,
    /// The best other pose, acceptable or not; for an ambiguous outcome the second alternative.
    pub runner_up: Option<OtherPose>,
    /// The score of the best pose minus that of the next.
    pub margin: Option<f64>,
    /// Whether the search proved that no admissible set is larger; a likelihood search proves that none is more
    /// probable.
    pub optimal: bool,
    /// The proved upper bound of the number of pairs of an admissible set, of points and edges together.
    pub consensus_bound: Option<usize>,
    /// The probability that the object is absent.
    pub p_absent: Option<f64>,
    /// The probability that the pose of the fix, or of `best`, is not the object's: absence and other poses together.
    pub p_wrong: Option<f64>,
    /// The number of false alarms (NFA) of the set.
    pub nfa: Option<f64>,
    /// The number of pair tests of the search.
    pub pair_tests: Option<u64>,
    /// Whether every possible second copy of the object was examined, complete or partial; absent for a search that
    /// seeks none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub copies_sought: Option<bool>,
    /// The upper bound (nats) by which an admissible set may exceed the best pose's evidence; absent unless the search
    /// proves it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence_gap: Option<f64>,
    /// The processing time (ms), without reading and parsing.
    pub time_ms: f64,
    /// The search's name.
    pub search: String,
    /// The solver's name.
    pub solver: String,
}

/// One line of output: an answer, or the fault of a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Line {
    /// The answer.
    Answer(Box<Answer>),
    /// A file that could not be used.
    Failed {
        /// The file.
        file: String,
        /// The fault in one line.
        error: String,
    },
}

/// Answers a problem that came from `file`.
pub fn answer(problem: &CoherenceProblem, file: &Path, method: &Method<'_>, rng: &mut dyn Rng) -> Answer {
    let start = Instant::now();
    let attempt = problem.attempt_within(problem.tolerance(), method, rng);
    let time_ms = start.elapsed().as_secs_f64() * 1e3;
    let parts = (method.search.1, method.solver.1, method.acceptance);
    let diagnosis = problem.diagnosis(&attempt, parts, rng);
    Answer { diagnosis, ..printed(&attempt, problem, file, method, time_ms) }
}

/// The printed form of an attempt at a problem that came from `file`, without diagnosis.
pub fn printed(
    attempt: &Attempt,
    problem: &CoherenceProblem,
    file: &Path,
    method: &Method<'_>,
    time_ms: f64,
) -> Answer {
    let solver = method.solver.1;
    let fix = match &attempt.outcome {
        Outcome::Fix(fix) => Some(fix),
        _ => None,
    };
    Answer {
        file: file.display().to_string(),
        id: problem.id.clone(),
        outcome: attempt.outcome.name(),
        reason: attempt.outcome.reason(),
        explanation: attempt.outcome.explanation(),
        remedy: attempt.outcome.remedy(),
        diagnosis: None,
        t_cam_obj: fix.map(|fix| rows(&fix.object_from_camera)),
        covariance: fix.map(|fix| rows6(&fix.covariance)),
        pairs: fix.map(|fix| indices(&fix.pairs)),
        edges: fix.map_or_else(Vec::new, |fix| indices(&fix.edges)),
        scale: fix.and_then(|fix| solver.scale(&Observations::of(&fix.pairs, &problem.model, &problem.cloud, None))),
        behind: fix.map_or_else(Vec::new, |fix| {
            let clouds = fix.pairs.iter().map(|pair| pair.cloud);
            clouds.filter(|&cloud| !(problem.cloud[cloud].position.at.coords.z > 0.0)).collect()
        }),
        lines_behind: fix.map_or_else(Vec::new, |fix| {
            let lines = fix.edges.iter().map(|edge| edge.cloud);
            lines.filter(|&line| is_behind(&problem.edges.lines[line])).collect()
        }),
        unbelieved: (fix.is_none() && !attempt.identified.is_empty()).then(|| indices(&attempt.identified)),
        best: attempt.best.as_ref().map(Best::from),
        integrity: fix.map(|fix| {
            let anchors = anchors(&problem.model, &problem.edges.model);
            let (risk, limit) = (method.acceptance.risk, alert_limit(&anchors, method.acceptance));
            Support::of(&fix.integrity, risk, limit)
        }),
        alternatives: match &attempt.outcome {
            Outcome::Ambiguous(all) => all.iter().map(OtherPose::from).collect(),
            _ => Vec::new(),
        },
        runner_up: match (&attempt.outcome, &attempt.runner_up) {
            (Outcome::Ambiguous(all), _) => all.get(1).map(OtherPose::without_pairs),
            (_, other) => other.as_ref().map(OtherPose::without_pairs),
        },
        margin: attempt.margin(),
        optimal: attempt.optimal,
        consensus_bound: attempt.consensus_bound,
        p_absent: attempt.p_absent.filter(|p| p.is_finite()),
        p_wrong: attempt.p_wrong.filter(|p| p.is_finite()),
        nfa: attempt.nfa.filter(|expected| expected.is_finite()),
        pair_tests: attempt.pair_tests,
        copies_sought: attempt.copies_sought,
        evidence_gap: attempt.evidence_gap,
        time_ms,
        search: method.search.0.to_owned(),
        solver: method.solver.0.to_owned(),
    }
}

/// Reads, checks and answers one file.
pub fn solve_file(file: &Path, method: &Method<'_>, rng: &mut dyn Rng) -> Line {
    match read(file) {
        Ok(problem) => Line::Answer(Box::new(answer(&problem, file, method, rng))),
        Err(fault) => Line::Failed { file: file.display().to_string(), error: fault.to_string() },
    }
}

impl From<&Alternative> for OtherPose {
    fn from(alternative: &Alternative) -> Self {
        Self {
            t_cam_obj: rows(&alternative.object_from_camera),
            pairs: indices(&alternative.pairs),
            score: alternative.score,
        }
    }
}

impl OtherPose {
    fn without_pairs(alternative: &Alternative) -> Self {
        Self { pairs: Vec::new(), ..Self::from(alternative) }
    }
}

/// The matrix camera_from_object, row by row.
fn rows(object_from_camera: &Transform<Object, Camera>) -> [[f64; 4]; 4] {
    let matrix = object_from_camera.inverse().matrix();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

/// The covariance of object_from_camera, row by row.
fn rows6(covariance: &Covariance6<Object, Camera>) -> [[f64; 6]; 6] {
    std::array::from_fn(|row| std::array::from_fn(|column| covariance.matrix[(row, column)]))
}

fn indices(pairs: &[Correspondence]) -> Vec<[usize; 2]> {
    pairs.iter().map(|pair| [pair.model, pair.cloud]).collect()
}
