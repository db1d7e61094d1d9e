//! `coherence-problem/1`: one identification problem as a file, and the answer to it.

use std::{path::Path, time::Instant};

use nalgebra::{Matrix3, Matrix4};
use rand::Rng;
use seafix_component::{Fault, nearest};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use serde::{Deserialize, Serialize};

use crate::{
    Acceptance, Alternative, Attempt, Candidates, Gate, ModelPoint, Outcome, Prior, PriorBound, Problem, Search, Shell,
    Solver, Tolerance, Unidentified, candidates, reference,
};

/// The format this reader understands.
pub const FORMAT: &str = "coherence-problem/1";
/// Larger files are refused before they are read (bytes).
const MOST_BYTES: u64 = 64 << 20;
/// More candidate pairs than this are not listed: no search could use them.
const MOST_CANDIDATES: usize = 4_000_000;

/// An identification problem, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct CoherenceProblem {
    /// Its name.
    pub id: String,
    /// The feature points, object frame.
    pub model: Vec<ModelPoint>,
    /// The measured points, camera frame.
    pub cloud: Vec<MeasuredPoint>,
    /// The distance tolerance Δ (m).
    pub delta: f64,
    /// The rough pose, if one is known.
    pub prior: Option<Prior>,
    /// The only pairs (model, cloud) to consider, if they are given.
    pub putative: Option<Vec<(usize, usize)>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    format: String,
    #[serde(default)]
    id: Option<String>,
    #[serde(default, rename = "family")]
    _family: serde::de::IgnoredAny,
    #[serde(default, rename = "seed_set")]
    _seed_set: serde::de::IgnoredAny,
    #[serde(default, rename = "seed")]
    _seed: serde::de::IgnoredAny,
    model: Vec<[f64; 3]>,
    cloud: Vec<[f64; 3]>,
    sigma: f64,
    #[serde(default)]
    sigma_xyz: Option<Vec<[f64; 3]>>,
    delta: f64,
    #[serde(default)]
    prior: Option<RawPrior>,
    #[serde(default)]
    putative: Option<Vec<[usize; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPrior {
    #[serde(rename = "T_cam_obj")]
    t_cam_obj: [[f64; 4]; 4],
    shell_half_m: f64,
}

impl CoherenceProblem {
    /// The problem in `text`, the content of `file`.
    ///
    /// # Errors
    /// The first fault: not JSON, an unknown key or format, a number that is not finite or out of
    /// its range, an index that points nowhere, a prior that is no rigid motion.
    pub fn parse(text: &str, file: &Path) -> Result<Self, Fault> {
        let raw: Raw = serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|error| json(file, &error))?;
        let fault = |what: &str| Fault::new(what, file);
        if raw.format != FORMAT {
            let remedy = format!("this reader knows `{FORMAT}`");
            return Err(fault("unknown format").value(format!("`{}`", raw.format)).remedy(remedy));
        }
        for (name, rows) in [("model", &raw.model), ("cloud", &raw.cloud)] {
            if let Some(index) = rows.iter().position(|row| !row.iter().all(|x| x.is_finite())) {
                let what = format!("{name} point {index} is not finite");
                return Err(fault(&what).value(format!("{:?}", rows[index])).remedy("give finite numbers, in metres"));
            }
        }
        let is_sigma = |sigma: f64| sigma >= 0.0 && sigma.is_finite();
        if !is_sigma(raw.sigma) {
            return Err(fault("`sigma` is out of range").value(raw.sigma).remedy("give metres, zero or more"));
        }
        if let Some(rows) = &raw.sigma_xyz {
            if rows.len() != raw.cloud.len() {
                let value = format!("{} rows for {} cloud points", rows.len(), raw.cloud.len());
                return Err(fault("`sigma_xyz` has the wrong length")
                    .value(value)
                    .remedy("give one row a cloud point"));
            }
            if let Some(index) = rows.iter().position(|row| !row.iter().all(|&sigma| is_sigma(sigma))) {
                let what = format!("row {index} of `sigma_xyz` is out of range");
                return Err(fault(&what).value(format!("{:?}", rows[index])).remedy("give metres, zero or more"));
            }
        }
        let model: Vec<ModelPoint> = raw
            .model
            .iter()
            .enumerate()
            .map(|(index, at)| ModelPoint::exact(index.to_string(), Point::from(*at)))
            .collect();
        let greatest = extent(&model) / 2.0;
        // Two points or fewer are answered "too few", whatever Δ says of them.
        if !(raw.delta > 0.0 && raw.delta.is_finite()) || (model.len() > 2 && raw.delta > greatest) {
            let remedy = format!("allowed: above 0, at most half the model's extent, {greatest:.4} m");
            return Err(fault("`delta` is out of range").value(raw.delta).remedy(remedy));
        }
        let putative = match raw.putative {
            None => None,
            Some(pairs) => {
                let out = pairs.iter().position(|[i, j]| *i >= raw.model.len() || *j >= raw.cloud.len());
                if let Some(index) = out {
                    let what = format!("putative pair {index} points nowhere");
                    let remedy =
                        format!("there are {} model and {} cloud points, from 0", raw.model.len(), raw.cloud.len());
                    return Err(fault(&what).value(format!("{:?}", pairs[index])).remedy(remedy));
                }
                Some(pairs.into_iter().map(|[i, j]| (i, j)).collect())
            }
        };
        let cloud = raw.cloud.iter().enumerate().map(|(index, at)| {
            let sigma = raw.sigma_xyz.as_ref().map_or([raw.sigma; 3], |rows| rows[index]);
            let covariance = Matrix3::from_diagonal(&sigma.map(|s| s * s).into());
            MeasuredPoint { position: UncertainPoint { at: Point::from(*at), covariance }, pixels: None }
        });
        Ok(Self {
            id: raw.id.unwrap_or_default(),
            model,
            cloud: cloud.collect(),
            delta: raw.delta,
            prior: raw.prior.map(|prior| prior.checked(file)).transpose()?,
            putative,
        })
    }

    /// Stage 1: which cloud points may be which model points; `None` when there are too many to list.
    pub fn candidates(&self) -> Option<Candidates> {
        match &self.putative {
            Some(pairs) => Some(Candidates::from_pairs(self.model.len(), pairs.iter().copied())),
            None if self.model.len().saturating_mul(self.cloud.len()) > MOST_CANDIDATES && self.prior.is_none() => None,
            None => Some(candidates(&self.model, &self.cloud, self.prior.as_ref(), &Gate::default(), None)),
        }
    }

    /// One attempt at the pose.
    pub fn attempt(
        &self,
        search: &dyn Search,
        solver: &dyn Solver,
        acceptance: &Acceptance,
        rng: &mut dyn Rng,
    ) -> Attempt {
        let Some(candidates) = self.candidates() else {
            let bound = self.model.len().min(self.cloud.len());
            let why = Unidentified::Budget { budget: MOST_CANDIDATES as u64, best: 0, bound, tests: 0 };
            return Attempt::without(why);
        };
        let problem = Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &candidates,
            tolerance: Tolerance::Fixed(self.delta),
        };
        reference(&problem, self.prior.as_ref(), search, solver, acceptance, None, rng)
    }
}

