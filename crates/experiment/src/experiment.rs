//! Experiment files and their resolution into trials.

use std::{
    io::Read as _,
    path::{Path, PathBuf},
};

use hmac_sha256::Hash as Sha256;
use seafix_component::{BuildError, Choice, Fault, Part, Settings, inside, is_plain_name, read_text, take_out};
use seafix_log::looks_like;
use seafix_referencing::TargetKind;
use serde::{Deserialize, Serialize};

use seafix::{NavigationStack, Pipeline, PipelineError, PipelineSettings};
use seafix_data::{
    dataset::hex,
    source::{SOURCES, Source},
};

use crate::{
    keyframes,
    logging::Logging,
    navigation::Navigation,
    parse::{self, Read, Texts},
    published::Published,
    sweep::{self, Axis, AxisValue, Cell},
};

/// An experiment file: a question, a source, a pipeline, and the settings that vary.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// The question, an English sentence.
    pub question: String,
    /// The seed of all random numbers of the experiment.
    #[serde(default)]
    pub seed: u64,
    /// The number of repetitions with different seeds; all trials of a repetition see the same frames.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub repetitions: u32,
    /// The source of the frames.
    pub source: Choice,
    /// The pipeline from a sensor frame to a fix.
    #[serde(default)]
    pub pipeline: PipelineSettings,
    /// The navigation between fixes; without it every frame is processed separately.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub navigation: Option<Navigation>,
    /// The content of the logs.
    #[serde(default, skip_serializing_if = "Logging::is_default")]
    pub log: Logging,
    /// Figures of the literature beside which the report sets its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub published: Vec<Published>,
    /// The axes of the grid; each point of the grid is a trial.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub vary: Vec<Axis>,
}

fn once() -> u32 {
    1
}

fn is_once(repetitions: &u32) -> bool {
    *repetitions == 1
}

impl Experiment {
    /// The axes of the grid, with the seed first if there are repetitions.
    fn axes(&self) -> Vec<Axis> {
        let seeds = (0..u64::from(self.repetitions)).map(|k| toml::Value::Integer((self.seed + k) as i64)).collect();
        let repeated = (self.repetitions > 1).then(|| Axis::listed("seed", seeds));
        repeated.into_iter().chain(self.vary.iter().cloned()).collect()
    }

    /// All invalid settings.
    fn invalid(&self) -> Vec<InvalidSetting> {
        let source = SOURCES.faults(&self.source).into_iter().map(|error| InvalidSetting::new(&["source"], error));
        let pipeline = self.pipeline.invalid().into_iter().map(InvalidSetting::pipeline);
        let navigation = self.navigation.iter().flat_map(Navigation::invalid).map(InvalidSetting::navigation);
        source.chain(pipeline).chain(navigation).collect()
    }

    /// The invalid settings outside the tables of the pipeline and of components: dotted path, fault and remedy.
    fn invalid_itself(&self) -> Vec<(String, &'static str, String)> {
        let mut invalid = Vec::new();
        if self.question.trim().is_empty() {
            let remedy = "state the question of the experiment in one sentence";
            invalid.push(("question".to_owned(), "no question", remedy.to_owned()));
        }
        for (index, of) in self.published.iter().enumerate() {
            let Some((key, what, remedy)) = of.invalid() else { continue };
            invalid.push((format!("published.{index}.{key}"), what, remedy));
        }
        if self.seed > i64::MAX as u64 - u64::from(self.repetitions) {
            let remedy = "give at most 2^63 - 1, the limit of TOML";
            invalid.push(("seed".to_owned(), "a seed too large", remedy.to_owned()));
        }
        if self.repetitions == 0 {
            invalid.push(("repetitions".to_owned(), "no repetition", "give 1 or more".to_owned()));
        }
        if self.repetitions > 1 && self.vary.iter().any(|axis| axis.key == "seed") {
            let remedy = "remove `repetitions` or the axis `seed`";
            invalid.push(("repetitions".to_owned(), "repetitions beside an axis `seed`", remedy.to_owned()));
        }
        invalid
    }

