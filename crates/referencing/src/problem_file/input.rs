//! The problem of a file.

use std::path::Path;

use nalgebra::Matrix4;
use rand::Rng;
use seafix_component::{Fault, read_text};
use seafix_geometry::{Camera, MeasuredPoint, Object, Transform};

use super::{
    edges::{EdgeParts, ProblemEdges},
    json::{FORMAT, InBraces, RawPrior, Source},
    method::Method,
    parts::{Noise, Parts},
};
use crate::{
    accept::{acceptance::Acceptance, compute_fix, expanding_gates::search_with_expanding_gates, outcome::Attempt},
    candidates::{Candidates, Gate, candidates},
    problem::{Edges, Prior, PriorBound, Problem, Tolerance},
    search::identification::{Rejected, Search},
    site::model::ModelPoint,
    solve::solver::Solver,
};

/// The maximum number of listed candidate pairs; no search could use more.
const MAX_CANDIDATES: usize = 4_000_000;
/// The number of model points whose pairs are listed between two counts.
const AT_A_TIME: usize = 8;

/// The largest file; with the largest cloud it limits a problem to 500 MB of memory.
const MAX_BYTES: u64 = 48 << 20;

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
    ///
    /// A point that the file lists more than once takes part as its first.
    pub putative: Option<Vec<(usize, usize)>>,
    /// The straight edges of the model and the measured lines; empty for points alone.
    pub edges: ProblemEdges,
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
        let prior = raw.prior.map(|prior| prior.0.checked(source));
        let parts = Parts {
            id: raw.id.unwrap_or_default(),
            model: raw.model,
            cloud: raw.cloud,
            noise: Noise::Sigma(raw.sigma, raw.sigma_xyz),
            delta: Some(raw.delta),
            prior: None,
            putative: raw.putative,
            edges: EdgeParts {
                edges: raw.edges,
                lines: raw.lines.into_iter().map(|InBraces(line)| line).collect(),
                putative: raw.putative_edges,
            },
        };
        let problem = parts.checked().map_err(|invalid| {
            let path: Vec<&str> = invalid.path.iter().map(String::as_str).collect();
            let fault = source.fault(invalid.what, &path).remedy(invalid.remedy);
            match invalid.value {
                Some(value) => fault.value(value),
                None => fault,
            }
        })?;
        Ok(Self { prior: prior.transpose()?, ..problem })
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
        self.attempt_from(self.prior.as_ref(), self.tolerance(), (search, solver, acceptance), rng)
    }

    /// One attempt at a fix by a method, with a tolerance in place of the problem's Δ.
    ///
    /// A method with expanding gates repeats an attempt without a fix with larger gates and then without a prior, for
    /// an object that may be displaced.
    pub fn attempt_within(&self, tolerance: Tolerance, method: &Method<'_>, rng: &mut dyn Rng) -> Attempt {
        let stages = (method.search.1, method.solver.1, method.acceptance);
        let first = self.attempt_from(self.prior.as_ref(), tolerance, stages, rng);
        if !method.expand_gates {
            return first;
        }
        search_with_expanding_gates(first, self.prior.as_ref(), |prior| {
            self.attempt_from(prior, tolerance, stages, rng)
        })
    }

    /// The problem's Δ as the tolerance of a search.
    pub fn tolerance(&self) -> Tolerance {
        Tolerance::Fixed(self.delta)
    }

    fn attempt_from(
        &self,
        prior: Option<&Prior>,
        tolerance: Tolerance,
        (search, solver, acceptance): (&dyn Search, &dyn Solver, &Acceptance),
        rng: &mut dyn Rng,
    ) -> Attempt {
        let candidates = match self.candidates_from(prior) {
            Ok(candidates) => candidates,
            Err(rejected) => return Attempt::without(rejected),
        };
        let of_edges = self.edges.candidates(&self.model, prior);
        let problem = Problem {
            model: &self.model,
            cloud: &self.cloud,
            candidates: &candidates,
            tolerance,
            prior,
            edges: Edges { model: &self.edges.model, lines: &self.edges.lines, candidates: &of_edges },
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