impl RawPrior {
    fn checked(&self, file: &Path) -> Result<Prior, Fault> {
        let matrix = Matrix4::from_fn(|row, column| self.t_cam_obj[row][column]);
        let camera_from_object = Transform::<Camera, Object>::from_matrix(&matrix)
            .map_err(|error| Fault::new(format!("`prior.T_cam_obj` is no rigid motion: {error}"), file))?;
        if !(self.shell_half_m > 0.0 && self.shell_half_m.is_finite()) {
            let fault = Fault::new("`prior.shell_half_m` is out of range", file).value(self.shell_half_m);
            return Err(fault.remedy("give a positive half-size in metres"));
        }
        Ok(Prior { object_from_camera: camera_from_object.inverse(), bound: PriorBound::Box(self.shell_half_m) })
    }
}

/// The diagonal of the model's shell (m), between its diameter and √3 times that.
fn extent(model: &[ModelPoint]) -> f64 {
    Shell::around(model.iter().map(|point| point.at)).map_or(0.0, |shell| shell.max.distance(&shell.min))
}

/// What the JSON reader found wrong, with the nearest key to an unknown one.
fn json(file: &Path, error: &serde_json::Error) -> Fault {
    let full = error.to_string();
    let message = full.split(" at line ").next().unwrap_or_default();
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let line = (error.line() > 0).then(|| error.line());
    match quoted.split_first() {
        Some((key, known)) if message.starts_with("unknown field") => {
            let remedy = match nearest(key, known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("there are {}", known.join(", ")),
            };
            Fault::new("unknown key", file).on_line(line).value(format!("`{key}`")).remedy(remedy)
        }
        _ => Fault::new(message, file)
            .on_line(line)
            .value(format!("column {}", error.column()))
            .remedy(format!("give `{FORMAT}` as JSON")),
    }
}

