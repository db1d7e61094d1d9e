//! `manifest.json`: what made a run.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::Write,
    path::Path,
    process::Command,
    sync::OnceLock,
};

use seafix_component::{Fault, read_text};
use serde::{Deserialize, Serialize};

use seafix_data::dataset::sha256;

use crate::{
    Plan, Trial,
    identity::{self, Versions},
    run::{Group, Options, RunError},
};

/// The format that this version writes.
const FORMAT: &str = "seafix-manifest/2";

/// What made a run: enough to make it again and to know whether it would be the same.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Manifest {
    pub(crate) format: String,
    /// `running` (or killed), `interrupted`, `finished`; of a part that is to be merged `shard`.
    pub(crate) state: String,
    pub(crate) question: String,
    pub(crate) seafix: String,
    pub(crate) git: Git,
    pub(crate) machine: Machine,
    pub(crate) seeds: BTreeMap<String, u64>,
    pub(crate) experiment: String,
    pub(crate) trials: Vec<TrialEntry>,
    pub(crate) inputs: Vec<Input>,
    /// SHA-256 of what was written; empty until the run is finished.
    pub(crate) outputs: BTreeMap<String, String>,
    /// Whether durations are logged.
    #[serde(default = "yes")]
    pub(crate) timed: bool,
    /// Whether every trial computed all of its stages itself; else the durations of stages that trials share are those of
    /// one computation.
    #[serde(default = "yes")]
    pub(crate) separate: bool,
    /// Into how many pieces the run is cut.
    #[serde(default)]
    pub(crate) pieces: usize,
    /// Which part of the run this is, as `k/n`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) shard: Option<String>,
    /// Rows of the tables, once they are there.
    #[serde(default)]
    pub(crate) rows: usize,
    /// The hash of everything that the results depend on; empty in a manifest before 1.2.
    #[serde(default)]
    pub(crate) identity: String,
    /// The versions of the components and of the shared code that the results depend on.
    #[serde(default)]
    pub(crate) versions: Versions,
}

fn yes() -> bool {
    true
}

/// One trial of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct TrialEntry {
    pub(crate) name: String,
    pub(crate) log: String,
    pub(crate) frames: usize,
    pub(crate) configuration: String,
}

/// The inputs of one source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Input {
    pub(crate) source: String,
    /// What was odd about them, pairs left out among it.
    #[serde(default)]
    pub(crate) warnings: Vec<String>,
    pub(crate) files: BTreeMap<String, String>,
}

/// The state of the code, where it was run from a checkout.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Git {
    pub(crate) commit: Option<String>,
    pub(crate) dirty: Option<bool>,
}

/// The kind of machine: what times depend on.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Machine {
    os: String,
    architecture: String,
    cores: Option<usize>,
    optimised: bool,
}

