//! `seafix sweep`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::{Args, ValueEnum};
use seafix_component::{Fault, MARKER, Marker, Ownership, PartialFile, create_real_folder};
use seafix_experiment::{Existing, Options, Plan, merge};
use serde_json::Value;

use super::run::report_on;
use crate::{
    executor::{Array, Executor, HyperQueue, Local, Slurm},
    exit::{DONE, Ended, Failure, OUTPUT, USAGE},
    signals,
    terminal::{Progress, notify},
};

#[derive(Debug, Args)]
pub(crate) struct Sweep {
    /// An experiment file.
    experiment: PathBuf,
    /// Change a setting of the experiment: a dotted key and a TOML value, `source.frames=3`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Number of shards of the run.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    shards: u32,
    /// The engine that runs the shards.
    #[arg(long, value_enum, default_value = "local")]
    executor: Engine,
    /// The folder of the run. Its shards are in DIR-shards until they are merged; the same command resumes them.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of threads of each shard.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Log no durations; two runs of one experiment then have the same bytes.
    #[arg(long)]
    untimed: bool,
    /// Compute all stages in every trial, so that durations are those of the trial alone.
    #[arg(long)]
    separate: bool,
}

/// The folder of the tasks' output, and the script of each task, in the folder of the shards.
const LOGS: &str = "logs";
const SCRIPT: &str = "shard.sh";

/// The supported engines.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Engine {
    /// This machine.
    Local,
    /// A job array of Slurm.
    Slurm,
    /// A task array of HyperQueue.
    Hyperqueue,
}

impl Engine {
    fn executor(self) -> Box<dyn Executor> {
        match self {
            Self::Local => Box::new(Local),
            Self::Slurm => Box::new(Slurm),
            Self::Hyperqueue => Box::new(HyperQueue),
        }
    }
}

impl Sweep {
    pub(crate) fn execute(&self) -> Ended {
        let plan = Plan::read(&self.experiment, &self.set).map_err(|faults| Failure::faults(USAGE, &faults))?;
        let executor = self.executor.executor();
        let write_error = |path: &Path, error: std::io::Error| {
            Failure::new(OUTPUT, format!("cannot write {}: {error}", path.display()))
        };
        let owner = |folder: &Path, kind| Ownership::of(folder, kind).map_err(|fault| Failure::new(OUTPUT, fault));
        if !matches!(owner(&self.out, "run")?, Ownership::Free) {
            let what = format!("{} exists and is not empty; name another folder", self.out.display());
            return Err(Failure::new(OUTPUT, what));
        }
        let shards = absolute(&self.shards_folder())?;
        let mut marker = self.marker(&plan.name);
        match owner(&shards, "shards")? {
            Ownership::Free => {}
            // An earlier division may have had more shards.
            Ownership::Ours(earlier) => marker = marker.and(&earlier),
            Ownership::Foreign(other) => {
                let fault = Fault::new("the folder of the shards is not empty", &shards);
                let remedy = "name another folder with --out, or move it away";
                return Err(Failure::new(OUTPUT, fault.value(format!("it holds `{other}`")).remedy(remedy)));
            }
        }
        let logs = shards.join(LOGS);
        fs::create_dir_all(&shards).map_err(|error| write_error(&shards, error))?;
        marker.write(&shards).map_err(|error| write_error(&shards.join(MARKER), error))?;
        create_real_folder(&logs).map_err(|error| write_error(&logs, error))?;
        let script = shards.join(SCRIPT);
        let text = self.script(&shards, executor.variable())?;
        PartialFile::write(&script, text.as_bytes()).map_err(|error| write_error(&script, error))?;
        let (tasks, threads) = (self.shards as usize, usize::from(self.threads));
        notify(&format!("{tasks} shards of {} in {}", plan.name, shards.display()));
        signals::listen();
        let ran = executor.run(&Array { script, tasks, threads, name: format!("seafix-{}", plan.name), logs });
        signals::end_at_once();
        ran?;
        if signals::interrupted() {
            return Err(Failure::new(signals::exit_code(), "interrupted; the same command resumes the sweep"));
        }
        self.merge(&shards, &marker)
    }

    /// The marker of the folder of the shards.
    fn marker(&self, name: &str) -> Marker {
        let logs = (1..=self.shards).map(|k| format!("{LOGS}/{k}.log"));
        let marker = Marker::new("shards", name, logs.chain([SCRIPT.to_owned()]));
        (1..=self.shards).fold(marker, |marker, k| marker.with_folder(k.to_string()))
    }

    fn shards_folder(&self) -> PathBuf {
        // Without a final separator.
        let mut name = self.out.components().as_path().as_os_str().to_owned();
        name.push("-shards");
        PathBuf::from(name)
    }

    /// The script of each task: it runs or resumes its shard.
    fn script(&self, shards: &Path, variable: &str) -> Result<String, Failure> {
        let program = std::env::current_exe()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot locate the program seafix: {error}")))?;
        // Run from the same folder, so that the run's log has the same command.
        let here = std::env::current_dir()
            .map_err(|error| Failure::new(OUTPUT, format!("cannot determine the current folder: {error}")))?;
        let set: String = self.set.iter().map(|setting| format!(" --set {}", quoted(setting))).collect();
        Ok(format!(
            "#!/bin/sh\n# Shard {variable} of a sweep.\ncd {} || exit 4\nexec {} run {}{set} --shard \"${variable}/{}\" --out {}/\"${variable}\" --resume --threads {}{}{}\n",
            quoted(&here.to_string_lossy()),
            quoted(&program.to_string_lossy()),
            quoted(&self.experiment.to_string_lossy()),
            self.shards,
            quoted(&shards.to_string_lossy()),
            self.threads,
            if self.untimed { " --untimed" } else { "" },
            if self.separate { " --separate" } else { "" },
        ))
    }

    fn merge(&self, shards: &Path, marker: &Marker) -> Ended {
        let folders: Vec<PathBuf> = (1..=self.shards).map(|k| shards.join(k.to_string())).collect();
        let is_finished = |folder: &PathBuf| {
            let text = fs::read_to_string(folder.join("manifest.json")).unwrap_or_default();
            serde_json::from_str::<Value>(&text).is_ok_and(|manifest| manifest["state"] == "shard")
        };
        let missing: Vec<String> = (1..=self.shards)
            .zip(&folders)
            .filter(|(_, folder)| !is_finished(folder))
            .map(|(k, _)| k.to_string())
            .collect();
        if !missing.is_empty() {
            let what = format!(
                "shards {} did not finish; see their output in {}; the same command resumes them",
                missing.join(", "),
                shards.join("logs").display()
            );
            return Err(Failure::new(OUTPUT, what));
        }
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let options = Options { existing: Existing::Refuse, threads: cores, ..Options::into(&self.out) };
        let progress = Progress::new();
        let finished = merge(&folders, &options, &progress);
        progress.end();
        report_on(&finished?, cores)?;
        marker.remove(shards).map_err(|fault| Failure::new(OUTPUT, fault))?;
        if shards.exists() {
            notify(&format!("{} holds other files, and stays", shards.display()));
        }
        Ok(DONE)
    }
}

fn absolute(path: &Path) -> Result<PathBuf, Failure> {
    std::path::absolute(path)
        .map_err(|error| Failure::new(OUTPUT, format!("cannot resolve {}: {error}", path.display())))
}

/// A quoted word for a POSIX shell.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_harmless_in_a_terminal() {
        assert_eq!(quoted("a b$(c)'d"), r"'a b$(c)'\''d'");
    }
}
