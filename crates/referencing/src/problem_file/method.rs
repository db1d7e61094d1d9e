//! The method that answers a problem.

use crate::{accept::acceptance::Acceptance, search::identification::Search, solve::solver::Solver};

/// The search, solver and acceptance that answer a problem.
#[derive(Debug, Clone, Copy)]
pub struct Method<'a> {
    /// The search and its registered name.
    pub search: (&'a str, &'a dyn Search),
    /// The solver and its registered name.
    pub solver: (&'a str, &'a dyn Solver),
    /// The limits of the acceptance tests.
    pub acceptance: &'a Acceptance,
    /// Whether to repeat the search with expanding gates ([`super::CoherenceProblem::attempt_within`]).
    pub expand_gates: bool,
}