    /// The dotted paths of all invalid settings, with messages `FAULT; REMEDY`.
    pub(crate) fn rejected(&self) -> Vec<(String, String)> {
        let itself = self.invalid_itself().into_iter().map(|(path, what, remedy)| (path, format!("{what}; {remedy}")));
        let axes = sweep::check(&self.vary, |path, _, what| Fault::new(what, Path::new(&path.join("."))));
        let axes = axes.into_iter().map(|fault| {
            let path = fault.file.to_string_lossy().into_owned();
            // The remedy of a range concerns all of its numbers, and is no range of one.
            let message = if fault.remedy.is_empty() { fault.what.replace("; give", ":") } else { fault.remedy };
            (path, message)
        });
        let settings = self.invalid().into_iter().map(|invalid| (invalid.path.join("."), invalid.message));
        itself.chain(axes).chain(settings).collect()
    }

    /// The experiment for a data set: the default pipeline on all of its frames.
    pub fn of_dataset(folder: &Path, name: &str) -> Self {
        Self {
            question: format!("How well does the default pipeline reference {name}?"),
            seed: 0,
            repetitions: 1,
            source: Choice::named("dataset").with("path", folder.to_string_lossy().into_owned()),
            pipeline: PipelineSettings::default(),
            navigation: None,
            log: Logging::default(),
            published: Vec::new(),
            vary: Vec::new(),
        }
    }

    /// The experiment as TOML.
    pub(crate) fn to_toml(&self) -> String {
        toml::to_string(self).expect("an experiment is a table of plain values")
    }

    /// The same experiment with every default written out.
    fn resolved(&self) -> Result<Self, InvalidSetting> {
        let source = SOURCES.resolve(&self.source).map_err(|error| InvalidSetting::new(&["source"], error))?;
        let pipeline = self.pipeline.resolved().map_err(InvalidSetting::pipeline)?;
        let navigation =
            self.navigation.as_ref().map(Navigation::resolved).transpose().map_err(InvalidSetting::navigation)?;
        Ok(Self { source, pipeline, navigation, ..self.clone() })
    }
}

/// A resolved experiment with its trials, ready to run.
#[derive(Debug)]
pub struct Plan {
    /// The short name: that of the file or folder.
    pub name: String,
    /// The folder that relative paths start from.
    pub folder: PathBuf,
    /// The command that runs it.
    pub command: String,
    /// The experiment with its axes.
    pub experiment: Experiment,
    /// One trial for each point of the grid.
    pub trials: Vec<Trial>,
}

/// A trial: one resolved configuration.
#[derive(Debug)]
pub struct Trial {
    /// The name: a number and the trial's values on the axes.
    pub name: String,
    /// The value on each axis.
    pub cell: Vec<AxisValue>,
    /// The resolved experiment of this trial without axes; running it reproduces the trial.
    pub resolved: Experiment,
    /// The source of the frames.
    pub source: Box<dyn Source>,
    /// The pipeline.
    pub stages: Pipeline,
    /// The navigation stack, if the experiment navigates.
    pub navigation_stack: Option<NavigationStack>,
}

/// An invalid setting with its path in the file.
struct InvalidSetting {
    path: Vec<String>,
    part: Part,
    /// The existing component whose name is closest to an unknown name.
    near: Option<&'static str>,
    message: String,
}

impl InvalidSetting {
    fn new(path: &[&str], error: BuildError) -> Self {
        let mut path: Vec<String> = path.iter().map(|&step| step.to_owned()).collect();
        path.extend(error.key().into_iter().flat_map(steps));
        Self { path, part: error.part(), near: error.near(), message: error.to_string() }
    }

    /// The fault `message` for this part of the setting at `path`.
    fn of(path: &[&str], part: Part, message: String) -> Self {
        Self { path: path.iter().map(|&step| step.to_owned()).collect(), part, near: None, message }
    }

    fn pipeline(error: PipelineError) -> Self {
        Self::below("pipeline", error)
    }

    fn navigation(error: PipelineError) -> Self {
        Self::below("navigation", error)
    }

    fn below(table: &str, error: PipelineError) -> Self {
        let path = [table.to_owned(), error.setting.to_owned()];
        Self {
            path: path.into_iter().chain(error.key.iter().flat_map(|key| steps(key))).collect(),
            part: error.part,
            near: error.near,
            message: error.message,
        }
    }

    /// The fault at its place in the file: on the axis that sets it for the grid point `cell`, otherwise in the
    /// experiment itself.
    fn fault(&self, experiment: &Experiment, cell: &Cell, texts: &Texts) -> Fault {
        let (path, part) = sweep::written(&experiment.vary, cell, &self.path, self.part)
            .unwrap_or_else(|| (self.path.clone(), self.part));
        let path: Vec<&str> = path.iter().map(String::as_str).collect();
        texts.fault(&path, part, &self.message)
    }
}

