//! The folder of a run: its lock, and the decision whether to create, resume or replace the run.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{ErrorKind, Read, Seek, Write},
    path::{Path, PathBuf},
};

use seafix_component::Fault;

use crate::run::{
    manifest::{self, Manifest},
    options::{Existing, Options},
    outcome::RunError,
    store::{self, Store},
};

/// The folder of a run, locked during the lifetime of this value.
#[derive(Debug)]
pub(super) struct Claim {
    pub(super) folder: PathBuf,
    /// The finished run in the folder, if it is resumed.
    pub(super) finished: Option<Manifest>,
    /// The reason for the removal of an outdated run, if there was one.
    pub(super) outdated: Option<String>,
    lock: Lock,
}

/// A file that is locked during the lifetime of this value.
#[derive(Debug)]
struct Lock {
    path: PathBuf,
    file: File,
}

impl Drop for Lock {
    /// The file is removed under the lock, so that a process that has opened it notices.
    fn drop(&mut self) {
        // The folder may have been replaced by another process.
        if is_at(&self.file, &self.path) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// The file with the advisory lock of a running process; it contains the process and the host.
const LOCK: &str = ".lock";

/// Checks the folder before anything is opened, computed or written.
pub(super) fn inspect(options: &Options) -> Result<(), Fault> {
    match &options.out {
        Some(out) if options.existing == Existing::Refuse && !free(out)? => Err(taken(out)),
        _ => Ok(()),
    }
}

impl Claim {
    /// Claims the folder in `options`, or else the next free one below `runs` for `name`.
    pub(super) fn new(options: &Options, name: &str, manifest: &Manifest) -> Result<Self, RunError> {
        let Some(out) = &options.out else {
            let folder = next_free(name).map_err(RunError::Output)?;
            let lock = lock(&folder).map_err(RunError::Output)?;
            return Ok(Self { folder, finished: None, outdated: None, lock });
        };
        inspect(options).map_err(RunError::Output)?;
        fs::create_dir_all(out).map_err(|error| RunError::Output(unmade(out, &error)))?;
        let mut claim =
            Self { folder: out.clone(), finished: None, outdated: None, lock: lock(out).map_err(RunError::Output)? };
        // The check is repeated under the lock, because another run may have ended in between.
        if free(out).map_err(RunError::Output)? {
            return Ok(claim);
        }
        match options.existing {
            Existing::Refuse => Err(RunError::Output(taken(out))),
            Existing::Overwrite => clear(out).map(|()| claim),
            Existing::Keep => claim.keep(manifest),
            Existing::Resume => {
                let old = Manifest::read(out).map_err(RunError::Output)?;
                let shard = (old.shard != manifest.shard).then_some("the number of its shard");
                if let Some(what) = manifest.differs(&old).or(shard) {
                    let fault = Fault::new("the folder holds another run", &out.join(manifest::NAME)).value(what);
                    let remedy = "repeat the earlier run, choose a new folder with --out, or --overwrite";
                    return Err(RunError::Output(fault.remedy(format!("it differs; {remedy}"))));
                }
                claim.finished = ["finished", "shard"].contains(&&old.state[..]).then_some(old);
                Ok(claim)
            }
        }
    }
}

impl Claim {
    /// Keeps the existing run if its results are those that `manifest` describes; otherwise makes room.
    fn keep(mut self, manifest: &Manifest) -> Result<Self, RunError> {
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
            clear(&self.folder)?;
        }
        Ok(self)
    }

    /// Checks that the folder is still the claimed one: another process may have replaced it under the same name.
    pub(super) fn holds(&self) -> Result<(), RunError> {
        if is_at(&self.lock.file, &self.lock.path) {
            return Ok(());
        }
        let fault = Fault::new("the output folder was removed or replaced while the run was made", &self.folder);
        Err(RunError::Output(
            fault.remedy("its content is not the complete run; run again with --overwrite, or with another --out"),
        ))
    }
}

/// Whether the folder is absent or empty, apart from the lock of a run killed before it began.
fn free(out: &Path) -> Result<bool, Fault> {
    let entries = match fs::read_dir(out) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(true),
        Err(error) => return Err(unmade(out, &error)),
        Ok(entries) => entries,
    };
    let mut names = entries.flatten().map(|entry| entry.file_name());
    let unbegun =
        |name: std::ffi::OsString| name == LOCK || name.to_string_lossy() == format!("{}.partial", manifest::NAME);
    Ok(names.all(unbegun))
}