impl Manifest {
    /// What is to be run; nothing is written yet.
    ///
    /// # Errors
    /// An input that cannot be read.
    pub(crate) fn new(plan: &Plan, options: &Options, groups: &[Group<'_>], pieces: usize) -> Result<Self, Fault> {
        let mut inputs = Vec::new();
        for group in groups {
            let mut files: BTreeMap<String, String> = group.sequence.inputs()?.into_iter().collect();
            files.extend(group.pose_graphs_read());
            let warnings = group.sequence.warnings().iter().map(ToString::to_string).collect();
            inputs.push(Input { source: group.sequence.name().to_owned(), warnings, files });
        }
        let versions = identity::versions(groups, &inputs);
        let frames = |trial: &Trial| {
            let group = groups.iter().find(|group| group.trials.iter().any(|other| other.name == trial.name));
            group.map_or(0, |group| group.sequence.frames())
        };
        let entry = |trial: &Trial| TrialEntry {
            name: trial.name.clone(),
            log: format!("{}.mcap", trial.name),
            frames: frames(trial),
            configuration: trial.resolved.to_toml(),
        };
        Ok(Self {
            format: FORMAT.to_owned(),
            state: String::new(),
            question: plan.experiment.question.clone(),
            seafix: env!("CARGO_PKG_VERSION").to_owned(),
            git: Git::here(),
            machine: Machine::here(),
            seeds: BTreeMap::from([("experiment".to_owned(), plan.experiment.seed)]),
            experiment: plan.experiment.to_toml(),
            trials: plan.trials.iter().map(entry).collect(),
            identity: identity::identity(plan, groups, &inputs, &versions),
            versions,
            inputs,
            outputs: BTreeMap::new(),
            timed: options.timed,
            separate: options.separate,
            pieces,
            shard: options.shard.map(|shard| shard.to_string()),
            rows: 0,
        })
    }

    /// The manifest of the run in `folder`.
    ///
    /// # Errors
    /// A folder that has none, or one that this version cannot read.
    pub(crate) fn read(folder: &Path) -> Result<Self, Fault> {
        let file = folder.join(NAME);
        let text =
            read_text(&file).map_err(|fault| without(folder).unwrap_or(fault.remedy("name the folder of a run")))?;
        let manifest: Self = serde_json::from_str(&text)
            .map_err(|error| Fault::new("a manifest that cannot be read", &file).on_line(error.line()).value(error))?;
        if !manifest.format.starts_with("seafix-manifest/2") {
            return Err(Fault::new("not a manifest of this version", &file).value(manifest.format).remedy(FORMAT));
        }
        Ok(manifest)
    }

    /// Writes it into `folder`, with a new state.
    pub(crate) fn write(&mut self, folder: &Path, state: &str) -> Result<(), RunError> {
        state.clone_into(&mut self.state);
        let text = serde_json::to_string_pretty(self).expect("a manifest is plain data") + "\n";
        let (file, partial) = (folder.join(NAME), folder.join(format!("{NAME}.partial")));
        let write = || {
            let mut file = std::fs::File::create(&partial)?;
            file.write_all(text.as_bytes())?;
            file.sync_all()
        };
        write().map_err(|error| RunError::unwritable(&partial, error))?;
        std::fs::rename(&partial, &file).map_err(|error| RunError::unwritable(&file, error))
    }

    /// What of the files in `folder` is not as the run wrote it, a fault each.
    fn changed(&self, folder: &Path) -> Vec<Fault> {
        let remedy = "`seafix run --overwrite` makes it again";
        let fault = |(name, hash): (&String, &String)| {
            let path = folder.join(name);
            if !path.exists() {
                return Some(Fault::new("a file of the run that is gone", &path).remedy(remedy));
            }
            match sha256(&path) {
                Ok(found) if found == *hash => None,
                Ok(_) => {
                    Some(Fault::new("not the file that the run wrote", &path).value("another SHA-256").remedy(remedy))
                }
                Err(fault) => Some(fault),
            }
        };
        self.outputs.iter().filter_map(fault).collect()
    }

    /// Whether this run is complete, with all its files, and has the results that `other` would have.
    pub(crate) fn stands_for(&self, other: &Self, folder: &Path) -> bool {
        let complete = self.state == "finished" && self.outputs.keys().all(|name| folder.join(name).is_file());
        complete && !self.identity.is_empty() && self.identity == other.identity
    }

    /// The reason why `other` is made again in place of this run, for people.
    pub(crate) fn outdated(&self, other: &Self) -> String {
        if self.identity == other.identity {
            let why = if self.state == "finished" { "a file of it is missing" } else { "it did not end" };
            return why.to_owned();
        }
        let version = |versions: &Versions, part: &String| versions.get(part).map_or("none".to_owned(), u32::to_string);
        let changed = self.versions.iter().chain(&other.versions).map(|(part, _)| part);
        let changed: BTreeSet<&String> =
            changed.filter(|part| self.versions.get(*part) != other.versions.get(*part)).collect();
        if changed.is_empty() || self.versions.is_empty() {
            return "another configuration, input or experiment file".to_owned();
        }
        let reported = changed
            .into_iter()
            .map(|part| format!("{part} {} → {}", version(&self.versions, part), version(&other.versions, part)));
        reported.collect::<Vec<_>>().join(", ")
    }

    /// What keeps this run from being the same as another: which of the things that the answer depends on differs.
    pub(crate) fn differs(&self, other: &Self) -> Option<&'static str> {
        let trials = |manifest: &Self| -> Vec<(String, usize)> {
            manifest.trials.iter().map(|trial| (trial.name.clone(), trial.frames)).collect()
        };
        let differing = [
            ("the version of the program", self.seafix != other.seafix || self.format != other.format),
            ("the commit of the program, or whether it has changes", self.git.contradicts(&other.git)),
            ("the version of a component", self.versions != other.versions),
            ("the experiment", self.experiment != other.experiment),
            ("the trials", trials(self) != trials(other)),
            ("the configuration of a trial", self.trials != other.trials),
            ("the inputs", self.inputs != other.inputs),
            ("whether durations are logged", self.timed != other.timed),
            ("whether trials share stages", self.timed && self.separate != other.separate),
            ("how the run is cut into pieces", self.pieces != other.pieces),
        ];
        differing.into_iter().find(|(_, differs)| *differs).map(|(what, _)| what)
    }
}

