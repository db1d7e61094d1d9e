//! The marker of a folder: the proof that the folder belongs to the program.

use std::{
    collections::BTreeSet,
    fs,
    io::{Error, ErrorKind, Read as _},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{
    names::{LOCK, MARKER, complete_name, is_plain_name, pattern},
    partial::PartialFile,
    walk,
};
use crate::fault::Fault;

const FORMAT: &str = "seafix-run/1";

/// The content of `.seafix-run`: the identity of a folder's content, and the files that the program owns in it.
///
/// Names are relative, with `/` between folders. A folder `*` stands for every folder with a number as its name.
/// Unfinished files (`.partial`) of listed names are owned too.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Marker {
    format: String,
    /// The kind of the folder: `run`, `report`, `reports`, `shards`.
    kind: String,
    /// The identity of the run.
    identity: String,
    /// The owned files.
    files: BTreeSet<String>,
    /// The owned folders below with a marker of their own.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    folders: BTreeSet<String>,
}

/// The owner of a folder.
#[derive(Debug)]
pub enum Ownership {
    /// The folder is absent or empty, apart from the lock of a process that was killed before it began.
    Free,
    /// The folder has a marker of this kind.
    Ours(Marker),
    /// The folder has no such marker; the value is the name of its first entry.
    Foreign(String),
}

impl Ownership {
    /// The owner of `folder`, as a folder of this kind.
    ///
    /// # Errors
    /// A path that is a symbolic link or no folder, a folder that cannot be read, or an invalid marker.
    pub fn of(folder: &Path, kind: &str) -> Result<Self, Fault> {
        // Files of the empty path are those of the current folder.
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let is_link = match fs::symlink_metadata(folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Self::Free),
            Err(error) => return Err(unusable(folder, &error)),
            Ok(metadata) => metadata.is_symlink(),
        };
        if is_link {
            let remedy = "name the folder to which it points, or choose a new one with --out";
            return Err(Fault::new("an output folder that is a symbolic link", folder).remedy(remedy));
        }
        match Marker::read(folder)? {
            Some(marker) if marker.kind == kind => return Ok(Self::Ours(marker)),
            Some(marker) => return Ok(Self::Foreign(format!("{MARKER} of kind {}", marker.kind))),
            None => {}
        }
        let mut names = Vec::new();
        for entry in fs::read_dir(folder).map_err(|error| unusable(folder, &error))? {
            let entry = entry.map_err(|error| unusable(folder, &error))?;
            if !is_of_the_beginning(&entry.path()) {
                names.push(entry.file_name().to_string_lossy().into_owned());
            }
        }
        Ok(names.into_iter().min().map_or(Self::Free, Self::Foreign))
    }
}

/// Whether a file is all that a process leaves that is killed before it has written the marker: its lock, or the
/// unfinished marker. Names alone are no proof.
fn is_of_the_beginning(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let begins = match complete_name(&name) {
        LOCK if name == LOCK => "process ",
        MARKER if name != MARKER => "format = \"seafix-run/",
        _ => return false,
    };
    if !fs::symlink_metadata(path).is_ok_and(|file| file.is_file()) {
        return false;
    }
    let mut start = Vec::new();
    let read = fs::File::open(path).and_then(|file| file.take(begins.len() as u64).read_to_end(&mut start));
    read.is_ok() && begins.as_bytes().starts_with(&start)
}

fn unusable(folder: &Path, error: &Error) -> Fault {
    let fault = Fault::new(format!("cannot create the output folder ({error})"), folder);
    if folder.is_file() {
        return fault.remedy("a file has this name; give a new folder with --out");
    }
    fault.remedy("check free space and permissions, or choose another with --out")
}

impl Marker {
    /// The maximum size of a marker (bytes).
    const MAX_BYTES: u64 = 64 << 20;

    /// A marker of these files.
    pub fn new(kind: &str, identity: &str, files: impl IntoIterator<Item = String>) -> Self {
        let (kind, identity, files) = (kind.to_owned(), identity.to_owned(), files.into_iter().collect());
        Self { format: FORMAT.to_owned(), kind, identity, files, folders: BTreeSet::new() }
    }

    /// The marker with a folder that has a marker of its own.
    #[must_use]
    pub fn with_folder(mut self, name: impl Into<String>) -> Self {
        self.folders.insert(name.into());
        self
    }

