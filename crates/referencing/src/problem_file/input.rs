//! The problem as a file has it.

use std::path::Path;

use nalgebra::{Matrix3, Matrix4};
use rand::Rng;
use seafix_component::{Fault, nearest, read_text};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};
use serde::Deserialize;

use crate::{
    Acceptance, Attempt, Candidates, Gate, ModelPoint, Prior, PriorBound, Problem, Search, Shell, Solver, Tolerance,
    Unidentified, candidates, reference,
    site::{COINCIDENT, SUSPICIOUS, diameter, nearest_two},
    solve::{ON_A_LINE, second_ratio},
    until_found,
};

/// The format this reader understands.
pub const FORMAT: &str = "coherence-problem/1";
/// More candidate pairs than this are not listed: no search could use them.
const MOST_CANDIDATES: usize = 4_000_000;

/// Larger files, and clouds of more points, are refused: with them a problem takes less than 500 MB.
const MOST_BYTES: u64 = 48 << 20;
const MOST_POINTS: usize = 500_000;
/// A point known worse than this (m) is not known, and the cube of its variance is still a number.
const MOST_SIGMA: f64 = 1e15;
/// Largest coordinate of a model (m): beyond, a double no longer tells micrometres. A cloud may have blunders farther away.
const FARTHEST: f64 = 1e9;

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
    /// its range, two model points in one place, an index that points nowhere, a prior that is no rigid motion.
    pub fn parse(text: &str, file: &Path) -> Result<Self, Fault> {
        if text.trim_start().starts_with('[') {
            let fault = Fault::new("a list where an object is expected", file).on_line(1).value("`[`");
            return Err(fault.remedy(format!("give one `{FORMAT}` a file, in braces")));
        }
        let raw: Raw = serde_json::from_str(text).map_err(|error| json(file, &error))?;
        let fault = |what: &str| Fault::new(what, file);
        if raw.format != FORMAT {
            let remedy = format!("this reader knows `{FORMAT}`");
            return Err(fault("unknown format").value(format!("`{}`", raw.format)).remedy(remedy));
        }
        for (name, rows) in [("model", &raw.model), ("cloud", &raw.cloud)] {
            if rows.len() > MOST_POINTS {
                let remedy = format!("at most {MOST_POINTS} are taken; thin the points out");
                return Err(fault(&format!("too many points in `{name}`")).value(rows.len()).remedy(remedy));
            }
            if let Some(index) = rows.iter().position(|row| !row.iter().all(|x| x.is_finite())) {
                let what = format!("{name} point {index} is not finite");
                return Err(fault(&what).value(format!("{:?}", rows[index])).remedy("give finite numbers, in metres"));
            }
        }
        if let Some(index) = raw.model.iter().position(|row| row.iter().any(|x| x.abs() > FARTHEST)) {
            let what = format!("model point {index} is no part of an object");
            let remedy = format!("give metres, none beyond {FARTHEST:e}");
            return Err(fault(&what).value(format!("{:?}", raw.model[index])).remedy(remedy));
        }
        let is_sigma = |sigma: f64| (0.0..=MOST_SIGMA).contains(&sigma);
        let of_sigma = || format!("give metres, zero to {MOST_SIGMA:e}");
        if !is_sigma(raw.sigma) {
            return Err(fault("`sigma` is out of range").value(raw.sigma).remedy(of_sigma()));
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
                return Err(fault(&what).value(format!("{:?}", rows[index])).remedy(of_sigma()));
            }
        }
        let model: Vec<ModelPoint> = raw
            .model
            .iter()
            .enumerate()
            .map(|(index, at)| ModelPoint::exact(index.to_string(), Point::from(*at)))
            .collect();
        if let Some((i, k, _)) = nearest_two(&model, COINCIDENT) {
            let what = "two model points in one place";
            return Err(fault(what).value(format!("points {i} and {k}")).remedy("remove one"));
        }
        // Two points or fewer are answered "too few", whatever Δ says of them. The diameter is at least
        // the diagonal of the shell over √3: it is computed only where that does not settle it.
        let shell = Shell::around(model.iter().map(|point| point.at));
        let settled = shell.map_or(0.0, |shell| shell.max.distance(&shell.min)) / 12f64.sqrt();
        let large = model.len() > 2 && raw.delta > settled && raw.delta > diameter(&model) / 2.0;
        if !(raw.delta > 0.0 && raw.delta.is_finite()) || large {
            let greatest = diameter(&model) / 2.0;
            let remedy = format!("allowed: above 0, at most half the model's diameter, {greatest:.4} m");
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
            prior: raw.prior.map(|prior| prior.checked(text, file)).transpose()?,
            putative,
        })
    }

    /// What is legal and hardly meant, of the content of `file`: points too few for a pose, on a line, or too near each other for Δ to
    /// tell them apart; points without noise; too few putative pairs; coordinates that look like other units than metres.
    pub fn warnings(&self, file: &Path) -> Vec<Fault> {
        let warning = |what: &str, value: String, remedy: &str| Fault::new(what, file).value(value).remedy(remedy);
        let mut warnings = Vec::new();
        if self.model.len() < 3 {
            let value = format!("{} points", self.model.len());
            warnings.push(warning("the model has too few points", value, "a pose needs at least three"));
        }
        if self.cloud.is_empty() {
            warnings.push(warning("the cloud has no points", "0 points".to_owned(), "nothing can be found in it"));
        }
        if let Some((i, k, distance)) = nearest_two(&self.model, 2.0 * self.delta) {
            let value = format!("points {i} and {k}, {distance:.4} m apart, and Δ = {} m", self.delta);
            let remedy = "one may be taken for the other; keep model points 2Δ apart";
            warnings.push(warning("model points are nearer than 2Δ", value, remedy));
        }
        let places = self.model.iter().map(|point| point.at.coords);
        let ratio = if self.model.len() > 2 { second_ratio(places) } else { 1.0 };
        if ratio < ON_A_LINE {
            let value = format!("second extent over first {ratio:.1e}");
            let remedy = "a turn about the line changes nothing that is measured; add a point beside it";
            warnings.push(warning("the model's points lie on a line", value, remedy));
        }
        if let Some(exact) = self.cloud.iter().position(|point| point.position.covariance.trace() == 0.0) {
            let value = format!("cloud point {exact}, 0 m");
            let remedy = "nothing is measured better than a nanometre; give its standard deviation";
            warnings.push(warning("points without noise", value, remedy));
        }
        if let Some(pairs) = &self.putative {
            let mut models: Vec<usize> = pairs.iter().map(|(model, _)| *model).collect();
            models.sort_unstable();
            models.dedup();
            if models.len() < 3 {
                let value = format!("{} pairs of {} model points", pairs.len(), models.len());
                let remedy = "a pose needs pairs of three; leave `putative` out to have all considered";
                warnings.push(warning("`putative` has too few pairs", value, remedy));
            }
        }
        let extent =
            Shell::around(self.model.iter().map(|point| point.at)).map_or(0.0, |shell| shell.max.distance(&shell.min));
        if self.model.len() > 1 && !(SUSPICIOUS[0]..=SUSPICIOUS[1]).contains(&extent) {
            let value = format!("the model lies in a box of {extent} m from corner to corner");
            warnings.push(warning("units?", value, "coordinates are in metres"));
        }
        warnings
    }

    /// Stage 1: which cloud points may be which model points.
    ///
    /// # Errors
    /// There are too many to list.
    pub fn candidates(&self) -> Result<Candidates, Unidentified> {
        self.candidates_from(self.prior.as_ref())
    }

    fn candidates_from(&self, prior: Option<&Prior>) -> Result<Candidates, Unidentified> {
        let (n, m) = (self.model.len(), self.cloud.len());
        match &self.putative {
            Some(pairs) => Ok(Candidates::from_pairs(n, pairs.iter().copied())),
            None if n.saturating_mul(m) > MOST_CANDIDATES && prior.is_none() => Err(Unidentified::TooLarge {
                size: n.saturating_mul(m),
                what: "candidate pairs",
                most: MOST_CANDIDATES,
                bound: n.min(m),
            }),
            None => Ok(candidates(&self.model, &self.cloud, prior, &Gate::default(), None)),
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
        self.attempt_from(self.prior.as_ref(), (search, solver, acceptance), rng)
    }

    /// The same, and where nothing is found in the shells, in larger ones, then without: the object may have been
    /// displaced.
    pub fn attempt_widened(
        &self,
        search: &dyn Search,
        solver: &dyn Solver,
        acceptance: &Acceptance,
        rng: &mut dyn Rng,
    ) -> Attempt {
        let method = (search, solver, acceptance);
        let first = self.attempt_from(self.prior.as_ref(), method, rng);
        until_found(first, self.prior.as_ref(), |prior| self.attempt_from(prior, method, rng))
    }

    fn attempt_from(
        &self,
        prior: Option<&Prior>,
        (search, solver, acceptance): (&dyn Search, &dyn Solver, &Acceptance),
        rng: &mut dyn Rng,
    ) -> Attempt {
        let candidates = match self.candidates_from(prior) {
            Ok(candidates) => candidates,
            Err(refused) => return Attempt::without(refused),
        };
        let problem = Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &candidates,
            tolerance: Tolerance::Fixed(self.delta),
            prior,
        };
        reference(&problem, search, solver, acceptance, None, rng)
    }
}