/// The method that answers: what is used, and under which name it is reported.
#[derive(Debug, Clone, Copy)]
pub struct Method<'a> {
    /// The search and its registered name.
    pub search: (&'a str, &'a dyn Search),
    /// The solver and its registered name.
    pub solver: (&'a str, &'a dyn Solver),
    /// When an answer is believed.
    pub acceptance: &'a Acceptance,
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

/// The answer to one problem, with the keys of FORMATS.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The file.
    pub file: String,
    /// The problem's name.
    pub id: String,
    /// `referenced`, `ambiguous`, `unidentified` or `degenerate`.
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
    /// The poses among which the data do not decide.
    pub alternatives: Vec<OtherPose>,
    /// The best pose that was not believed.
    pub runner_up: Option<OtherPose>,
    /// Difference of the scores of the best and the next.
    pub margin: Option<f64>,
    /// Whether it is proved that no admissible set is larger.
    pub optimal: bool,
    /// No admissible set has more pairs.
    pub size_bound: Option<usize>,
    /// Expected number of chance sets as large as the one found.
    pub expected_chance_sets: Option<f64>,
    /// Pair tests of the search.
    pub tests: Option<u64>,
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
    let attempt = problem.attempt(method.search.1, method.solver.1, method.acceptance, rng);
    let time_ms = start.elapsed().as_secs_f64() * 1e3;
    let reference = match &attempt.outcome {
        Outcome::Referenced(reference) => Some(reference),
        _ => None,
    };
    Answer {
        file: file.display().to_string(),
        id: problem.id.clone(),
        outcome: attempt.outcome.name(),
        reason: attempt.outcome.reason(),
        explanation: attempt.outcome.explanation(),
        t_cam_obj: reference.map(|reference| rows(&reference.object_from_camera)),
        covariance: reference.map(|reference| {
            std::array::from_fn(|row| std::array::from_fn(|column| reference.covariance.matrix[(row, column)]))
        }),
        pairs: reference.map(|reference| indices(&reference.pairs)),
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
        size_bound: attempt.size_bound,
        expected_chance_sets: attempt.expected_chance_sets.filter(|expected| expected.is_finite()),
        tests: attempt.tests,
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

/// The problem in a file.
///
/// # Errors
/// The file cannot be read, is larger than 64 MiB or not UTF-8, or [`CoherenceProblem::parse`] refuses it.
pub fn read(file: &Path) -> Result<CoherenceProblem, Fault> {
    let unreadable = |error: std::io::Error| Fault::new(format!("cannot read the file: {error}"), file);
    let bytes = std::fs::metadata(file).map_err(unreadable)?.len();
    if bytes > MOST_BYTES {
        return Err(Fault::new("the file is too large", file)
            .value(format!("{bytes} bytes"))
            .remedy(format!("at most {MOST_BYTES} bytes are read")));
    }
    let bytes = std::fs::read(file).map_err(unreadable)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        Fault::new("the file is not UTF-8", file).value(format!("byte {offset}")).remedy("save it as UTF-8")
    })?;
    CoherenceProblem::parse(&text, file)
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

