//! The problem of a file.

use std::path::Path;

use nalgebra::{Matrix3, Matrix4};
use rand::Rng;
use seafix_component::{Fault, counted, number, read_text};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint};

use super::json::{RawPrior, Source};
use crate::{
    Acceptance, Attempt, BoundingBox, Candidates, Gate, ModelPoint, Prior, PriorBound, Problem, Rejected, Search,
    Solver, Tolerance, candidates, compute_fix, search_with_expanding_gates,
    site::{COINCIDENT, diameter, nearest_two},
};

/// The format that this reader supports.
pub const FORMAT: &str = "coherence-problem/1";
/// The maximum number of listed candidate pairs; no search could use more.
const MAX_CANDIDATES: usize = 4_000_000;
/// The number of model points whose pairs are listed between two counts.
const AT_A_TIME: usize = 8;

/// The largest file and cloud; they limit a problem to 500 MB of memory.
const MAX_BYTES: u64 = 48 << 20;
const MAX_POINTS: usize = 500_000;
/// The largest standard deviation (m); the cube of its variance is still finite.
const MAX_SIGMA: f64 = 1e15;
/// The largest model coordinate (m); a double resolves no micrometres beyond. A cloud may have outliers farther away.
const FARTHEST: f64 = 1e9;

/// A validated identification problem.
#[derive(Debug, Clone, PartialEq)]
pub struct CoherenceProblem {
    /// The name.
    pub id: String,
    /// The feature points, object frame.
    pub model: Vec<ModelPoint>,
    /// The measured points, camera frame.
    pub cloud: Vec<MeasuredPoint>,
    /// The distance tolerance Δ (m).
    pub delta: f64,
    /// The prior, if one is known.
    pub prior: Option<Prior>,
    /// The putative pairs (model, cloud), if given; no other pairs are considered.
    pub putative: Option<Vec<(usize, usize)>>,
}

