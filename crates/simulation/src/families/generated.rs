//! A generated problem with its truth.

use crate::families::{problem::GeneratedProblem, truth::GeneratedTruth};

/// A generated problem with its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Generated {
    /// The problem, as a method receives it.
    pub problem: GeneratedProblem,
    /// The truth, for evaluation only.
    pub truth: GeneratedTruth,
}