    /// Reads the marker of `folder`; `None` without one.
    ///
    /// # Errors
    /// A marker that is no regular file, is too large, or is invalid: it names a file outside of the folder.
    pub fn read(folder: &Path) -> Result<Option<Self>, Fault> {
        let path = folder.join(MARKER);
        let invalid = |what: String| {
            let remedy = "move the files away, or choose a new folder with --out";
            Fault::new("an invalid marker of a run", &path).value(what).remedy(remedy)
        };
        match fs::symlink_metadata(&path) {
            // A file instead of a folder has no marker either.
            Err(error) if [ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&error.kind()) => return Ok(None),
            Err(error) => return Err(invalid(error.to_string())),
            Ok(file) if !file.is_file() => return Err(invalid("it is not a regular file".to_owned())),
            Ok(_) => {}
        }
        let text = crate::text::read_long_text(&path, Self::MAX_BYTES)?;
        let marker: Self = toml::from_str(&text).map_err(|error| Fault::in_toml(&path, &text, &error))?;
        if marker.format != FORMAT {
            return Err(invalid(format!("format `{}`; this version reads {FORMAT}", marker.format)));
        }
        match marker.files.iter().chain(&marker.folders).find(|name| !is_inside(name)) {
            Some(name) => Err(invalid(format!("`{name}` is not the name of a file in the folder"))),
            None => Ok(Some(marker)),
        }
    }

    /// Writes the marker into `folder`, which must exist.
    ///
    /// # Errors
    /// The error of the operating system.
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        let text = toml::to_string(self).map_err(Error::other)?;
        PartialFile::write(&folder.join(MARKER), text.as_bytes())
    }

    /// The marker with the files of another one.
    #[must_use]
    pub fn and(mut self, other: &Self) -> Self {
        self.files.extend(other.files.iter().cloned());
        self
    }

    /// The marker without the files of another one.
    #[must_use]
    pub fn without(mut self, other: &Self) -> Self {
        self.files.retain(|name| !other.files.contains(name));
        self
    }

    /// Whether the marker lists this file, or the file of which it is the unfinished form.
    pub fn owns(&self, name: &str) -> bool {
        let (folder, file) = name.rsplit_once('/').map_or(("", name), |(folder, file)| (folder, file));
        let folder = pattern(folder);
        let full = |file: &str| if folder.is_empty() { file.to_owned() } else { format!("{folder}/{file}") };
        self.files.contains(&full(file)) || self.files.contains(&full(complete_name(file)))
    }

    /// Whether the marker lists a file in this folder or below.
    pub(super) fn reaches(&self, folder: &str) -> bool {
        let below = pattern(folder) + "/";
        self.files.range(below.clone()..).next().is_some_and(|name| name.starts_with(&below))
    }

    /// Whether the folder of this name has a marker of its own.
    pub(super) fn nests(&self, folder: &str) -> bool {
        self.folders.contains(folder)
    }

    /// The first entry of `folder` that the marker does not list.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn stranger(&self, folder: &Path) -> Result<Option<PathBuf>, Fault> {
        walk::stranger(self, folder, "")
    }

    /// Removes the listed files below `folder`/`part` (everything if `part` is empty) and the folders that are then
    /// empty. All other files, the marker, and the lock stay. Symbolic links are not followed.
    ///
    /// # Errors
    /// A file that cannot be removed.
    pub fn clear(&self, folder: &Path, part: &str) -> Result<(), Fault> {
        walk::clear(self, folder, part)
    }

    /// Removes the unfinished forms of the listed files, which a killed process has left.
    ///
    /// # Errors
    /// A file that cannot be removed.
    pub fn tidy(&self, folder: &Path) -> Result<(), Fault> {
        walk::tidy(self, folder, "")
    }

    /// Removes the listed files, the marker, and the folder if it is then empty.
    ///
    /// # Errors
    /// A file that cannot be removed.
    pub fn remove(&self, folder: &Path) -> Result<(), Fault> {
        walk::clear(self, folder, "")?;
        // The marker goes last, so that an interruption leaves a folder that is known to be ours.
        for path in [folder.join(LOCK), folder.join(MARKER)] {
            if fs::symlink_metadata(&path).is_ok_and(|file| file.is_file()) {
                fs::remove_file(&path).map_err(|error| walk::irremovable(&path, &error))?;
            }
        }
        // A folder with other files stays.
        let _ = fs::remove_dir(folder);
        Ok(())
    }
}