/// The parts of a dotted key with list indices: `lamps[1].aim` is `lamps`, `1`, `aim`.
fn steps(key: &str) -> impl Iterator<Item = String> {
    key.split(['.', '[', ']']).filter(|step| !step.is_empty()).map(str::to_owned)
}

impl Plan {
    /// The id of the run: the experiment's name, and a hash of its settings.
    pub(crate) fn id(&self) -> String {
        let settings: String = self.trials.iter().map(|trial| trial.resolved.to_toml()).collect();
        format!("{}-{}", self.name, &hex(&Sha256::hash(settings.as_bytes()))[..8])
    }

    /// Reads an experiment file, or makes an experiment from a data set's folder, and applies `settings`.
    ///
    /// Each setting is `key=value` with a dotted key and a TOML value; it overrides the file.
    ///
    /// # Errors
    /// All faults of the file, with their lines, and of the settings.
    pub fn read(path: &Path, settings: &[String]) -> Result<Self, Vec<Fault>> {
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        // The name becomes that of a folder.
        let name = name.filter(|name| is_plain_name(name)).unwrap_or_else(|| "run".to_owned());
        if path.is_dir() {
            // The canonical path has a name even for `.`; messages keep the path as given.
            let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
            let own = real.file_name().map(|name| name.to_string_lossy().into_owned());
            let name = own.filter(|name| is_plain_name(name)).unwrap_or(name);
            let experiment = changed(Experiment::of_dataset(path, &name), settings)?;
            return Self::resolve(experiment, &name, Path::new(""), path, &Texts::of(path, ""), settings);
        }
        if let Some(fault) = another_kind(path) {
            return Err(vec![fault]);
        }
        let text = read_text(path).map_err(|fault| vec![fault])?;
        let Read { experiment, mut faults, texts } = parse::experiment(path, &text);
        let folder = path.parent().unwrap_or(Path::new(""));
        let experiment = experiment.map(|experiment| changed(experiment, settings)).transpose();
        let planned = experiment.and_then(|experiment| {
            experiment.map(|known| Self::resolve(known, &name, folder, path, &texts, settings)).transpose()
        });
        match planned {
            Ok(Some(plan)) if faults.is_empty() => return Ok(plan),
            Ok(_) => {}
            Err(more) => faults.extend(more),
        }
        // Faults are sorted by their place in the file; the same fault found twice is reported once.
        faults.sort_by_key(|fault| (fault.file != path, fault.line, fault.column));
        faults.dedup();
        Err(faults)
    }

    /// The plan of the experiment in `file` with its texts `texts`; relative paths start from `folder`.
    pub(crate) fn resolve(
        experiment: Experiment,
        name: &str,
        folder: &Path,
        file: &Path,
        texts: &Texts,
        settings: &[String],
    ) -> Result<Self, Vec<Fault>> {
        let texts = &texts.below(settings);
        let fault = |path: &[&str], what: &str| texts.fault(path, Part::Value, what);
        let mut faults = sweep::check(&experiment.vary, |path, part, what| texts.fault(path, part, what));
        let invalid = experiment.invalid();
        faults.extend(invalid.iter().map(|invalid| invalid.fault(&experiment, &Vec::new(), texts)));
        for (path, what, remedy) in experiment.invalid_itself() {
            faults.push(fault(&path.split('.').collect::<Vec<_>>(), what).remedy(remedy));
        }
        if !faults.is_empty() {
            faults.extend(experiment.faults_of_axes(&invalid, folder, texts));
            return Err(faults);
        }
        if sweep::size(&experiment.vary, experiment.repetitions).is_none() {
            let key = if experiment.repetitions as usize > sweep::MAX_TRIALS { "repetitions" } else { "vary" };
            let remedy = format!("an experiment has at most {}; divide it into several", sweep::MAX_TRIALS);
            return Err(vec![fault(&[key], "too many trials").remedy(remedy)]);
        }
        let grid = sweep::grid(&experiment.axes());
        let trials = trials(&experiment, grid, folder, texts)?;
        let settings: String = settings.iter().map(|setting| format!(" --set '{setting}'")).collect();
        let command = format!("cargo run --release -- run {}{settings}", file.display());
        Ok(Self { name: name.to_owned(), folder: folder.to_owned(), command, experiment, trials })
    }
}

