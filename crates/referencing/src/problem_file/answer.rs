//! The answer to a problem, as it is printed.

use std::{path::Path, time::Instant};

use rand::Rng;
use seafix_geometry::{Camera, Object, Transform};
use serde::Serialize;

use super::{CoherenceProblem, read};
use crate::{
    Acceptance, Alternative, Correspondence, Integrity, Observations, Outcome, Search, Solver, accept::alert_limit,
};

/// The method that answers: what is used, and under which name it is reported.
#[derive(Debug, Clone, Copy)]
pub struct Method<'a> {
    /// The search and its registered name.
    pub search: (&'a str, &'a dyn Search),
    /// The solver and its registered name.
    pub solver: (&'a str, &'a dyn Solver),
    /// When an answer is believed.
    pub acceptance: &'a Acceptance,
    /// Whether the object is sought further off where it is not found ([`CoherenceProblem::attempt_with_expanding_gates`]).
    pub expand_gates: bool,
}

/// A pose that was not the answer, as it is printed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherPose {
    /// camera_from_object.
    #[serde(rename = "T_cam_obj")]
    pub t_cam_obj: [[f64; 4]; 4],
    /// Its pairs (model, cloud).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<[usize; 2]>,
    /// How well it explains the data.
    pub score: f64,
}

/// What supports a fix beyond its covariance, as it is printed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Support {
    /// `unmonitored` (three points), `detectable` (four) or `excludable`.
    pub redundancy: &'static str,
    /// χ² of the residuals at the most likely pose.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub dof: usize,
    /// What a true set exceeds with one minus the confidence.
    pub chi2_limit: f64,
    /// The farthest that the position moves (m) when one point is left out.
    pub solution_separation: Option<f64>,
    /// The same when two points are left out, where two wrong matches are assumed to happen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solution_separation_two: Option<f64>,
    /// The probability that the pose is another, farther off than the alert limit, or the object not there; null of searches that
    /// count and do not weigh.
    pub misidentified: Option<f64>,
    /// The probability with which the levels may be exceeded.
    pub risk: f64,
    /// Radii that the errors of position (m) and attitude (rad) exceed with no more than that risk; null where too few points
    /// support them, or where the points are mistaken with a greater probability.
    pub protection: Option<Levels>,
    /// The alert limit (m): a fix whose level of position is beyond it, or that has none, is not available where integrity counts.
    pub alert_limit: f64,
    /// By how much measured distances are longer than the model's, as a share; null with fewer than four points.
    pub scale_error: Option<Estimate>,
}

/// A number and its standard deviation, as they are printed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// Protection levels, as they are printed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Levels {
    /// Of the position (m).
    pub position: f64,
    /// Of the attitude (rad).
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
        }
    }
}

/// The answer to one problem, with the keys of FORMATS.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The file.
    pub file: String,
    /// The problem's name.
    pub id: String,
    /// `fixed`, `ambiguous`, `rejected` or `degenerate`.
    pub outcome: &'static str,
    /// Why there is no pose.
    pub reason: Option<&'static str>,
    /// The same in a sentence.
    pub explanation: Option<String>,
    /// camera_from_object, if referenced.
    #[serde(rename = "T_cam_obj")]
    pub t_cam_obj: Option<[[f64; 4]; 4]>,
    /// Covariance of object_from_camera, if referenced.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// The identified pairs (model, cloud), if referenced.
    pub pairs: Option<Vec<[usize; 2]>>,
    /// The scale of the model against the cloud that a similarity would have, of a solver that finds one, if referenced.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// The identified cloud points that lie behind the camera (z ≤ 0), if referenced and there are any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub behind: Vec<usize>,
    /// What was identified and is not believed (model, cloud), if not referenced: at the end of a budget the best so far.
    pub unbelieved: Option<Vec<[usize; 2]>>,
    /// What supports the fix beyond its covariance, if referenced.
    pub integrity: Option<Support>,
    /// The poses among which the data do not decide.
    pub alternatives: Vec<OtherPose>,
    /// The best pose that was not believed.
    pub runner_up: Option<OtherPose>,
    /// Difference of the scores of the best and the next.
    pub margin: Option<f64>,
    /// Whether it is proved that no admissible set is larger; of a search by likelihood, that none is likelier.
    pub optimal: bool,
    /// No admissible set has more pairs.
    pub consensus_bound: Option<usize>,
    /// Expected number of chance sets as large as the one found.
    pub nfa: Option<f64>,
    /// Pair tests of the search.
    pub pair_tests: Option<u64>,
    /// Whether all was looked at that may lead to a second copy of the object, whole or in part; of searches that look for one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub copies_sought: Option<bool>,
    /// No admissible set is likelier by more than this (nats); of searches that were asked to prove it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence_gap: Option<f64>,
    /// Everything derived from the file (ms); reading and parsing not counted.
    pub time_ms: f64,
    /// The search's name.
    pub search: String,
    /// The solver's name.
    pub solver: String,
}

/// One line of output: an answer, or what is wrong with the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Line {
    /// The answer.
    Answer(Box<Answer>),
    /// The file could not be used.
    Failed {
        /// The file.
        file: String,
        /// What is wrong with it, in one line.
        error: String,
    },
}

/// The answer to a problem that came from `file`.
pub fn answer(problem: &CoherenceProblem, file: &Path, method: &Method<'_>, rng: &mut dyn Rng) -> Answer {
    let start = Instant::now();
    let (search, solver) = (method.search.1, method.solver.1);
    let attempt = match method.expand_gates {
        true => problem.attempt_with_expanding_gates(search, solver, method.acceptance, rng),
        false => problem.attempt(search, solver, method.acceptance, rng),
    };
    let time_ms = start.elapsed().as_secs_f64() * 1e3;
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
        t_cam_obj: fix.map(|fix| rows(&fix.object_from_camera)),
        covariance: fix
            .map(|fix| std::array::from_fn(|row| std::array::from_fn(|column| fix.covariance.matrix[(row, column)]))),
        pairs: fix.map(|fix| indices(&fix.pairs)),
        scale: fix.and_then(|fix| solver.scale(&Observations::of(&fix.pairs, &problem.model, &problem.cloud, None))),
        behind: fix.map_or_else(Vec::new, |fix| {
            let clouds = fix.pairs.iter().map(|pair| pair.cloud);
            clouds.filter(|&cloud| !(problem.cloud[cloud].position.at.coords.z > 0.0)).collect()
        }),
        unbelieved: (fix.is_none() && !attempt.identified.is_empty()).then(|| indices(&attempt.identified)),
        integrity: fix.map(|fix| {
            let (risk, limit) = (method.acceptance.risk, alert_limit(&problem.model, method.acceptance));
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

/// camera_from_object, row by row.
fn rows(object_from_camera: &Transform<Object, Camera>) -> [[f64; 4]; 4] {
    let matrix = object_from_camera.inverse().matrix();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

fn indices(pairs: &[Correspondence]) -> Vec<[usize; 2]> {
    pairs.iter().map(|pair| [pair.model, pair.cloud]).collect()
}
