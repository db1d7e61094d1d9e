//! The manifest of a run, `manifest.json`.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::Write,
    path::Path,
};

use seafix_component::{Fault, PartialFile, is_plain_name, read_text};
use serde::{Deserialize, Serialize};

use seafix_data::dataset::sha256;

use crate::{
    experiment::{Plan, Trial},
    git::Git,
    results::{Axes, AxisColumn, AxisValues},
    run::{
        group::Group,
        identity::{self, Input, Versions},
        options::Options,
        outcome::RunError,
        setting_sentence::sentence,
    },
    sweep::AxisValue,
};

/// The format that this version writes.
const FORMAT: &str = "seafix-manifest/2.1";

/// The manifest of a run: the information to reproduce it and to compare it with another.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Manifest {
    pub(crate) format: String,
    /// The state: `running` (or killed), `interrupted`, `finished`, or `shard` for a finished part.
    pub(crate) state: String,
    pub(crate) question: String,
    pub(crate) seafix: String,
    pub(crate) git: Git,
    pub(crate) machine: Machine,
    pub(crate) seeds: BTreeMap<String, u64>,
    pub(crate) experiment: String,
    pub(crate) trials: Vec<TrialEntry>,
    /// The columns of the varied settings in the tables; none in a manifest before 2.1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) axes: Vec<AxisColumn>,
    pub(crate) inputs: Vec<Input>,
    /// The SHA-256 of the output files; empty until the run is finished.
    pub(crate) outputs: BTreeMap<String, String>,
    /// Whether durations are logged.
    #[serde(default = "yes")]
    pub(crate) timed: bool,
    /// Whether every trial computed all of its stages. Otherwise shared stages were computed once, and each trial has
    /// their durations.
    #[serde(default = "yes")]
    pub(crate) separate: bool,
    /// The number of pieces of the run.
    #[serde(default)]
    pub(crate) pieces: usize,
    /// The part of the run, as `k/n`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) shard: Option<String>,
    /// The number of rows of the tables; zero until they are written.
    #[serde(default)]
    pub(crate) rows: usize,
    /// The hash of everything that determines the results; empty in a manifest before 1.2.
    #[serde(default)]
    pub(crate) identity: String,
    /// The versions of the components and of the shared code.
    #[serde(default)]
    pub(crate) versions: Versions,
}

/// The columns of the axes of a plan, with the sentences of their settings.
fn axis_columns(plan: &Plan) -> Vec<AxisColumn> {
    let Some(first) = plan.trials.first() else { return Vec::new() };
    let settings = toml::Table::try_from(&first.resolved).expect("a resolved experiment is a table of plain values");
    let column = |place: &AxisValue| match sentence(&place.key, &settings) {
        Some((doc, unit)) => AxisColumn::new(&place.key, unit.unwrap_or_default(), doc.to_owned()),
        None => AxisColumn::new(&place.key, "", format!("The case of the axis `{}`.", place.key)),
    };
    first.cell.iter().map(column).collect()
}

/// A value of a file in JSON; a number that JSON lacks is a text.
fn json(value: &toml::Value) -> serde_json::Value {
    match serde_json::to_value(value) {
        Ok(value) if !value.is_null() => value,
        _ => value.to_string().into(),
    }
}

fn yes() -> bool {
    true
}

/// A trial of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct TrialEntry {
    pub(crate) name: String,
    pub(crate) log: String,
    pub(crate) frames: usize,
    /// The value on every axis; none in a manifest before 2.1.
    #[serde(default, skip_serializing_if = "AxisValues::is_empty")]
    pub(crate) values: AxisValues,
    pub(crate) configuration: String,
}

/// The kind of machine, which affects durations.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Machine {
    os: String,
    architecture: String,
    cores: Option<usize>,
    optimised: bool,
}

impl Manifest {
    /// The manifest of a run to be made; nothing is written yet.
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
            values: trial.cell.iter().map(|place| (place.key.clone(), json(&place.value))).collect(),
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
            axes: axis_columns(plan),
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

    /// Reads the manifest of the run in `folder`.
    ///
    /// # Errors
    /// A folder without a manifest, or one of an unsupported version.
    pub(crate) fn read(folder: &Path) -> Result<Self, Fault> {
        let file = folder.join(NAME);
        let text =
            read_text(&file).map_err(|fault| without(folder).unwrap_or(fault.remedy("name the folder of a run")))?;
        let manifest: Self = serde_json::from_str(&text)
            .map_err(|error| Fault::new("a manifest that cannot be read", &file).on_line(error.line()).value(error))?;
        if !manifest.format.starts_with("seafix-manifest/2") {
            return Err(Fault::new("not a manifest of this version", &file).value(manifest.format).remedy(FORMAT));
        }
        // Manifests come from others, too, and names become paths.
        let logs = manifest.trials.iter().find(|trial| trial.log != format!("{}.mcap", trial.name)).map(|one| &one.log);
        let names = manifest.trials.iter().map(|trial| &trial.name).chain(manifest.outputs.keys());
        if let Some(name) =
            logs.or_else(|| names.into_iter().find(|name| !is_plain_name(name) || name.starts_with('.')))
        {
            let fault = Fault::new("a manifest with a name that is no file name in its folder", &file);
            return Err(fault.value(format!("`{name}`")).remedy("make the run again"));
        }
        Ok(manifest)
    }

