//! Files that have their name only when they are whole.

use std::{
    fs,
    path::{Path, PathBuf},
};

use seafix_component::Fault;

use crate::exit::{Failure, OUTPUT};

/// A file that is begun and not finished; it is removed where it stays so.
pub(crate) struct AtomicFile<'a> {
    path: &'a Path,
    partial: PathBuf,
}

/// Writes a file; what had its name before stays where that fails.
pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), Failure> {
    AtomicFile::begin(path)?.finish(content)
}

impl<'a> AtomicFile<'a> {
    /// Finds out whether the file can be written, before long work.
    pub(crate) fn begin(path: &'a Path) -> Result<Self, Failure> {
        if path.exists() && !path.is_file() {
            let fault = Fault::new("the output is no file", path).remedy("name a file, new or to be replaced");
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
        // After a rename there is none.
        let _ = fs::remove_file(&self.partial);
    }
}
