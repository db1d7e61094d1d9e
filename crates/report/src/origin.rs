//! The data behind a replay: those of the run whose log it reads.

use std::path::Path;

use seafix_log::{Reader, TrialHeader};

use crate::run::{Run, Trial};

/// Maximum number of replays of replays that are followed; a log that names itself must not be followed for ever.
const MAX_DEPTH: usize = 16;

/// Gives the trials of a replay the source of the original log, so that both are known to have the same frames.
///
/// The result states whether the run is a replay whose original log could be read.
pub(crate) fn restore(run: &mut Run) -> bool {
    let restored = run.trials.iter_mut().filter_map(|trial| of_trial(trial).then_some(())).count();
    restored == run.trials.len()
}

fn of_trial(trial: &mut Trial) -> bool {
    let Some(original) = original(&trial.header) else { return false };
    let mut configuration = table(&trial.header.configuration);
    if let Some(source) = table(&original.configuration).remove("source") {
        configuration.insert("source".to_owned(), source);
    }
    trial.header.source = original.source;
    trial.header.configuration = configuration.to_string();
    true
}

/// The header of the log at the beginning of a chain of replays; `None` for a trial that reads no log.
fn original(header: &TrialHeader) -> Option<TrialHeader> {
    let mut found: Option<TrialHeader> = None;
    for _ in 0..MAX_DEPTH {
        let Some(log) = read_log(found.as_ref().unwrap_or(header)) else { break };
        found = Some(Reader::open(Path::new(&log)).ok()?.header().clone());
    }
    found
}

/// The log that a trial reads in place of a source of its own.
fn read_log(header: &TrialHeader) -> Option<String> {
    let configuration = table(&header.configuration);
    let source = configuration.get("source")?;
    let is_log = source.get("name").and_then(toml::Value::as_str) == Some("mcap");
    source.get("path").and_then(toml::Value::as_str).filter(|_| is_log).map(str::to_owned)
}

fn table(configuration: &str) -> toml::Table {
    configuration.parse().unwrap_or_default()
}