fn indices(pairs: &[crate::Correspondence]) -> Vec<[usize; 2]> {
    pairs.iter().map(|pair| [pair.model, pair.cloud]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Kabsch, MaximumClique};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Five points seen from the origin of a camera 3 m in front of them, as exact numbers.
    const GOOD: &str = r#"{"format": "coherence-problem/1", "id": "x", "family": "t", "seed_set": "own", "seed": 1,
"model": [[0,0,0],[1,0,0],[0.25,-0.75,0],[0.5,0.5,1],[-0.5,0.25,0.5]],
"cloud": [[0,0,3],[1,0,3],[0.25,-0.75,3],[0.5,0.5,4],[-0.5,0.25,3.5]],
"sigma": 0.01, "delta": 0.04,
"prior": {"T_cam_obj": [[1,0,0,0.05],[0,1,0,0],[0,0,1,3],[0,0,0,1]], "shell_half_m": 0.1},
"putative": null}"#;

    fn parse(text: &str) -> Result<CoherenceProblem, Fault> {
        CoherenceProblem::parse(text, Path::new("p.json"))
    }

    fn fault(from: &str, to: &str) -> String {
        assert!(GOOD.contains(from), "the good problem has no `{from}`");
        parse(&GOOD.replacen(from, to, 1)).expect_err("the problem is broken").to_string()
    }

    fn solved(text: &str) -> serde_json::Value {
        let method = Method {
            search: ("maximum-clique", &MaximumClique::default()),
            solver: ("kabsch", &Kabsch::default()),
            acceptance: &Acceptance::default(),
        };
        let answer = answer(&parse(text).unwrap(), Path::new("p.json"), &method, &mut ChaCha8Rng::seed_from_u64(0));
        serde_json::to_value(Line::Answer(Box::new(answer))).unwrap()
    }

    #[test]
    fn a_good_problem_is_answered_with_the_keys_of_the_format() {
        let answer = solved(GOOD);
        let keys = [
            "file",
            "id",
            "outcome",
            "reason",
            "T_cam_obj",
            "covariance",
            "pairs",
            "alternatives",
            "runner_up",
            "margin",
            "optimal",
            "size_bound",
            "expected_chance_sets",
            "time_ms",
        ];
        assert!(keys.iter().all(|key| answer.get(key).is_some()), "{answer}");
        assert_eq!((answer["outcome"].as_str(), answer["reason"].is_null()), (Some("referenced"), true), "{answer}");
        assert_eq!(answer["pairs"], serde_json::json!([[0, 0], [1, 1], [2, 2], [3, 3], [4, 4]]));
        assert!((answer["T_cam_obj"][2][3].as_f64().unwrap() - 3.0).abs() < 1e-12, "camera from object");
        assert_eq!(answer["covariance"].as_array().unwrap().len(), 6);
    }

    #[test]
    fn a_refusal_has_no_pose() {
        let text = GOOD.replace("\"putative\": null", "\"putative\": [[0,0],[1,1]]");
        let answer = solved(&text);
        assert_eq!((answer["outcome"].as_str(), answer["reason"].as_str()), (Some("unidentified"), Some("too-few")));
        assert!(["T_cam_obj", "covariance", "pairs"].iter().all(|key| answer[key].is_null()), "{answer}");
    }

    #[test]
    fn candidates_come_from_pairs_shells_or_everything() {
        let problem = parse(GOOD).unwrap();
        assert_eq!(problem.candidates().unwrap().lists, [[0], [1], [2], [3], [4]].map(Vec::from));
        let all = CoherenceProblem { prior: None, ..problem.clone() };
        assert_eq!(all.candidates().unwrap().pairs(), 25);
        let pairs = CoherenceProblem { putative: Some(vec![(2, 4), (2, 1), (2, 4)]), ..problem };
        assert_eq!(pairs.candidates().unwrap().lists[2], [1, 4]);
    }

    #[test]
    fn every_fault_names_its_place() {
        assert_eq!(fault("\"delta\"", "\"delat\""), "unknown key in p.json:4: `delat`; did you mean `delta`?");
        assert!(fault("problem/1", "problem/2").starts_with("unknown format in p.json: `coherence-problem/2`"));
        assert!(fault("0.04", "-1").starts_with("`delta` is out of range in p.json: -1; allowed: above 0, at most"));
        assert!(fault("0.04", "2.0").starts_with("`delta` is out of range in p.json: 2; allowed"));
        assert!(fault("0.01", "-0.01").starts_with("`sigma` is out of range"));
        assert!(fault("[0.5,0.5,1]", "[0.5,1e999,1]").contains("p.json:2"), "no finite number");
        assert!(fault("[0.5,0.5,1]", "[0.5,NaN,1]").contains("p.json:2"), "no JSON");
        assert!(fault("[0.5,0.5,1]", "[0.5,1]").contains("p.json:2"), "two coordinates");
        assert!(fault("null}", "[[0,5]]}").starts_with("putative pair 0 points nowhere in p.json: [0, 5]"));
        assert!(fault("[[1,0,0,0.05]", "[[1.1,0,0,0.05]").starts_with("`prior.T_cam_obj` is no rigid motion"));
        assert!(fault("0.1}", "0}").starts_with("`prior.shell_half_m` is out of range"));
        assert!(
            fault("\"sigma\": 0.01", "\"sigma\": 0.01, \"sigma_xyz\": [[1,1,1]]")
                .starts_with("`sigma_xyz` has the wrong")
        );
        assert!(fault("{\"format\"", "[{\"format\"").contains("in p.json:1"));
    }

    #[test]
    fn a_file_that_is_not_there_is_a_line() {
        let method = Method {
            search: ("maximum-clique", &MaximumClique::default()),
            solver: ("kabsch", &Kabsch::default()),
            acceptance: &Acceptance::default(),
        };
        let line = solve_file(Path::new("no/such/file.json"), &method, &mut ChaCha8Rng::seed_from_u64(0));
        assert!(matches!(&line, Line::Failed { error, .. } if error.starts_with("cannot read the file")), "{line:?}");
        assert!(serde_json::to_value(&line).unwrap().get("error").is_some());
    }
}
