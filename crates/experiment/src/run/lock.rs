//! The lock of a run's folder.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{Read, Seek, Write},
    path::{Path, PathBuf},
};

use seafix_component::{Fault, LOCK};

use crate::run::folder::unmade;

/// A file that is locked during the lifetime of this value; it contains the process and the host.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    file: File,
}

impl Drop for Lock {
    /// The file is removed under the lock, so that a process that has opened it notices.
    fn drop(&mut self) {
        // The folder may have been replaced by another process.
        if self.holds() {
            let _ = fs::remove_file(&self.path);
        }
    }
}

impl Lock {
    /// Whether the locked file still has its name.
    pub(super) fn holds(&self) -> bool {
        is_at(&self.file, &self.path)
    }

    /// Locks a folder, or reports the process that holds the lock.
    pub(super) fn new(folder: &Path) -> Result<Self, Fault> {
        let path = folder.join(LOCK);
        let failed = |error: &std::io::Error| unmade(&path, error);
        // A link must not lead to another file.
        if fs::symlink_metadata(&path).is_ok_and(|file| !file.is_file()) {
            return Err(
                Fault::new("a lock that is not a regular file", &path).remedy("remove it, or choose another --out")
            );
        }
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
            return Self::new(folder);
        }
        let mut holder = String::new();
        let read = Read::by_ref(&mut file).take(1 << 10).read_to_string(&mut holder);
        if !holder.is_empty() && !holder.starts_with("process ") || read.is_err() {
            return Err(
                Fault::new("a lock that no run has written", &path).remedy("move it away, or choose another --out")
            );
        }
        let text = format!("process {} on {}\n", std::process::id(), host());
        let write = file.set_len(0).and_then(|()| file.rewind()).and_then(|()| file.write_all(text.as_bytes()));
        write.map_err(|error| failed(&error))?;
        Ok(Self { path, file })
    }
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