impl CoherenceProblem {
    /// Parses a problem; `file` is the file named in faults.
    ///
    /// # Errors
    ///
    /// The first fault: invalid JSON, an unknown key or format, a number that is not finite or out of its range,
    /// coincident model points, an index out of range, or a prior that is not a rigid motion.
    pub fn parse(text: &str, file: &Path) -> Result<Self, Fault> {
        let source = Source { text, file };
        if text.trim_start().starts_with('[') {
            let fault = source.fault("a list instead of an object", &[]).value("`[`");
            return Err(fault.remedy(format!("give one `{FORMAT}` per file, in braces")));
        }
        let raw = source.read()?;
        for (name, rows) in [("model", &raw.model), ("cloud", &raw.cloud)] {
            if rows.len() > MAX_POINTS {
                let remedy = format!("at most {MAX_POINTS} are accepted; reduce the points");
                let fault = source.fault(format!("too many points in `{name}`"), &[name]);
                return Err(fault.value(rows.len()).remedy(remedy));
            }
        }
        if let Some(index) = raw.model.iter().position(|row| row.iter().any(|x| x.abs() > FARTHEST)) {
            let fault = source.fault(format!("model point {index} is out of range"), &["model", &index.to_string()]);
            return Err(fault.remedy(format!("give metres, at most {FARTHEST:e}")));
        }
        let is_sigma = |sigma: f64| (0.0..=MAX_SIGMA).contains(&sigma);
        let of_sigma = || format!("give metres, zero to {MAX_SIGMA:e}");
        if !is_sigma(raw.sigma) {
            return Err(source.fault("`sigma` is out of range", &["sigma"]).remedy(of_sigma()));
        }
        if let Some(rows) = &raw.sigma_xyz {
            if rows.len() != raw.cloud.len() {
                let value = format!("{} for {}", counted(rows.len(), "row"), counted(raw.cloud.len(), "cloud point"));
                let fault = source.fault("`sigma_xyz` has the wrong length", &["sigma_xyz"]);
                return Err(fault.value(value).remedy("give one row per cloud point"));
            }
            if let Some(index) = rows.iter().position(|row| !row.iter().all(|&sigma| is_sigma(sigma))) {
                let what = format!("row {index} of `sigma_xyz` is out of range");
                return Err(source.fault(what, &["sigma_xyz", &index.to_string()]).remedy(of_sigma()));
            }
        }
        let model: Vec<ModelPoint> = raw
            .model
            .iter()
            .enumerate()
            .map(|(index, at)| ModelPoint::exact(index.to_string(), Point::from(*at)))
            .collect();
        if let Some((i, k, _)) = nearest_two(&model, COINCIDENT) {
            let fault = source.fault("coincident model points", &["model", &k.to_string()]);
            return Err(fault.value(format!("points {i} and {k}")).remedy("remove one"));
        }
        // Models of up to two points are answered `too-few` for every Δ. The diameter is at least the diagonal of the
        // bounding box over √3: it is computed only if that bound does not suffice.
        let bounding_box = BoundingBox::around(model.iter().map(|point| point.at));
        let settled =
            bounding_box.map_or(0.0, |bounding_box| bounding_box.max.distance(&bounding_box.min)) / 12f64.sqrt();
        let large = model.len() > 2 && raw.delta > settled && raw.delta > diameter(&model) / 2.0;
        if !(raw.delta > 0.0) || large {
            let greatest = number(diameter(&model) / 2.0);
            let remedy = format!("allowed: above 0, at most half the model's diameter, {greatest} m");
            return Err(source.fault("`delta` is out of range", &["delta"]).remedy(remedy));
        }
        let putative = match raw.putative {
            None => None,
            Some(pairs) => {
                let out = pairs.iter().position(|[i, j]| *i >= raw.model.len() || *j >= raw.cloud.len());
                if let Some(index) = out {
                    let what = format!("putative pair {index} is out of range");
                    let points = counted(raw.cloud.len(), "cloud point");
                    let remedy = format!("there are {} model and {points}; count from 0", raw.model.len());
                    return Err(source.fault(what, &["putative", &index.to_string()]).remedy(remedy));
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
            prior: raw.prior.map(|prior| prior.0.checked(source)).transpose()?,
            putative,
        })
    }

    /// Stage 1: the candidates of each model point.
    ///
    /// # Errors
    ///
    /// [`Rejected::TooLarge`] if there are too many to list.
    pub fn candidates(&self) -> Result<Candidates, Rejected> {
        self.candidates_from(self.prior.as_ref())
    }

    fn candidates_from(&self, prior: Option<&Prior>) -> Result<Candidates, Rejected> {
        let (n, m) = (self.model.len(), self.cloud.len());
        if let Some(pairs) = &self.putative {
            return Ok(Candidates::from_pairs(n, pairs.iter().copied()));
        }
        let too_large = |size, what| Rejected::TooLarge { size, what, max: MAX_CANDIDATES, bound: n.min(m) };
        let all = n.saturating_mul(m);
        if all <= MAX_CANDIDATES {
            return Ok(candidates(&self.model, &self.cloud, prior, &Gate::default(), None));
        }
        if prior.is_none() {
            return Err(too_large(all, "candidate pairs"));
        }
        // Gates may hold more pairs than memory does: they are counted as they are listed.
        let (mut found, mut size) = (Candidates::default(), 0);
        for part in self.model.chunks(AT_A_TIME) {
            let part = candidates(part, &self.cloud, prior, &Gate::default(), None);
            size += part.pairs();
            if size > MAX_CANDIDATES {
                return Err(too_large(size, "candidate pairs or more"));
            }
            found.lists.extend(part.lists);
        }
        Ok(found)
    }

    /// One attempt at a fix.
    pub fn attempt(
        &self,
        search: &dyn Search,
        solver: &dyn Solver,
        acceptance: &Acceptance,
        rng: &mut dyn Rng,
    ) -> Attempt {
        self.attempt_from(self.prior.as_ref(), (search, solver, acceptance), rng)
    }

    /// One attempt at a fix with expanding gates, for an object that may be displaced.
    ///
    /// If the object is not found, the attempt is repeated with larger gates and then without a prior.
    pub fn attempt_with_expanding_gates(
        &self,
        search: &dyn Search,
        solver: &dyn Solver,
        acceptance: &Acceptance,
        rng: &mut dyn Rng,
    ) -> Attempt {
        let method = (search, solver, acceptance);
        let first = self.attempt_from(self.prior.as_ref(), method, rng);
        search_with_expanding_gates(first, self.prior.as_ref(), |prior| self.attempt_from(prior, method, rng))
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
        compute_fix(&problem, search, solver, acceptance, None, rng)
    }
}

impl RawPrior {
    fn checked(&self, source: Source<'_>) -> Result<Prior, Fault> {
        let matrix = Matrix4::from_fn(|row, column| self.t_cam_obj[row][column]);
        let camera_from_object = Transform::<Camera, Object>::from_matrix(&matrix).map_err(|error| {
            let fault =
                source.fault(format!("`prior.T_cam_obj` is not a rigid motion: {error}"), &["prior", "T_cam_obj"]);
            fault.remedy("give camera_from_object, a rotation and a translation")
        })?;
        if !(self.shell_half_m > 0.0) {
            let fault = source.fault("`prior.shell_half_m` is out of range", &["prior", "shell_half_m"]);
            return Err(fault.remedy("give a positive half-size in metres"));
        }
        Ok(Prior { object_from_camera: camera_from_object.inverse(), bound: PriorBound::Box(self.shell_half_m) })
    }
}

/// Reads the problem in a file.
///
/// # Errors
///
/// Those of [`read_text`] and [`CoherenceProblem::parse`], and a file of more than 48 MiB.
pub fn read(file: &Path) -> Result<CoherenceProblem, Fault> {
    let bytes = std::fs::metadata(file).map_or(0, |about| about.len());
    if bytes > MAX_BYTES {
        let remedy = format!("at most {} MiB are accepted; reduce the points", MAX_BYTES >> 20);
        return Err(Fault::new("problem file too large", file).value(format!("{bytes} bytes")).remedy(remedy));
    }
    CoherenceProblem::parse(&read_text(file)?, file)
}
