//! How a command ends.

use seafix_component::Fault;
use seafix_experiment::RunError;

use crate::signals;

/// Done; refused frames and problems included.
pub(crate) const DONE: u8 = 0;
/// Done, and something was found: `check` saw faults.
pub(crate) const FINDINGS: u8 = 1;
/// The command line or an experiment file is wrong.
pub(crate) const USAGE: u8 = 2;
/// Something they refer to is wrong: a data set, a site, a problem, an image, a log.
pub(crate) const INPUT: u8 = 3;
/// The output or the machine failed.
pub(crate) const OUTPUT: u8 = 4;

/// A command that could not do its work: the exit code and one line for each fault.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) code: u8,
    pub(crate) lines: Vec<String>,
}

impl Failure {
    pub(crate) fn new(code: u8, line: impl ToString) -> Self {
        Self { code, lines: vec![line.to_string()] }
    }

    pub(crate) fn faults(code: u8, faults: &[Fault]) -> Self {
        Self { code, lines: faults.iter().map(ToString::to_string).collect() }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Input(faults) => Self::faults(INPUT, &faults),
            RunError::Output(fault) => Self::new(OUTPUT, fault),
            RunError::Log(error) => Self::new(OUTPUT, error),
            RunError::Interrupted(_) => Self::new(signals::exit_code(), error),
        }
    }
}

/// What a command returns: its exit code, or why it failed.
pub(crate) type Ended = Result<u8, Failure>;
