//! The folder of a run: that it is free, or holds the run that is to be continued, and that nobody else writes into it.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{ErrorKind, Read, Seek, Write},
    path::{Path, PathBuf},
};

use seafix_component::Fault;

use super::{
    Existing, Options, RunError,
    store::{self, Store},
};
use crate::manifest::{self, Manifest};

/// The folder of a run, locked as long as this lives.
#[derive(Debug)]
pub(super) struct Claim {
    pub(super) folder: PathBuf,
    /// The run that is finished already, where it is resumed.
    pub(super) finished: Option<Manifest>,
    /// The reason why a run that was there was removed, where one was kept before.
    pub(super) outdated: Option<String>,
    lock: Lock,
}

/// A file that is locked as long as this lives.
#[derive(Debug)]
struct Lock {
    path: PathBuf,
    file: File,
}

impl Drop for Lock {
    /// The file goes while it is still locked: whoever has opened it before sees that it has gone.
    fn drop(&mut self) {
        // In a folder that was replaced it is another's.
        if is_at(&self.file, &self.path) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Holds an advisory lock while a run writes into its folder, and says who does.
const LOCK: &str = ".lock";

/// What can be seen of the folder before anything is opened, computed or written.
pub(super) fn inspect(options: &Options) -> Result<(), Fault> {
    match &options.out {
        Some(out) if options.existing == Existing::Refuse && !free(out)? => Err(taken(out)),
        _ => Ok(()),
    }
}

impl Claim {
    /// Takes the folder that `options` say, or the next free one below `runs` for a run called `name`.
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
        // Again under the lock: another run may just have ended.
        if free(out).map_err(RunError::Output)? {
            return Ok(claim);
        }
        match options.existing {
            Existing::Refuse => Err(RunError::Output(taken(out))),
            Existing::Overwrite => clear(out).map(|()| claim),
            Existing::Keep => claim.keep(manifest),
            Existing::Resume => {
                let old = Manifest::read(out).map_err(RunError::Output)?;
                let shard = (old.shard != manifest.shard).then_some("which shard of it this is");
                if let Some(what) = manifest.differs(&old).or(shard) {
                    let fault = Fault::new("the folder holds another run", &out.join(manifest::NAME)).value(what);
                    let remedy = "run what was run before, choose a new folder with --out, or --overwrite";
                    return Err(RunError::Output(fault.remedy(format!("it differs; {remedy}"))));
                }
                claim.finished = ["finished", "shard"].contains(&&old.state[..]).then_some(old);
                Ok(claim)
            }
        }
    }
}

impl Claim {
    /// Keeps the run that is there where its results are those of the run that `manifest` describes; makes room otherwise.
    fn keep(mut self, manifest: &Manifest) -> Result<Self, RunError> {
        let old = Manifest::read(&self.folder).map_err(RunError::Output)?;
        if old.timed != manifest.timed {
            // Nobody can make the same durations again.
            let fault = Fault::new("the folder holds another run", &self.folder.join(manifest::NAME));
            let fault = fault.value("whether durations are logged differs");
            return Err(RunError::Output(fault.remedy("choose another folder, or remove the run with --overwrite")));
        }
        if old.stands_for(manifest, &self.folder) {
            self.finished = Some(old);
        } else if old.state == "finished" || old.shard.is_some() || manifest.differs(&old).is_some() {
            // What is there of a run that was not finished is continued by the program that began it only.
            self.outdated = Some(old.outdated(manifest));
            clear(&self.folder)?;
        }
        Ok(self)
    }

    /// Whether the folder is still the one that was taken: what is made below a name does not tell that another has it since.
    pub(super) fn holds(&self) -> Result<(), RunError> {
        if is_at(&self.lock.file, &self.lock.path) {
            return Ok(());
        }
        let fault = Fault::new("the output folder was removed or replaced while the run was made", &self.folder);
        Err(RunError::Output(
            fault.remedy("what is in it is not the whole run: run again with --overwrite, or with another --out"),
        ))
    }
}

/// Whether there is no folder, or nothing in it but what a run leaves that was killed before it began.
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
    let fault = Fault::new(format!("cannot make the output folder ({error})"), path);
    if path.is_file() {
        return fault.remedy("a file is there: name a new folder with --out");
    }
    fault.remedy("choose another with --out, or make room and rights for it")
}

/// Takes the lock of a folder, or says who has it.
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
    // A run that ended just now took the file away between opening and locking: what is locked is then no lock.
    if !is_at(&file, &path) {
        return lock(folder);
    }
    let text = format!("process {} on {}\n", std::process::id(), host());
    let write = file.set_len(0).and_then(|()| file.rewind()).and_then(|()| file.write_all(text.as_bytes()));
    write.map_err(|error| failed(&error))?;
    Ok(Lock { path, file })
}

/// Whether a file that is open is the one that has this name now.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let same = |a: &fs::Metadata, b: &fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata().is_ok_and(|open| fs::metadata(path).is_ok_and(|named| same(&open, &named)))
}

/// Elsewhere a file that is open keeps its name.
#[cfg(not(unix))]
fn is_at(_file: &File, path: &Path) -> bool {
    path.exists()
}

/// The machine's name, where it says one.
fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("HOSTNAME").or_else(|_| std::env::var("COMPUTERNAME")).ok());
    name.map(|name| name.trim().to_owned())
        .filter(|name| !name.is_empty())
        .unwrap_or_else(|| "a nameless host".to_owned())
}

/// Removes the run in a folder; what no run makes stops it.
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
        let fault = Fault::new("the output folder holds something that no run made", &out.join(foreign));
        return Err(RunError::Output(fault.remedy("move it away, or choose a new folder with --out")));
    }
    Store::of(out).remove()?;
    // The manifest last: what is killed here is still a run.
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

/// A new folder below `runs`.
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
    unreachable!("some number is free")
}