/// Everything that is wrong with the run in `folder`: that it did not end, and what of its files is not as it wrote them.
#[must_use]
pub fn check_run(folder: &Path) -> Vec<Fault> {
    let manifest = match Manifest::read(folder) {
        Ok(manifest) => manifest,
        Err(fault) => return vec![fault],
    };
    if ["finished", "shard"].contains(&&manifest.state[..]) {
        return manifest.changed(folder);
    }
    let fault = Fault::new("a run that has not ended", folder).value(&manifest.state);
    vec![fault.remedy("`seafix run --resume` goes on with it, `seafix recover` saves what is there")]
}

/// The identity of the complete run in `folder`, where there is one and its manifest states it: a hash of everything that its
/// results depend on.
#[must_use]
pub fn kept_identity(folder: &Path) -> Option<String> {
    let manifest = Manifest::read(folder).ok()?;
    (manifest.state == "finished" && !manifest.identity.is_empty()).then_some(manifest.identity)
}

/// Whether `folder` is that of a run.
#[must_use]
pub fn is_run(folder: &Path) -> bool {
    folder.join(NAME).is_file()
}

/// Logs, tables and networks of the run in `folder` that are not as the run wrote them, by the SHA-256 of its manifest; none
/// where it has no manifest, or has not ended.
///
/// # Errors
/// A manifest that cannot be read.
pub fn changed_outputs(folder: &Path) -> Result<Vec<Fault>, Fault> {
    if !folder.join(NAME).exists() {
        return Ok(Vec::new());
    }
    Ok(Manifest::read(folder)?.changed(folder))
}

/// What is wrong with a folder that has logs and no manifest.
pub(crate) fn without(folder: &Path) -> Option<Fault> {
    let logs = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let mut logs: Vec<_> = logs.filter(|path| path.extension().is_some_and(|end| end == "mcap")).collect();
    logs.sort();
    let lacking = |path: &Path| {
        let mut reader = seafix_log::Reader::open(path).ok()?.without_images().without_inputs();
        reader.for_each_frame(drop).ok()?;
        reader.recovered().map(str::to_owned)
    };
    let fault = Fault::new("logs without a manifest", folder).remedy("name the folder of a finished run");
    let first = logs.first()?;
    Some(match lacking(first) {
        Some(lost) => Fault::new("logs that were saved of a run that is not whole", first)
            .value(lost)
            .remedy("`seafix report` and `seafix compare` read them; to have the run, --resume it"),
        None => fault,
    })
}

/// The name of its file.
pub(crate) const NAME: &str = "manifest.json";

impl Git {
    /// The last commit that changed this program, in the checkout it was built in, as that is now, and whether there are
    /// changes since; nothing for a program that was carried elsewhere. What else a commit changes, reports for instance,
    /// leaves runs the same.
    pub(crate) fn here() -> Self {
        static HERE: OnceLock<Git> = OnceLock::new();
        HERE.get_or_init(Self::find).clone()
    }

    fn find() -> Self {
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
            commit: git(&["log", "-1", "--format=%H", "--", ":/crates", ":/Cargo.toml", ":/Cargo.lock"]),
            dirty: git(&["status", "--porcelain", "--", ":/crates", ":/Cargo.toml", ":/Cargo.lock"])
                .map(|changes| !changes.is_empty()),
        }
    }

    /// Whether both say something, and not the same. What `git` could not tell, short of memory for instance or not
    /// installed, is no difference: it must not keep a run from being resumed.
    fn contradicts(&self, other: &Self) -> bool {
        fn differ<T: PartialEq>(a: Option<&T>, b: Option<&T>) -> bool {
            a.zip(b).is_some_and(|(a, b)| a != b)
        }
        differ(self.commit.as_ref(), other.commit.as_ref()) || differ(self.dirty.as_ref(), other.dirty.as_ref())
    }
}

impl Machine {
    pub(crate) fn here() -> Self {
        Self {
            os: std::env::consts::OS.to_owned(),
            architecture: std::env::consts::ARCH.to_owned(),
            cores: std::thread::available_parallelism().ok().map(usize::from),
            optimised: !cfg!(debug_assertions),
        }
    }
}
