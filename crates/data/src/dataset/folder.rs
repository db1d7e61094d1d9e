//! Paths inside a data set's folder.

use std::path::{Component as Part, Path, PathBuf};

use seafix_component::Fault;

use super::names::found;

/// Whether `name` is a valid path to a file that does not exist in `folder`.
pub(super) fn is_absent(folder: &Path, name: &str) -> bool {
    let sound = !name.is_empty()
        && !name.contains(['\\', '\0'])
        && Path::new(name).components().all(|part| matches!(part, Part::Normal(_) | Part::CurDir));
    // A dangling link exists, and may point outside.
    sound && folder.join(name).symlink_metadata().is_err()
}

/// The existing file inside `folder` with the path `name`, which the file `mentioned_in` contains.
pub(super) fn inside(folder: &Path, name: &str, mentioned_in: &Path) -> Result<PathBuf, Fault> {
    let fault = |what: &str, remedy: &str| Fault::new(what, mentioned_in).value(format!("`{name}`")).remedy(remedy);
    if name.is_empty() || name.contains(['\\', '\0']) {
        return Err(fault(
            "a path without a file name",
            "give a path relative to the data set's folder, with / between its parts",
        ));
    }
    if !Path::new(name).components().all(|part| matches!(part, Part::Normal(_) | Part::CurDir)) {
        return Err(fault("a path that leads out of the data set", "give a path relative to its folder, without `..`"));
    }
    let path = found(&folder.join(name));
    let (Ok(real), Ok(home)) = (path.canonicalize(), folder.canonicalize()) else {
        return Err(fault(
            "a file that does not exist",
            &format!("put it into {} or correct the name", folder.display()),
        ));
    };
    if !real.starts_with(&home) {
        return Err(fault("a link that leads out of the data set", "copy the file into the folder"));
    }
    if !real.is_file() {
        return Err(fault("a path that is not a file", "name a file"));
    }
    Ok(path)
}
