//! Execution of laws.

use std::{env, fmt::Debug, path::Path};

use proptest::{
    strategy::Strategy,
    test_runner::{Config, FileFailurePersistence, RngSeed, TestCaseError, TestCaseResult, TestRunner},
};

/// The seed of every law, unless `PROPTEST_RNG_SEED` gives another.
const SEED: u64 = 1038;

/// The number of cases of a law, or of draws of a Monte Carlo, whose full number is `full`.
///
/// `PROPTEST_CASES` scales the number; 256 gives the full number. The default is an eighth, at least 32 and at most the
/// full number.
///
/// # Panics
/// If `PROPTEST_CASES` is not a number.
#[must_use]
pub fn cases(full: u32) -> u32 {
    let Ok(asked) = env::var("PROPTEST_CASES") else { return full.min(32.max(full / 8)) };
    let asked: u64 = asked.parse().expect("PROPTEST_CASES is a number");
    u32::try_from(u64::from(full) * asked / 256).unwrap_or(u32::MAX).max(1)
}

/// Tests `holds` on [`cases`] values of `strategy` and returns their number.
///
/// # Panics
/// If the law does not hold, with the smallest counterexample found.
pub fn law<S: Strategy>(full: u32, strategy: S, holds: impl Fn(S::Value) -> TestCaseResult) -> u32
where
    S::Value: Debug,
{
    let cases = cases(full);
    let mut config = Config { cases, ..Config::default() };
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(SEED);
    }
    // A program that runs a law elsewhere keeps no failures.
    let kept = Path::new("proptest-regressions").is_dir().then_some("proptest-regressions/laws.txt");
    config.failure_persistence = kept.map(|file| Box::new(FileFailurePersistence::Direct(file)) as Box<_>);
    // Four times the number of cases, the default, leaves large counterexamples.
    config.max_shrink_iters = 4096;
    config.max_local_rejects = u32::MAX;
    config.max_global_rejects = cases.saturating_mul(16);
    let mut runner = TestRunner::new(config);
    if let Err(broken) = runner.run(&strategy, holds) {
        panic!("{broken}\n{runner}");
    }
    cases
}

/// Whether the number of cases suffices to require its subject for any seed; a smaller number does so for the fixed
/// seed.
#[must_use]
pub fn distinctive(cases: u32) -> bool {
    cases >= 100 || cases >= 8 && env::var_os("PROPTEST_RNG_SEED").is_none()
}

/// Requires that at least one in `one_in` of the `cases` tested the subject of a law.
///
/// # Panics
/// If the draws hardly ever do.
pub fn not_idle(what: &str, count: u32, cases: u32, one_in: u32) {
    assert!(
        !distinctive(cases) || u64::from(count) * u64::from(one_in) >= u64::from(cases),
        "{what}: {count} in {cases} cases"
    );
}

/// Checks `value ≤ limit`; the failure has the value. A NaN fails.
///
/// # Errors
/// If it does not hold.
pub fn within(what: &str, value: f64, limit: f64) -> TestCaseResult {
    if value <= limit { Ok(()) } else { Err(TestCaseError::fail(format!("{what}: {value:e}, at most {limit:e}"))) }
}