fn taken(out: &Path) -> Fault {
    match Manifest::read(out) {
        Ok(old) => Fault::new("the output folder is not empty", out)
            .value(format!("a run, {}", old.state))
            .remedy("choose a new one with --out; --resume continues it, --overwrite removes it"),
        Err(_) => Fault::new("the output folder is not empty", out).remedy("choose a new one with --out"),
    }
}

fn unmade(path: &Path, error: &std::io::Error) -> Fault {
    let fault = Fault::new(format!("cannot create the output folder ({error})"), path);
    if path.is_file() {
        return fault.remedy("a file has this name; give a new folder with --out");
    }
    fault.remedy("check free space and permissions, or choose another with --out")
}

/// Locks a folder, or reports the process that holds the lock.
fn lock(folder: &Path) -> Result<Lock, Fault> {
    let path = folder.join(LOCK);
    let failed = |error: &std::io::Error| unmade(&path, error);
    let mut file = OpenOptions::new()
        .create(true)
        .read(true)
        .write(true)
        .truncate(false)
        .open(&path)
        .map_err(|error| failed(&error))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            let _ = file.read_to_string(&mut holder);
            let fault = Fault::new("another run writes into the output folder", folder).value(holder.trim());
            return Err(fault.remedy("wait for its end, or choose another folder with --out"));
        }
        Err(TryLockError::Error(error)) => return Err(failed(&error)),
    }
    // A run that just ended may have removed the file between opening and locking; such a lock is void.
    if !is_at(&file, &path) {
        return lock(folder);
    }
    let text = format!("process {} on {}\n", std::process::id(), host());
    let write = file.set_len(0).and_then(|()| file.rewind()).and_then(|()| file.write_all(text.as_bytes()));
    write.map_err(|error| failed(&error))?;
    Ok(Lock { path, file })
}

/// Whether an open file is still the one with this name.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let same = |a: &fs::Metadata, b: &fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata().is_ok_and(|open| fs::metadata(path).is_ok_and(|named| same(&open, &named)))
}

/// Other systems do not rename or remove an open file.
#[cfg(not(unix))]
fn is_at(_file: &File, path: &Path) -> bool {
    path.exists()
}

/// The name of the machine, if there is one.
fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("HOSTNAME").or_else(|_| std::env::var("COMPUTERNAME")).ok());
    name.map(|name| name.trim().to_owned())
        .filter(|name| !name.is_empty())
        .unwrap_or_else(|| "a nameless host".to_owned())
}

/// Removes the run in a folder. An unknown file in it is a fault.
fn clear(out: &Path) -> Result<(), RunError> {
    let failed = |path: &Path, error: std::io::Error| RunError::unwritable(path, error);
    let names: Vec<String> = fs::read_dir(out)
        .map_err(|error| failed(out, error))?
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    let own = |name: &str| {
        let name = name.trim_end_matches(".partial");
        [LOCK, manifest::NAME, "results.csv", "results.parquet", "pieces", "report"].contains(&name)
            || [".mcap", store::POSE_GRAPH].iter().any(|end| name.ends_with(end))
    };
    if let Some(foreign) = names.iter().find(|name| !own(name)) {
        let fault = Fault::new("the output folder holds a file that is not part of a run", &out.join(foreign));
        return Err(RunError::Output(fault.remedy("move it away, or choose a new folder with --out")));
    }
    Store::of(out).remove()?;
    // The manifest is removed last, so that an interruption leaves a recognisable run.
    let rest = names.iter().filter(|name| *name != LOCK && *name != manifest::NAME && *name != "pieces");
    for name in rest.map(String::as_str).chain([manifest::NAME]) {
        let path = out.join(name);
        let removed = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        match removed {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(&path, error)),
            _ => {}
        }
    }
    Ok(())
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