impl RawPrior {
    fn checked(&self, text: &str, file: &Path) -> Result<Prior, Fault> {
        // As JSON is read, the name stands before its value.
        let line = |name: &str| text.find(name).map(|at| text[..at].lines().count().max(1));
        let matrix = Matrix4::from_fn(|row, column| self.t_cam_obj[row][column]);
        let camera_from_object = Transform::<Camera, Object>::from_matrix(&matrix).map_err(|error| {
            Fault::new(format!("`prior.T_cam_obj` is no rigid motion: {error}"), file).on_line(line("T_cam_obj"))
        })?;
        if !(self.shell_half_m > 0.0 && self.shell_half_m.is_finite()) {
            let fault = Fault::new("`prior.shell_half_m` is out of range", file);
            let fault = fault.on_line(line("shell_half_m")).value(self.shell_half_m);
            return Err(fault.remedy("give a positive half-size in metres"));
        }
        Ok(Prior { object_from_camera: camera_from_object.inverse(), bound: PriorBound::Box(self.shell_half_m) })
    }
}

/// What the JSON reader found wrong, with the nearest key to an unknown one.
fn json(file: &Path, error: &serde_json::Error) -> Fault {
    let full = error.to_string();
    let message = match full.split(" at line ").next().unwrap_or_default() {
        "trailing characters" => "a row of too many numbers, or something after the end",
        message => message,
    };
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

/// The problem in a file.
///
/// # Errors
/// As [`read_text`], the file has more than 48 MiB, or [`CoherenceProblem::parse`] refuses it.
pub fn read(file: &Path) -> Result<CoherenceProblem, Fault> {
    let bytes = std::fs::metadata(file).map_or(0, |about| about.len());
    if bytes > MOST_BYTES {
        let remedy = format!("at most {} MiB are read; thin the points out", MOST_BYTES >> 20);
        return Err(Fault::new("the problem is too large", file).value(format!("{bytes} bytes")).remedy(remedy));
    }
    CoherenceProblem::parse(&read_text(file)?, file)
}
