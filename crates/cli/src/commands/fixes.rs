//! `seafix fixes`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use seafix_component::Fault;
use seafix_data::fixes::{LoggedFixes, csv_head};

use crate::{
    atomic_file::{AtomicFile, Replacing},
    exit::{DONE, Ended, Failure, INPUT},
    terminal::{notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct Fixes {
    /// The folder of a run, or the log of a trial.
    run: PathBuf,
    /// The format: `csv` for all fixes with covariances, relative to their objects; `tum` for a trajectory in the world.
    #[arg(long, value_enum, default_value = "csv")]
    format: Format,
    /// The trial, by the name of its log; a trajectory is of one trial [default: all trials].
    #[arg(long, value_name = "NAME")]
    trial: Option<String>,
    /// The fixes of this object only; a trajectory is then relative to the object.
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// The file to write; printed by default.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replacing: Replacing,
}

/// The format of the fixes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A table: trial, frame, stamp, object, object_from_camera, covariance.
    Csv,
    /// A trajectory: seconds tx ty tz qx qy qz qw.
    Tum,
}

impl Fixes {
    pub(crate) fn execute(&self) -> Ended {
        let input = |fault: Fault| Failure::new(INPUT, fault);
        let out = self.out.as_deref().map(|path| AtomicFile::begin(path, self.replacing, &[&self.run])).transpose()?;
        let logs = self.logs().map_err(input)?;
        if self.format == Format::Tum && logs.len() > 1 {
            let fault = Fault::new("a trajectory of several trials", &self.run);
            return Err(input(fault.value(names(&logs)).remedy("name one with --trial")));
        }
        let mut trials = Vec::new();
        for log in &logs {
            let mut trial = LoggedFixes::read(log).map_err(input)?;
            if let Some(object) = &self.object {
                trial.fixes.retain(|fix| fix.object == *object);
            }
            trials.push(trial);
        }
        if trials.iter().all(|trial| trial.fixes.is_empty()) {
            let what = self.object.as_ref().map_or("no fix".to_owned(), |object| format!("no fix of `{object}`"));
            let remedy = "the column `explanation` of results.csv states the reasons";
            notify(&format!("warning: {}", Fault::new(what, &self.run).remedy(remedy)));
        }
        let text = match (self.format, &trials[..]) {
            (Format::Tum, [trial]) => self.trajectory(trial).map_err(input)?,
            _ => csv_head() + &trials.iter().map(LoggedFixes::csv).collect::<String>(),
        };
        match out {
            Some(out) => out.finish(text)?,
            None => print(&text)?,
        }
        Ok(DONE)
    }

    /// The trajectory of a trial: relative to the chosen object, or in the world.
    fn trajectory(&self, trial: &LoggedFixes) -> Result<String, Fault> {
        if self.object.is_some() {
            return Ok(trial.object_tum());
        }
        trial.world_tum().ok_or_else(|| {
            let mut objects: Vec<&str> = trial.fixes.iter().map(|fix| fix.object.as_str()).collect();
            objects.sort_unstable();
            objects.dedup();
            let fault = Fault::new("fixes of objects without a surveyed pose", &self.run).value(objects.join(", "));
            fault.remedy("name one with --object for the trajectory relative to it")
        })
    }

    /// The chosen logs, in the order of their names.
    fn logs(&self) -> Result<Vec<PathBuf>, Fault> {
        let remedy = "name the folder of a run, or the log of a trial";
        if !self.run.is_dir() {
            return match self.run.exists() {
                true => Ok(vec![self.run.clone()]),
                false => Err(Fault::new("no run and no log", &self.run).remedy(remedy)),
            };
        }
        let entries = std::fs::read_dir(&self.run)
            .map_err(|error| Fault::new(format!("cannot read ({error})"), &self.run).remedy(remedy))?;
        let mut logs: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        logs.retain(|path| path.extension().is_some_and(|end| end == "mcap"));
        logs.sort();
        if logs.is_empty() {
            return Err(Fault::new("a folder without logs", &self.run).remedy(remedy));
        }
        let Some(trial) = &self.trial else { return Ok(logs) };
        let all = names(&logs);
        logs.retain(|log| stem(log) == *trial);
        match logs.is_empty() {
            true => Err(Fault::new(format!("no trial `{trial}`"), &self.run).value(all).remedy("name one of these")),
            false => Ok(logs),
        }
    }
}

fn stem(log: &Path) -> String {
    log.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

fn names(logs: &[PathBuf]) -> String {
    logs.iter().map(|log| stem(log)).collect::<Vec<_>>().join(", ")
}