impl Experiment {
    /// The faults of axis values, checked one by one without the settings in `invalid`.
    fn faults_of_axes(&self, invalid: &[InvalidSetting], folder: &Path, texts: &Texts) -> Vec<Fault> {
        let mut table = toml::Table::try_from(self).expect("an experiment is a table of plain values");
        let mut source_is_known = true;
        // List elements are removed from the last to the first, so that indices stay valid.
        for InvalidSetting { path, near, .. } in invalid.iter().rev() {
            let is_name = path.last().is_some_and(|last| last == "name");
            match (&path[..], near) {
                (_, Some(near)) => rename(&mut table, path, near),
                ([source, ..], None) if source == "source" && (is_name || path.len() == 1) => {
                    source_is_known = false;
                    table.insert("source".to_owned(), "virtual-points".into());
                }
                (path, None) if is_name => take_out(&mut table, &path[..path.len() - 1]),
                (path, None) => take_out(&mut table, path),
            }
        }
        let Ok(rest) = table.try_into::<Self>() else { return Vec::new() };
        let rest = Self { seed: 0, repetitions: 1, ..rest };
        if !rest.invalid().is_empty() {
            return Vec::new();
        }
        let sound = |axis: &&Axis| axis.is_bounded() && (source_is_known || !axis.touches("source"));
        let cells = self.vary.iter().filter(sound).flat_map(|axis| sweep::grid(std::slice::from_ref(axis))).collect();
        trials(&rest, cells, folder, texts).err().unwrap_or_default()
    }
}

/// Replaces an unknown component name by the closest existing one.
fn rename(table: &mut toml::Table, path: &[String], near: &str) {
    let Some((first, below)) = path.split_first() else { return };
    let place =
        below.iter().try_fold(table.get_mut(first), |here, step| Some(here.and_then(|here| inside(here, step))));
    if let Some(place) = place.flatten() {
        *place = near.into();
    }
}

/// The trials of these points of the grid, or all of their faults.
fn trials(experiment: &Experiment, grid: Vec<Cell>, folder: &Path, texts: &Texts) -> Result<Vec<Trial>, Vec<Fault>> {
    let base = experiment.resolved().map_err(|invalid| vec![invalid.fault(experiment, &Vec::new(), texts)])?;
    let base = Experiment { vary: Vec::new(), repetitions: 1, ..base };
    let base = toml::Table::try_from(&base).expect("an experiment is a table of plain values");
    let (mut trials, mut faults) = (Vec::new(), Vec::new());
    for (index, cell) in grid.into_iter().enumerate() {
        match trial(&base, index, &cell, folder) {
            Ok(trial) => trials.push(trial),
            // A fault of an axis value occurs at many points of the grid.
            Err(invalid) => {
                for fault in invalid.iter().map(|invalid| invalid.fault(experiment, &cell, texts)) {
                    if !faults.contains(&fault) {
                        faults.push(fault);
                    }
                }
            }
        }
    }
    if faults.is_empty() { Ok(trials) } else { Err(faults) }
}

/// The experiment `base` with the settings of one grid point. Unknown settings are skipped and returned as faults.
fn at(base: &toml::Table, cell: &Cell) -> (Option<Experiment>, Vec<InvalidSetting>) {
    let settings = || cell.iter().flat_map(|place| &place.set);
    let with = |table: &toml::Table, key: &str, value: &toml::Value| -> Result<toml::Table, InvalidSetting> {
        let (mut table, path) = (table.clone(), steps(key).collect::<Vec<_>>());
        let path: Vec<&str> = path.iter().map(String::as_str).collect();
        let set = sweep::set(&mut table, key, value.clone());
        set.map_err(|message| InvalidSetting::of(&path, Part::Key, message)).map(|()| table)
    };
    let all = settings().try_fold(base.clone(), |table, (key, value)| with(&table, key, value));
    if let Some(experiment) = all.ok().and_then(|table| table.try_into().ok()) {
        return (Some(experiment), Vec::new());
    }
    // Settings are applied one by one to identify the invalid one.
    let (mut table, mut invalid) = (base.clone(), Vec::new());
    for (key, value) in settings() {
        let read = with(&table, key, value).and_then(|more| match more.clone().try_into::<Experiment>() {
            Ok(_) => Ok(more),
            Err(error) => {
                let Fault { what, value, remedy, .. } = Fault::in_toml(Path::new(""), "", &error);
                let part = if what.starts_with("unknown key") { Part::Key } else { Part::Value };
                let said: Vec<String> = [what, value, remedy].into_iter().filter(|part| !part.is_empty()).collect();
                let path: Vec<String> = steps(key).collect();
                Err(InvalidSetting { path, part, near: None, message: said.join(", ") })
            }
        });
        match read {
            Ok(more) => table = more,
            Err(error) => invalid.push(error),
        }
    }
    (table.try_into().ok(), invalid)
}

