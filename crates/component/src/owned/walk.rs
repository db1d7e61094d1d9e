//! The files of a marker on the disk.

use std::{
    fs::{self, DirEntry},
    io::{Error, ErrorKind},
    path::{Path, PathBuf},
};

use super::{
    marker::Marker,
    names::{LOCK, MARKER, complete_name},
};
use crate::fault::Fault;

/// An entry of a folder.
struct Found {
    path: PathBuf,
    /// The name relative to the folder of the marker.
    name: String,
    is_folder: bool,
}

/// The entries of `part` below `folder`, sorted by name; none if it does not exist.
fn entries(folder: &Path, part: &str) -> Result<Vec<Found>, Fault> {
    let here = if part.is_empty() { folder.to_owned() } else { folder.join(part) };
    let read = match fs::read_dir(&here) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.and_then(Iterator::collect::<Result<Vec<DirEntry>, Error>>),
    };
    let read = read.map_err(|error| Fault::new(format!("cannot read ({error})"), &here))?;
    let mut found = Vec::new();
    for entry in read {
        let kind = entry.file_type().map_err(|error| Fault::new(format!("cannot read ({error})"), &entry.path()))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let name = if part.is_empty() { name } else { format!("{part}/{name}") };
        // The kind of a symbolic link is link, so that it is never entered.
        found.push(Found { path: entry.path(), name, is_folder: kind.is_dir() });
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(found)
}

/// The first entry that `marker` does not list.
pub(super) fn stranger(marker: &Marker, folder: &Path, part: &str) -> Result<Option<PathBuf>, Fault> {
    for Found { path, name, is_folder } in entries(folder, part)? {
        let stranger = if !is_folder {
            let own = marker.owns(&name) || name == LOCK || complete_name(&name) == MARKER;
            (!own).then_some(path)
        } else if marker.nests(&name) {
            match Marker::read(&path)? {
                Some(inner) => self::stranger(&inner, &path, "")?,
                None => entries(&path, "")?.into_iter().next().map(|found| found.path),
            }
        } else if marker.reaches(&name) {
            self::stranger(marker, folder, &name)?
        } else {
            Some(path)
        };
        if stranger.is_some() {
            return Ok(stranger);
        }
    }
    Ok(None)
}

/// Removes what `marker` lists in `part` and below.
pub(super) fn clear(marker: &Marker, folder: &Path, part: &str) -> Result<(), Fault> {
    for Found { path, name, is_folder } in entries(folder, part)? {
        if !is_folder {
            if marker.owns(&name) {
                fs::remove_file(&path).map_err(|error| irremovable(&path, &error))?;
            }
        } else if marker.nests(&name) {
            if let Some(inner) = Marker::read(&path)? {
                inner.remove(&path)?;
            }
        } else if marker.reaches(&name) {
            clear(marker, folder, &name)?;
        }
    }
    if !part.is_empty() {
        // A folder with other files stays.
        let _ = fs::remove_dir(folder.join(part));
    }
    Ok(())
}

/// Removes the unfinished files of what `marker` lists in `part` and below.
pub(super) fn tidy(marker: &Marker, folder: &Path, part: &str) -> Result<(), Fault> {
    for Found { path, name, is_folder } in entries(folder, part)? {
        let complete = complete_name(&name);
        if is_folder && marker.reaches(&name) {
            tidy(marker, folder, &name)?;
        } else if !is_folder && complete != name && (complete == MARKER || marker.owns(&name)) {
            fs::remove_file(&path).map_err(|error| irremovable(&path, &error))?;
        }
    }
    Ok(())
}

pub(super) fn irremovable(path: &Path, error: &Error) -> Fault {
    Fault::new(format!("cannot remove ({error})"), path).remedy("check the permissions of its folder")
}
