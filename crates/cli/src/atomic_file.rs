//! Files that get their name when they are complete.

use std::{
    fs,
    path::{Path, PathBuf},
};

use seafix_component::Fault;

use crate::exit::{Failure, OUTPUT};

/// An unfinished file; it is removed on drop.
pub(crate) struct AtomicFile<'a> {
    path: &'a Path,
    partial: PathBuf,
}

/// Writes a file; an existing file of its name stays if that fails.
pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), Failure> {
    AtomicFile::begin(path)?.finish(content)
}

impl<'a> AtomicFile<'a> {
    /// Creates the unfinished file, so that an unwritable path is detected before long work.
    pub(crate) fn begin(path: &'a Path) -> Result<Self, Failure> {
        if path.exists() && !path.is_file() {
            let fault = Fault::new("the output is not a file", path).remedy("name a new file, or one to replace");
            return Err(Failure::new(OUTPUT, fault));
        }
        let mut partial = path.as_os_str().to_owned();
        partial.push(".partial");
        let partial = PathBuf::from(partial);
        fs::write(&partial, "").map_err(|error| failed(path, &error))?;
        Ok(Self { path, partial })
    }

    pub(crate) fn finish(self, content: impl AsRef<[u8]>) -> Result<(), Failure> {
        let done = fs::write(&self.partial, content).and_then(|()| fs::rename(&self.partial, self.path));
        done.map_err(|error| failed(self.path, &error))
    }
}

fn failed(path: &Path, error: &std::io::Error) -> Failure {
    let fault = Fault::new(format!("cannot write ({error})"), path);
    Failure::new(OUTPUT, fault.remedy("check the folder, its permissions and the space left"))
}

impl Drop for AtomicFile<'_> {
    fn drop(&mut self) {
        // There is none after a rename.
        let _ = fs::remove_file(&self.partial);
    }
}