    /// Writes the manifest into `folder` with a new state.
    pub(crate) fn write(&mut self, folder: &Path, state: &str) -> Result<(), RunError> {
        state.clone_into(&mut self.state);
        let text = serde_json::to_string_pretty(self).expect("a manifest has plain values") + "\n";
        let file = folder.join(NAME);
        let (partial, mut open) = PartialFile::create(&file).map_err(|error| RunError::unwritable(&file, error))?;
        let written = open.write_all(text.as_bytes()).and_then(|()| open.sync_all());
        written.map_err(|error| RunError::unwritable(partial.unfinished(), error))?;
        partial.finish().map_err(|error| RunError::unwritable(&file, error))
    }

    /// The columns of the varied settings, with their types.
    pub(crate) fn axis_columns(&self) -> Axes {
        Axes::of(&self.axes, self.trials.iter().map(|trial| &trial.values))
    }

    /// The faults of output files that differ from the manifest.
    fn changed(&self, folder: &Path) -> Vec<Fault> {
        let remedy = "`seafix run --overwrite` repeats the run";
        let fault = |(name, hash): (&String, &String)| {
            let path = folder.join(name);
            if !path.exists() {
                return Some(Fault::new("a missing file of the run", &path).remedy(remedy));
            }
            match sha256(&path) {
                Ok(found) if found == *hash => None,
                Ok(_) => Some(Fault::new("a changed file of the run", &path).value("another SHA-256").remedy(remedy)),
                Err(fault) => Some(fault),
            }
        };
        self.outputs.iter().filter_map(fault).collect()
    }

    /// Whether this run is complete and has the results that `other` would have. All its files must exist.
    pub(crate) fn stands_for(&self, other: &Self, folder: &Path) -> bool {
        let complete = self.state == "finished" && self.outputs.keys().all(|name| folder.join(name).is_file());
        complete && !self.identity.is_empty() && self.identity == other.identity
    }

    /// The reason for a repetition of this run as `other`, as a sentence.
    pub(crate) fn outdated(&self, other: &Self) -> String {
        if self.identity == other.identity {
            let why = if self.state == "finished" { "a file of it is missing" } else { "it was not finished" };
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

    /// The first difference of two manifests that can change results.
    pub(crate) fn differs(&self, other: &Self) -> Option<&'static str> {
        let trials = |manifest: &Self| -> Vec<(String, usize)> {
            manifest.trials.iter().map(|trial| (trial.name.clone(), trial.frames)).collect()
        };
        let differing = [
            ("the version of the program", self.seafix != other.seafix || self.format != other.format),
            ("the commit of the program, or its uncommitted changes", self.git.contradicts(&other.git)),
            ("the version of a component", self.versions != other.versions),
            ("the experiment", self.experiment != other.experiment),
            ("the trials", trials(self) != trials(other)),
            ("the configuration of a trial", self.trials != other.trials),
            ("the inputs", self.inputs != other.inputs),
            ("whether durations are logged", self.timed != other.timed),
            ("whether trials share stages", self.timed && self.separate != other.separate),
            ("the partition of the run into pieces", self.pieces != other.pieces),
        ];
        differing.into_iter().find(|(_, differs)| *differs).map(|(what, _)| what)
    }
}

/// The faults of the run in `folder`: unfinished, or files that differ from its manifest.
#[must_use]
pub fn check_run(folder: &Path) -> Vec<Fault> {
    let manifest = match Manifest::read(folder) {
        Ok(manifest) => manifest,
        Err(fault) => return vec![fault],
    };
    if ["finished", "shard"].contains(&&manifest.state[..]) {
        return manifest.changed(folder);
    }
    let fault = Fault::new("an unfinished run", folder).value(&manifest.state);
    vec![fault.remedy("`seafix run --resume` resumes it, `seafix recover` recovers the finished part")]
}

/// The identity of the complete run in `folder`, a hash of everything that determines its results; `None` without a
/// complete run or an identity.
#[must_use]
pub fn kept_identity(folder: &Path) -> Option<String> {
    let manifest = Manifest::read(folder).ok()?;
    (manifest.state == "finished" && !manifest.identity.is_empty()).then_some(manifest.identity)
}

/// Whether `folder` holds a run.
#[must_use]
pub fn is_run(folder: &Path) -> bool {
    folder.join(NAME).is_file()
}

/// The faults of logs, tables and pose graphs in `folder` whose SHA-256 differs from the manifest; none without the
/// manifest of a finished run.
///
/// # Errors
/// A manifest that cannot be read.
pub fn changed_outputs(folder: &Path) -> Result<Vec<Fault>, Fault> {
    if !folder.join(NAME).exists() {
        return Ok(Vec::new());
    }
    Ok(Manifest::read(folder)?.changed(folder))
}

/// The fault of a folder that has logs and no manifest.
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
        Some(lost) => Fault::new("logs recovered from an incomplete run", first)
            .value(lost)
            .remedy("use `seafix report` or `seafix compare` on them, or resume the run with --resume"),
        None => fault,
    })
}

/// The file name.
pub(crate) const NAME: &str = "manifest.json";

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
