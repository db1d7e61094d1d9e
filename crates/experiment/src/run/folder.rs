//! The folder of a run: its marker, and the decision whether to create, resume or replace the run.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use seafix_component::{Fault, MARKER, Marker, Ownership};

use crate::run::{
    lock::Lock,
    manifest::{self, Manifest},
    options::{Existing, Options},
    outcome::RunError,
    store,
};

/// The kind of a run's folder.
const KIND: &str = "run";

/// The folder of a run, locked during the lifetime of this value.
#[derive(Debug)]
pub(super) struct Claim {
    pub(super) folder: PathBuf,
    /// The finished run in the folder, if it is resumed.
    pub(super) finished: Option<Manifest>,
    /// The reason for the removal of an outdated run, if there was one.
    pub(super) outdated: Option<String>,
    /// The files that the run may write.
    pub(super) marker: Marker,
    /// The lock; none for a kept run, which is only read.
    lock: Option<Lock>,
}

/// Checks the folder before anything is opened, computed or written.
pub(super) fn inspect(options: &Options) -> Result<(), Fault> {
    let Some(out) = &options.out else { return Ok(()) };
    match Ownership::of(out, KIND)? {
        Ownership::Free => Ok(()),
        Ownership::Ours(_) if options.existing == Existing::Refuse => Err(taken(out)),
        Ownership::Ours(_) => Ok(()),
        // A run of an earlier version is kept, but not changed.
        Ownership::Foreign(_) if options.existing == Existing::Keep && manifest::is_run(out) => Ok(()),
        Ownership::Foreign(name) => Err(foreign(out, &name)),
    }
}

/// The fault of an input in the output folder: an input is never an output. `inputs` are files and folders.
pub(super) fn input_inside(options: &Options, inputs: impl IntoIterator<Item = PathBuf>) -> Result<(), Fault> {
    let Some(out) = options.out.as_ref().and_then(|out| out.canonicalize().ok()) else { return Ok(()) };
    if options.existing == Existing::Resume {
        // Nothing is removed.
        return Ok(());
    }
    match inputs.into_iter().find(|input| input.canonicalize().is_ok_and(|input| input.starts_with(&out))) {
        None => Ok(()),
        Some(input) => {
            let fault = Fault::new("an input in the output folder", &input);
            Err(fault.remedy("choose another folder with --out"))
        }
    }
}

impl Claim {
    /// Claims the folder in `options`, or else the next free one below `runs` for `name`.
    pub(super) fn new(options: &Options, name: &str, manifest: &Manifest) -> Result<Self, RunError> {
        let marker = marker(manifest);
        let (finished, outdated) = (None, None);
        let Some(out) = &options.out else {
            let folder = next_free(name).map_err(RunError::Output)?;
            let lock = Some(Lock::new(&folder).map_err(RunError::Output)?);
            marker.write(&folder).map_err(|error| RunError::unwritable(&folder.join(MARKER), error))?;
            return Ok(Self { folder, finished, outdated, marker, lock });
        };
        inspect(options).map_err(RunError::Output)?;
        if let Ownership::Foreign(name) = Ownership::of(out, KIND).map_err(RunError::Output)? {
            let old = Manifest::read(out).map_err(RunError::Output)?;
            if old.timed == manifest.timed && old.stands_for(manifest, out) {
                return Ok(Self { folder: out.clone(), finished: Some(old), outdated, marker, lock: None });
            }
            return Err(RunError::Output(foreign(out, &name)));
        }
        fs::create_dir_all(out).map_err(|error| RunError::Output(unmade(out, &error)))?;
        let lock = Some(Lock::new(out).map_err(RunError::Output)?);
        let mut claim = Self { folder: out.clone(), finished, outdated, marker, lock };
        // The check is repeated under the lock, because another run may have ended in between.
        let old = match Ownership::of(out, KIND).map_err(RunError::Output)? {
            Ownership::Free => return claim.mark(),
            Ownership::Foreign(name) => return Err(RunError::Output(foreign(out, &name))),
            Ownership::Ours(old) => old,
        };
        if options.existing == Existing::Refuse {
            return Err(RunError::Output(taken(out)));
        }
        if options.existing == Existing::Overwrite || !manifest::is_run(out) {
            // Without a manifest nothing was computed.
            claim.clear(&old)?;
            return claim.mark();
        }
        if options.existing == Existing::Keep {
            return claim.keep(manifest, &old);
        }
        let old = Manifest::read(out).map_err(RunError::Output)?;
        let shard = (old.shard != manifest.shard).then_some("the number of its shard");
        if let Some(what) = manifest.differs(&old).or(shard) {
            let fault = Fault::new("the folder holds another run", &out.join(manifest::NAME)).value(what);
            let remedy = "repeat the earlier run, choose a new folder with --out, or --overwrite";
            return Err(RunError::Output(fault.remedy(format!("it differs; {remedy}"))));
        }
        claim.finished = ["finished", "shard"].contains(&&old.state[..]).then_some(old);
        claim.marker.tidy(out).map_err(RunError::Output)?;
        Ok(claim)
    }

