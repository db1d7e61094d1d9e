//! Files that get their name when they are complete.

use std::{
    fs::{self, File},
    io::Write as _,
    path::{Path, PathBuf},
};

use clap::Args;
use seafix_component::{Fault, PartialFile};

use crate::exit::{Failure, OUTPUT};

/// The treatment of an existing output file.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Replacing {
    /// Replace an existing file.
    #[arg(long, requires = "out")]
    overwrite: bool,
}

/// An unfinished file; it is removed on drop.
pub(crate) struct AtomicFile<'a> {
    path: &'a Path,
    partial: PartialFile,
    file: File,
}

/// Writes a new file.
///
/// # Errors
/// A file that exists: the commands that write by this function replace nothing.
pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), Failure> {
    if fs::symlink_metadata(path).is_ok() {
        let fault = Fault::new("the output file exists", path);
        return Err(Failure::new(OUTPUT, fault.remedy("name a new file with --out, or move this one away")));
    }
    AtomicFile::begin(path, Replacing { overwrite: false }, &[])?.finish(content)
}

impl<'a> AtomicFile<'a> {
    /// Creates the unfinished file, so that an unwritable path is detected before long work.
    ///
    /// An existing file stays unless it is to be replaced. One of the `inputs`, or a file in a folder of them, is never
    /// replaced.
    pub(crate) fn begin(path: &'a Path, replacing: Replacing, inputs: &[&Path]) -> Result<Self, Failure> {
        let write_error = |fault: Fault| Err(Failure::new(OUTPUT, fault));
        if let Ok(existing) = fs::symlink_metadata(path) {
            if !existing.is_file() {
                return write_error(
                    Fault::new("the output is not a file", path).remedy("name a new file, or one to replace"),
                );
            }
            if let Some(input) = inputs.iter().find(|input| is_inside(path, input)) {
                let fault = Fault::new("an input as output", path).value(input.display());
                return write_error(fault.remedy("name another file with --out"));
            }
            if !replacing.overwrite {
                let fault = Fault::new("the output file exists", path);
                return write_error(fault.remedy("name a new file with --out, or replace this one with --overwrite"));
            }
        }
        let (partial, file) = PartialFile::create(path).map_err(|error| failed(path, &error))?;
        Ok(Self { path, partial, file })
    }

    pub(crate) fn finish(mut self, content: impl AsRef<[u8]>) -> Result<(), Failure> {
        // The content reaches the disk before an existing file loses its name.
        let written = self.file.write_all(content.as_ref()).and_then(|()| self.file.sync_all());
        written.and_then(|()| self.partial.finish()).map_err(|error| failed(self.path, &error))
    }
}

/// Whether a path is `input` or lies in it, by whatever names.
fn is_inside(path: &Path, input: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| PathBuf::from(path));
    real(path).starts_with(real(input)) || is_same(path, input)
}

/// Whether two names are hard links to one file.
#[cfg(unix)]
fn is_same(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let number = |path: &Path| fs::metadata(path).map(|file| (file.dev(), file.ino())).ok();
    number(one).is_some() && number(one) == number(other)
}

/// Canonical paths suffice on other systems.
#[cfg(not(unix))]
fn is_same(_one: &Path, _other: &Path) -> bool {
    false
}

fn failed(path: &Path, error: &std::io::Error) -> Failure {
    let fault = Fault::new(format!("cannot write ({error})"), path);
    Failure::new(OUTPUT, fault.remedy("check the folder, its permissions and the space left"))
}