/// Whether a name stays inside of its folder on every platform.
fn is_inside(name: &str) -> bool {
    name.split('/').all(is_plain_name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(path: PathBuf) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "x").unwrap();
    }

    fn run() -> Marker {
        let files = ["a.mcap", "pieces/*/a.mcap", "figures/rates.svg"];
        Marker::new("run", "1", files.map(str::to_owned)).with_folder("report")
    }

    #[test]
    fn only_listed_files_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let own = ["a.mcap", "a.mcap.partial", "a.mcap.partial-3", "pieces/000001/a.mcap", "pieces/7.partial/a.mcap"];
        let others = [
            "b.mcap",
            "a.mcap.partial-x",
            "pieces/a.mcap",
            "pieces/x/a.mcap",
            "pieces/7.partial/notes",
            "report/a.mcap",
        ];
        own.iter().chain(&others).for_each(|name| put(at(name)));
        assert!(matches!(Ownership::of(folder.path(), "run").unwrap(), Ownership::Foreign(name) if name == "a.mcap"));
        run().write(folder.path()).unwrap();
        let Ownership::Ours(marker) = Ownership::of(folder.path(), "run").unwrap() else { panic!("it has a marker") };
        assert_eq!(marker, run());
        assert!(marker.stranger(folder.path()).unwrap().is_some());
        marker.clear(folder.path(), "").unwrap();
        for name in own {
            assert!(!at(name).exists(), "{name}");
        }
        for name in others {
            assert!(at(name).exists(), "{name}");
        }
        assert!(!at("pieces/000001").exists() && at(MARKER).exists());
        marker.remove(folder.path()).unwrap();
        assert!(!at(MARKER).exists() && folder.path().exists());
    }

    #[test]
    fn a_folder_with_listed_files_only_goes() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        put(out.join("pieces/12/a.mcap"));
        put(out.join("figures/rates.svg"));
        put(out.join("report/page.html"));
        put(out.join(LOCK));
        Marker::new("run", "1", ["page.html".to_owned()]).write(&out.join("report")).unwrap();
        run().write(&out).unwrap();
        assert_eq!(run().stranger(&out).unwrap(), None);
        run().remove(&out).unwrap();
        assert!(!out.exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_not_followed() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let (out, other) = (folder.path().join("out"), folder.path().join("other"));
        put(other.join("a.mcap"));
        put(other.join("1/a.mcap"));
        fs::create_dir(&out).unwrap();
        run().write(&out).unwrap();
        symlink(&other, out.join("pieces")).unwrap();
        symlink(other.join("a.mcap"), out.join("a.mcap")).unwrap();
        assert_eq!(run().stranger(&out).unwrap(), Some(out.join("pieces")));
        run().clear(&out, "").unwrap();
        assert!(other.join("a.mcap").exists() && other.join("1/a.mcap").exists());
        symlink(&out, folder.path().join("link")).unwrap();
        assert!(Ownership::of(&folder.path().join("link"), "run").is_err());
        symlink(other.join("a.mcap"), folder.path().join("x.partial")).unwrap();
        PartialFile::write(&folder.path().join("x"), b"new").unwrap();
        assert_eq!(fs::read_to_string(other.join("a.mcap")).unwrap(), "x");
    }

    #[test]
    fn a_marker_that_names_a_file_elsewhere_is_rejected() {
        for name in ["../a", "/etc/passwd", "a//b", "a/../b", "", "C:\\a", "a/.", "a\nb"] {
            let folder = tempfile::tempdir().unwrap();
            Marker::new("run", "1", [name.to_owned()]).write(folder.path()).unwrap();
            let fault = Ownership::of(folder.path(), "run").unwrap_err().to_string();
            assert!(fault.contains("an invalid marker"), "{name}: {fault}");
        }
    }

    #[test]
    fn remains_of_a_killed_process_are_free_and_others_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        fs::write(path.join(LOCK), "process 12 on host\n").unwrap();
        fs::write(path.join(".seafix-run.partial"), "format = \"seafix-run/1\"\nident").unwrap();
        assert!(matches!(Ownership::of(path, "run").unwrap(), Ownership::Free));
        fs::write(path.join(LOCK), "my own notes").unwrap();
        assert!(matches!(Ownership::of(path, "run").unwrap(), Ownership::Foreign(name) if name == LOCK));
    }
}