/// The trial at one point of the grid, or all of its faults.
fn trial(base: &toml::Table, index: usize, cell: &Cell, folder: &Path) -> Result<Trial, Vec<InvalidSetting>> {
    let (trial, mut invalid) = at(base, cell);
    invalid.extend(trial.iter().flat_map(Experiment::invalid));
    match trial {
        Some(trial) if invalid.is_empty() => built(trial, index, cell, folder).map_err(|invalid| vec![invalid]),
        _ => Err(invalid),
    }
}

/// Builds the trial of a valid experiment.
fn built(trial: Experiment, index: usize, cell: &Cell, folder: &Path) -> Result<Trial, InvalidSetting> {
    let invalid = |message: String, path: &[&str]| InvalidSetting::of(path, Part::Value, message);
    let mut trial = trial.resolved()?;
    let keyframes = trial.navigation.iter_mut().filter_map(|navigation| navigation.pose_graph.as_mut());
    keyframes.for_each(|used| keyframes::pin(used, folder));
    let source = SOURCES.build(&trial.source).map_err(|error| invalid(error.to_string(), &["source"]))?;
    let stages = trial.pipeline.build().map_err(InvalidSetting::pipeline)?;
    if stages.needs_pixels() && !source.has_pixels() {
        let (solver, source) = (&trial.pipeline.solver.name, &trial.source.name);
        let what = format!("solver `{solver}` needs pixels, which source `{source}` does not have; use `mahalanobis`");
        return Err(invalid(what, &["pipeline", "solver"]));
    }
    let navigation_stack = trial.navigation.as_ref().map(Navigation::build).transpose();
    let navigation_stack = navigation_stack.map_err(InvalidSetting::navigation)?;
    if navigation_stack.as_ref().is_some_and(NavigationStack::needs_readings) && !source.may_have_readings() {
        let source = &trial.source.name;
        let what = format!(
            "needs a Doppler log and a gyro, which source `{source}` does not have; use `stereo`, or the source `dive`"
        );
        return Err(invalid(what, &["navigation", "odometry"]));
    }
    if navigation_stack.is_some() && trial.pipeline.target != TargetKind::Object {
        let what = "navigation needs single objects as targets; use target = \"object\"".to_owned();
        return Err(invalid(what, &["pipeline", "target"]));
    }
    Ok(Trial {
        name: sweep::name(index + 1, cell),
        cell: cell.clone(),
        resolved: trial,
        source,
        stages,
        navigation_stack,
    })
}

/// The fault of a file of another kind, recognised by its first bytes.
fn another_kind(path: &Path) -> Option<Fault> {
    // Reading a pipe would consume its beginning.
    if !std::fs::metadata(path).is_ok_and(|file| file.is_file()) {
        return None;
    }
    let mut start = Vec::new();
    std::fs::File::open(path).ok()?.take(16).read_to_end(&mut start).ok()?;
    let fault = Fault::new("not an experiment", path);
    let source = "source = { name = \"mcap\", path = …, site = … }";
    if start.starts_with(b"\x89MCAP0\r\n") {
        let remedy =
            format!("`seafix replay` runs a log again; a recording of ROS 2 needs an experiment file with {source}");
        return Some(fault.value("an MCAP file").remedy(remedy));
    }
    if start.starts_with(b"\x28\xb5\x2f\xfd") {
        let remedy = format!("a compressed recording of ROS 2 needs an experiment file with {source}");
        return Some(fault.value("a file compressed with zstd").remedy(remedy));
    }
    let bag = start.starts_with(b"SQLite format 3") || start.starts_with(b"#ROSBAG");
    bag.then(|| fault.value(looks_like(&start)).remedy(format!("then write an experiment file with {source}")))
}

/// The experiment with `settings` from the command line.
fn changed(experiment: Experiment, settings: &[String]) -> Result<Experiment, Vec<Fault>> {
    if settings.is_empty() {
        return Ok(experiment);
    }
    // Defaults are written out first, so that a setting of a default component can be changed.
    sweep::changed(&experiment.resolved().unwrap_or(experiment), "--set", settings, "pipeline.solver=triad")
}

#[cfg(test)]
mod tests;
