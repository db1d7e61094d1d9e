//! Replay of the logged inputs of another run with a changed pipeline.

use std::path::{Path, PathBuf};

use seafix_component::{Choice, Fault, is_plain_name};
use seafix_log::{Reader, unchanged};

use seafix::PipelineSettings;

use crate::{
    experiment::{Experiment, Plan},
    parse::Texts,
    sweep::{self, Axis},
};

/// The part of a log's inputs that a replay starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReplayFrom {
    /// The clouds, unless a stage of the front end differs from the logged one.
    #[default]
    Suited,
    /// The clouds, for comparisons of searches and solvers without images.
    Clouds,
    /// The images.
    Images,
}

/// The changes to a logged trial for a replay of its inputs.
#[derive(Debug, Clone, Default)]
pub struct Replay {
    /// The searches by name; the logged one if empty. Several names give one trial each.
    pub searches: Vec<String>,
    /// The solvers by name, like `searches`.
    pub solvers: Vec<String>,
    /// Other settings, `key=value`: `pipeline.acceptance.confidence=0.999`.
    pub settings: Vec<String>,
    /// The start from images or clouds.
    pub from: ReplayFrom,
}

impl Replay {
    /// The plan that replays the trial logged in `log` with these changes. Without changes it has the trial's name and
    /// reproduces its results.
    ///
    /// # Errors
    /// A log that cannot be read, or an invalid setting.
    pub fn plan(&self, log: &Path) -> Result<Plan, Vec<Fault>> {
        let fault = |what: &str| vec![Fault::new(what, log)];
        if log.is_dir() {
            let mut logs: Vec<String> = std::fs::read_dir(log)
                .into_iter()
                .flatten()
                .flatten()
                .map(|entry| entry.path())
                .filter(|path| path.extension().is_some_and(|end| end == "mcap"))
                .map(|path| path.display().to_string())
                .collect();
            logs.sort();
            let remedy = match &logs[..] {
                [] => "name the log of a trial, an .mcap file".to_owned(),
                [first, rest @ ..] => format!("name one of the {} logs in it, for instance {first}", rest.len() + 1),
            };
            return Err(vec![Fault::new("a folder, not the log of a trial", log).remedy(remedy)]);
        }
        let reader = unchanged(log).and_then(|()| Reader::open(log)).map_err(|error| fault(&error.to_string()))?;
        let header = reader.header().clone();
        // The name becomes that of a file.
        if !is_plain_name(&header.trial) || header.trial.starts_with('.') {
            let invalid = Fault::new("a log whose trial has no valid file name", log).value(&header.trial);
            return Err(vec![invalid.remedy("make its run again")]);
        }
        let logged: Experiment = toml::from_str(&header.configuration)
            .map_err(|error| fault(&format!("its configuration is of another version ({})", error.message())))?;
        let mut changed: Experiment =
            sweep::changed(&logged, "--set", &self.settings, "pipeline.acceptance.confidence=0.999")?;
        if changed.source != logged.source || changed.seed != logged.seed {
            let fault = Fault::new("a change of the logged inputs", Path::new("--set"));
            return Err(vec![fault.remedy("change the pipeline; to change source or seed, run the experiment again")]);
        }
        let own = |names: &[String], key: &str| {
            let values = names.iter().map(|name| toml::Value::from(name.as_str())).collect();
            (names.len() > 1).then(|| Axis::listed(key, values))
        };
        for (names, choice) in
            [(&self.searches, &mut changed.pipeline.search), (&self.solvers, &mut changed.pipeline.solver)]
        {
            // The logged component keeps its logged settings.
            if let [name] = &names[..]
                && *name != choice.name
            {
                *choice = Choice::named(name);
            }
        }
        let clouds = match self.from {
            ReplayFrom::Clouds => true,
            ReplayFrom::Images => false,
            // The odometry needs images.
            ReplayFrom::Suited => changed.navigation.is_none() && same_front_end(&logged.pipeline, &changed.pipeline),
        };
        let read = if clouds { "clouds" } else { "images" };
        let file = log.canonicalize().unwrap_or_else(|_| log.to_owned());
        let source = Choice::named("mcap").with("path", file.to_string_lossy().into_owned()).with("read", read);
        let vary = [own(&self.searches, "pipeline.search"), own(&self.solvers, "pipeline.solver")];
        let replayed = Experiment { source, vary: vary.into_iter().flatten().collect(), ..changed };
        let name = format!("replay-{}", header.trial);
        let folder = folder_of_pose_graph(&replayed, &file);
        let mut plan = Plan::resolve(replayed, &name, &folder, log, &Texts::of(log, ""), &self.settings)?;
        plan.command = self.command(log);
        if let [trial] = &mut plan.trials[..] {
            trial.name.clone_from(&header.trial);
        }
        Ok(plan)
    }

    fn command(&self, log: &Path) -> String {
        let mut command = format!("cargo run --release -- replay {}", log.display());
        self.searches.iter().for_each(|name| command += &format!(" --search {name}"));
        self.solvers.iter().for_each(|name| command += &format!(" --solver {name}"));
        self.settings.iter().for_each(|setting| command += &format!(" --set '{setting}'"));
        command
    }
}

/// The folder of the pose graph that is read, if there is one: the current folder, the log's folder, or one above it,
/// because the original experiment file is unknown. The SHA-256 identifies the file.
fn folder_of_pose_graph(experiment: &Experiment, log: &Path) -> PathBuf {
    let pose_graph = experiment.navigation.as_ref().and_then(|navigation| navigation.pose_graph.as_ref());
    let read = pose_graph.map_or("", |pose_graph| pose_graph.read.as_str());
    let lies_in = |folder: &&Path| folder.join(read).is_file();
    let folders = std::iter::once(Path::new("")).chain(log.ancestors().skip(1));
    folders.filter(|_| !read.is_empty()).find(lies_in).unwrap_or(Path::new("")).to_owned()
}

/// Whether all stages of the front end are the same.
fn same_front_end(a: &PipelineSettings, b: &PipelineSettings) -> bool {
    let frame_data = |p: &PipelineSettings| PipelineSettings {
        target: Default::default(),
        window: 1,
        gate: Default::default(),
        tolerance: seafix_referencing::Tolerance::Sigmas(1.0),
        search: Choice::named(""),
        solver: Choice::named(""),
        acceptance: Default::default(),
        ..p.clone()
    };
    frame_data(a) == frame_data(b)
}
