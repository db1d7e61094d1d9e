//! How a law is tried.

use std::fmt::Debug;

use proptest::{
    strategy::Strategy,
    test_runner::{Config, FileFailurePersistence, RngSeed, TestCaseError, TestCaseResult, TestRunner},
};

/// The seed of every law's draws, unless `PROPTEST_RNG_SEED` gives another.
const SEED: u64 = 1038;

/// Tries `holds` on `cases` draws of `strategy`; `PROPTEST_CASES` scales the number, 256 leaves it.
/// The number of cases tried.
///
/// # Panics
/// With the smallest counterexample found, when the law does not hold.
pub fn law<S: Strategy>(cases: u32, strategy: S, holds: impl Fn(S::Value) -> TestCaseResult) -> u32
where
    S::Value: Debug,
{
    let mut config = Config::default();
    let scaled = u64::from(cases) * u64::from(config.cases) / 256;
    config.cases = u32::try_from(scaled).unwrap_or(u32::MAX).max(1);
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(SEED);
    }
    config.failure_persistence = Some(Box::new(FileFailurePersistence::Direct("proptest-regressions/laws.txt")));
    config.max_local_rejects = u32::MAX;
    config.max_global_rejects = config.cases.saturating_mul(16);
    let cases = config.cases;
    let mut runner = TestRunner::new(config);
    if let Err(broken) = runner.run(&strategy, holds) {
        panic!("{broken}\n{runner}");
    }
    cases
}

/// Holds the draws themselves to account: `count` of `cases` met what a law is about, at least one in
/// so many. Few cases prove nothing and are let pass.
///
/// # Panics
/// When the draws hardly ever meet it.
pub fn not_idle(what: &str, count: u32, cases: u32, one_in: u32) {
    assert!(
        cases < 100 || u64::from(count) * u64::from(one_in) >= u64::from(cases),
        "{what}: {count} in {cases} cases"
    );
}

/// `value ≤ limit`, or the failure that says what was measured; a NaN fails.
///
/// # Errors
/// When it is not.
pub fn within(what: &str, value: f64, limit: f64) -> TestCaseResult {
    if value <= limit { Ok(()) } else { Err(TestCaseError::fail(format!("{what}: {value:e}, at most {limit:e}"))) }
}
