//! From a search's answer to a pose that is believed, or a refusal.

use nalgebra::Matrix3;
use rand::Rng;
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use crate::{Correspondence, Degenerate, Prior, Problem, Search, Solver, Unidentified};

/// When an identified set is believed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Acceptance {
    /// Least number of identified points.
    pub least_points: usize,
    /// Largest expected number of chance sets of the found size (a-contrario acceptance).
    pub chance_budget: f64,
    /// Confidence of the χ² tests of residuals and prior: a true set fails with one minus this.
    pub confidence: f64,
    /// Poses further apart than this (m, RMS over the model points) are different answers.
    pub alert_limit: f64,
}

impl Default for Acceptance {
    fn default() -> Self {
        Self { least_points: 3, chance_budget: 0.01, confidence: 0.999, alert_limit: 0.10 }
    }
}

/// A fix: the pose relative to the target and everything that supports it.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// The pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// Its covariance.
    pub covariance: Covariance6<Object, Camera>,
    /// The identified points.
    pub pairs: Vec<Correspondence>,
    /// For each pair, the indices into `pairs` of the points the solver used (all of them, or the triad's three).
    pub used: Vec<usize>,
    /// Root mean square of the residuals C·H − P over the pairs (m).
    pub residual_rms: f64,
    /// The set's support: what the search proved and what chance would give.
    pub optimal: bool,
    /// No admissible set has more pairs than this.
    pub size_bound: usize,
    /// Expected number of chance sets at least this large.
    pub expected_chance_sets: f64,
}

/// Another pose that explains the data as well.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// The pose.
    pub object_from_camera: Transform<Object, Camera>,
    /// Its pairs.
    pub pairs: Vec<Correspondence>,
    /// How well it explains the data: the log-likelihood of its residuals; larger is better.
    pub score: f64,
}

/// What came of one attempt at a fix.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// A pose that passed every test.
    Referenced(Box<Reference>),
    /// Several poses explain the data equally well.
    Ambiguous(Vec<Alternative>),
    /// No set of points was identified, or the set was not believed.
    Unidentified(Refusal),
    /// The identified points determine no pose.
    Degenerate(Degenerate),
}
