//! Limits of searches.

use seafix_component::in_range;

/// Default budget of a search: pair tests beyond the tests that build its graph.
pub(crate) const BUDGET: u64 = 10_000_000;

/// Checks the two limits that most searches have.
pub(super) fn bounded(budget: u64, max_pairs: usize) -> Result<(), String> {
    in_range(budget > 0, "budget", budget, "1 or more pair tests")?;
    in_range(max_pairs >= NEEDED, "max-pairs", max_pairs, "3 or more candidate pairs")
}

/// Minimum number of pairs that determine a pose.
pub(crate) const NEEDED: usize = 3;

/// Maximum number of sets of the largest size that are compared to choose the best.
pub(super) const MAX_TIES: usize = 4096;
