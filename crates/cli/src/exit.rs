//! Exit codes and failures of commands.

use seafix_component::Fault;
use seafix_experiment::RunError;

use crate::signals;

/// Success; rejected frames and problems included.
pub(crate) const DONE: u8 = 0;
/// Success with findings: `check` listed faults, `diff` differences.
pub(crate) const FINDINGS: u8 = 1;
/// An invalid command line or experiment file.
pub(crate) const USAGE: u8 = 2;
/// An invalid input that they refer to: a data set, a site, a problem, an image, a log.
pub(crate) const INPUT: u8 = 3;
/// A failure of the output or of the machine.
pub(crate) const OUTPUT: u8 = 4;

/// The failure of a command: its exit code and one line for each fault.
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

/// The result of a command: its exit code, or its failure.
pub(crate) type Ended = Result<u8, Failure>;
