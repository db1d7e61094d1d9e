//! `manifest.json`: what made a run.

use std::{collections::BTreeMap, process::Command};

use serde::Serialize;

/// What made a run: enough to make it again and to know whether it would be the same.
#[derive(Debug, Serialize)]
pub(crate) struct Manifest {
    pub(crate) format: &'static str,
    pub(crate) state: &'static str,
    pub(crate) question: String,
    pub(crate) seafix: &'static str,
    pub(crate) git: Git,
    pub(crate) machine: Machine,
    pub(crate) threads: usize,
    pub(crate) seeds: BTreeMap<String, u64>,
    pub(crate) experiment: String,
    pub(crate) trials: Vec<TrialEntry>,
    pub(crate) inputs: Vec<Input>,
    pub(crate) outputs: BTreeMap<String, String>,
}

/// One trial of the run.
#[derive(Debug, Serialize)]
pub(crate) struct TrialEntry {
    pub(crate) name: String,
    pub(crate) log: String,
    pub(crate) frames: usize,
    pub(crate) configuration: String,
}

/// The inputs of one source.
#[derive(Debug, Serialize)]
pub(crate) struct Input {
    pub(crate) source: String,
    pub(crate) files: BTreeMap<String, String>,
}

/// The state of the code, where it was run from a checkout.
#[derive(Debug, Serialize)]
pub(crate) struct Git {
    pub(crate) commit: Option<String>,
    pub(crate) dirty: Option<bool>,
}

/// The kind of machine: what times depend on.
#[derive(Debug, Serialize)]
pub(crate) struct Machine {
    os: &'static str,
    architecture: &'static str,
    cores: Option<usize>,
    optimised: bool,
}

impl Git {
    /// The checkout this program was built in, as it is now; nothing for a program that was carried
    /// elsewhere.
    pub(crate) fn here() -> Self {
        let workspace = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let inside = std::env::current_exe().ok().zip(std::fs::canonicalize(workspace).ok());
        if !inside.is_some_and(|(program, workspace)| program.starts_with(workspace)) {
            return Self { commit: None, dirty: None };
        }
        let git = |arguments: &[&str]| {
            let output = Command::new("git").arg("-C").arg(env!("CARGO_MANIFEST_DIR")).args(arguments).output().ok()?;
            output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
        };
        Self {
            commit: git(&["rev-parse", "HEAD"]),
            dirty: git(&["status", "--porcelain"]).map(|changes| !changes.is_empty()),
        }
    }
}

impl Machine {
    pub(crate) fn here() -> Self {
        Self {
            os: std::env::consts::OS,
            architecture: std::env::consts::ARCH,
            cores: std::thread::available_parallelism().ok().map(usize::from),
            optimised: !cfg!(debug_assertions),
        }
    }
}