    /// Writes the marker.
    fn mark(self) -> Result<Self, RunError> {
        let written = self.marker.write(&self.folder);
        written.map_err(|error| RunError::unwritable(&self.folder.join(MARKER), error)).map(|()| self)
    }

    /// Keeps the existing run if its results are those that `manifest` describes; otherwise makes room.
    fn keep(mut self, manifest: &Manifest, marker: &Marker) -> Result<Self, RunError> {
        let old = Manifest::read(&self.folder).map_err(RunError::Output)?;
        if old.timed != manifest.timed {
            // Durations cannot be reproduced.
            let fault = Fault::new("the folder holds another run", &self.folder.join(manifest::NAME));
            let fault = fault.value("whether durations are logged differs");
            return Err(RunError::Output(fault.remedy("choose another folder, or remove the run with --overwrite")));
        }
        if old.stands_for(manifest, &self.folder) {
            self.finished = Some(old);
        } else if old.state == "finished" || old.shard.is_some() || manifest.differs(&old).is_some() {
            // Only the program that began an unfinished run resumes it.
            self.outdated = Some(old.outdated(manifest));
            self.clear(marker)?;
            return self.mark();
        }
        self.marker.tidy(&self.folder).map_err(RunError::Output)?;
        Ok(self)
    }

    /// Removes the files that the marker of the existing run lists. Any other file is a fault.
    fn clear(&self, old: &Marker) -> Result<(), RunError> {
        if let Some(stranger) = old.stranger(&self.folder).map_err(RunError::Output)? {
            let fault = Fault::new("the output folder holds a file that is not part of a run", &stranger);
            return Err(RunError::Output(fault.remedy("move it away, or choose a new folder with --out")));
        }
        old.clear(&self.folder, "").map_err(RunError::Output)
    }

    /// Checks that the folder is still the claimed one: another process may have replaced it under the same name.
    pub(super) fn holds(&self) -> Result<(), RunError> {
        if self.lock.as_ref().is_none_or(Lock::holds) {
            return Ok(());
        }
        let fault = Fault::new("the output folder was removed or replaced while the run was made", &self.folder);
        Err(RunError::Output(
            fault.remedy("its content is not the complete run; run again with --overwrite, or with another --out"),
        ))
    }
}

/// The marker of a run: all files that it may write.
pub(super) fn marker(manifest: &Manifest) -> Marker {
    let fixed = [manifest::NAME, "results.csv", "results.parquet"].map(str::to_owned);
    let trials = || {
        manifest.trials.iter().flat_map(|trial| [trial.log.clone(), store::pose_graph(&trial.name)]).collect::<Vec<_>>()
    };
    let pieces = store::FIXED.map(str::to_owned).into_iter().chain(trials());
    let pieces = pieces.map(|name| format!("{}/*/{name}", store::FOLDER)).collect::<Vec<_>>();
    Marker::new(KIND, &manifest.identity, fixed.into_iter().chain(trials()).chain(pieces)).with_folder("report")
}

/// The fault of a folder without a marker.
fn foreign(out: &Path, name: &str) -> Fault {
    let fault = Fault::new("the output folder is not empty", out);
    if manifest::is_run(out) {
        let remedy =
            format!("without `{MARKER}` it is not changed: choose a new one with --out, or remove it yourself");
        return fault.value("a run of an earlier version").remedy(remedy);
    }
    fault.value(format!("it holds `{name}`, which is not part of a run")).remedy("choose a new one with --out")
}

fn taken(out: &Path) -> Fault {
    match Manifest::read(out) {
        Ok(old) => Fault::new("the output folder is not empty", out)
            .value(format!("a run, {}", old.state))
            .remedy("choose a new one with --out; --resume continues it, --overwrite removes it"),
        Err(_) => Fault::new("the output folder is not empty", out).remedy("choose a new one with --out"),
    }
}

pub(super) fn unmade(path: &Path, error: &std::io::Error) -> Fault {
    let fault = Fault::new(format!("cannot create the output folder ({error})"), path);
    if path.is_file() {
        return fault.remedy("a file has this name; give a new folder with --out");
    }
    fault.remedy("check free space and permissions, or choose another with --out")
}

/// Creates a new folder below `runs`.
fn next_free(name: &str) -> Result<PathBuf, Fault> {
    let runs = Path::new("runs");
    fs::create_dir_all(runs).map_err(|error| unmade(runs, &error))?;
    for number in 1.. {
        let folder = runs.join(if number == 1 { name.to_owned() } else { format!("{name}-{number}") });
        match fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(unmade(&folder, &error)),
        }
    }
    unreachable!("there is a free number")
}
