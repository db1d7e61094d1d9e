//! `seafix recover`.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use clap::Args;
use seafix_component::Ownership;
use seafix_log::{LogError, Reader, join_lacking, recover};

use crate::{
    exit::{DONE, Ended, Failure, INPUT, OUTPUT},
    terminal::{notify, print},
};

#[derive(Debug, Args)]
pub(crate) struct Recover {
    /// A truncated or damaged log, a `.partial` of a killed run, or the folder of an unfinished run.
    log: PathBuf,
    /// The output file [default: NAME-recovered.mcap beside the log] or folder [default: `recovered` in the run's].
    #[arg(long)]
    out: Option<PathBuf>,
}

impl Recover {
    pub(crate) fn execute(&self) -> Ended {
        if self.log.is_dir() {
            return of_run(&self.log, &self.out.clone().unwrap_or_else(|| self.log.join("recovered")));
        }
        let out = self.out.clone().unwrap_or_else(|| {
            let name = self.log.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            let name =
                [".partial", ".zstd", ".zst", ".mcap"].iter().fold(&*name, |name, end| name.trim_end_matches(end));
            self.log.with_file_name(format!("{name}-recovered.mcap"))
        });
        if out.exists() {
            return Err(Failure::new(OUTPUT, format!("{} exists; name another file with --out", out.display())));
        }
        let found = recover(&self.log, &out).map_err(failure)?;
        for lost in &found.lost {
            notify(&format!("lost: {lost} in {}", self.log.display()));
        }
        print(&format!(
            "{}: {} messages, {} complete frames, up to stamp {} ns; {} messages of incomplete frames dropped\n",
            out.display(),
            found.messages,
            found.frames,
            found.last_ns,
            found.dropped
        ))?;
        Ok(DONE)
    }
}

/// The failure of an error: of the input or of the output.
fn failure(error: LogError) -> Failure {
    let written = is_of_output(&error);
    Failure::new(if written { OUTPUT } else { INPUT }, error)
}

fn is_of_output(error: &LogError) -> bool {
    matches!(error, LogError::Write { .. }) || matches!(error, LogError::Io { doing, .. } if *doing != "read")
}

/// Joins the pieces of every trial of an unfinished run: complete pieces, and the intact part of the others.
fn of_run(run: &Path, out: &Path) -> Ended {
    if out.exists() {
        return Err(Failure::new(OUTPUT, format!("{} exists; name another folder with --out", out.display())));
    }
    if !matches!(Ownership::of(out, "recovered").map_err(|fault| Failure::new(OUTPUT, fault))?, Ownership::Free) {
        return Err(Failure::new(OUTPUT, format!("{} is not empty; name another folder with --out", out.display())));
    }
    let mut trials: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for log in inside(&run.join("pieces")).iter().flat_map(|piece| inside(piece)) {
        let name = log.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        if let Some(trial) = name.strip_suffix(".partial").unwrap_or(&name).strip_suffix(".mcap") {
            trials.entry(trial.to_owned()).or_default().push(log);
        }
    }
    if trials.is_empty() {
        let what = format!("cannot recover {}: no piece of an unfinished run; name a log", run.display());
        return Err(Failure::new(INPUT, what));
    }
    let io =
        |path: &Path, error: std::io::Error| Failure::new(OUTPUT, format!("cannot write {}: {error}", path.display()));
    fs::create_dir_all(out).map_err(|error| io(out, error))?;
    let saved = out.join("torn");
    for (trial, logs) in trials {
        let mut parts = Vec::new();
        for log in logs {
            if log.extension().is_some_and(|end| end == "mcap") {
                parts.push(log);
                continue;
            }
            fs::create_dir_all(&saved).map_err(|error| io(&saved, error))?;
            let part = saved.join(format!("{}.mcap", parts.len()));
            match recover(&log, &part) {
                Ok(found) => {
                    found.lost.iter().for_each(|lost| notify(&format!("lost: {lost} in {}", log.display())));
                    parts.push(part);
                }
                Err(error) if is_of_output(&error) => return Err(failure(error)),
                Err(error) => notify(&format!("lost: {error}")),
            }
        }
        let to = out.join(format!("{trial}.mcap"));
        if !parts.is_empty() {
            join_lacking(&parts, &to, Some("the run did not end"), || true).map_err(failure)?;
            let mut frames = 0;
            let counted = Reader::open(&to).and_then(|log| log.without_images().for_each_frame(|_| frames += 1));
            counted.map_err(failure)?;
            print(&format!("{}: {frames} complete frames of {} pieces\n", to.display(), parts.len()))?;
        }
        if saved.exists() {
            fs::remove_dir_all(&saved).map_err(|error| io(&saved, error))?;
        }
    }
    Ok(DONE)
}

/// The entries of a folder, sorted by name.
fn inside(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    found.sort();
    found
}
