//! Files that get their name when they are complete.

use std::{
    fs::{self, File, OpenOptions},
    io::{Error, ErrorKind, Write},
    path::{Path, PathBuf},
};

/// An unfinished file beside its final path; it is removed on drop.
///
/// Its name is `PATH.partial`, or `PATH.partial-N` if that exists. It is always created new, so that neither an existing
/// file nor the target of a symbolic link is written.
#[derive(Debug)]
pub struct PartialFile {
    path: PathBuf,
    partial: PathBuf,
    done: bool,
}

impl PartialFile {
    /// Maximum number of remains beside a file.
    const MAX_REMAINS: u32 = 1000;

    /// Creates the unfinished file of `path`.
    ///
    /// # Errors
    /// The error of the operating system.
    pub fn create(path: &Path) -> Result<(Self, File), Error> {
        for number in 0..Self::MAX_REMAINS {
            let mut partial = path.as_os_str().to_owned();
            partial.push(if number == 0 { ".partial".to_owned() } else { format!(".partial-{number}") });
            let partial = PathBuf::from(partial);
            match OpenOptions::new().write(true).create_new(true).open(&partial) {
                Ok(file) => return Ok((Self { path: path.to_owned(), partial, done: false }, file)),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(Error::new(ErrorKind::AlreadyExists, "too many remains of interrupted commands beside it"))
    }

    /// Writes a complete file.
    ///
    /// # Errors
    /// The error of the operating system; an existing file of this name is then unchanged.
    pub fn write(path: &Path, content: &[u8]) -> Result<(), Error> {
        let (partial, mut file) = Self::create(path)?;
        file.write_all(content)?;
        partial.finish()
    }

    /// The path of the unfinished file.
    pub fn unfinished(&self) -> &Path {
        &self.partial
    }

    /// Gives the file its final name. A symbolic link of this name is replaced, not followed.
    ///
    /// # Errors
    /// The error of the operating system; the unfinished file is then removed.
    pub fn finish(mut self) -> Result<(), Error> {
        fs::rename(&self.partial, &self.path)?;
        self.done = true;
        Ok(())
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        if !self.done {
            let _ = fs::remove_file(&self.partial);
        }
    }
}
