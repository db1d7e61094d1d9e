//! Names of files in a folder that the program owns.

/// The file name of the marker.
pub const MARKER: &str = ".seafix-run";

/// The file name of the lock that a running process holds.
pub const LOCK: &str = ".lock";

/// Whether a text is the plain name of a file: no separator, no parent, no drive, no control character.
pub fn is_plain_name(name: &str) -> bool {
    let harmless = |c: char| !c.is_control() && !['/', '\\', ':'].contains(&c);
    !name.is_empty() && name != "." && name != ".." && name.chars().all(harmless)
}

fn is_number(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_digit())
}

/// A folder's name with `*` for numbers, complete or not.
pub(super) fn pattern(folder: &str) -> String {
    let step = |name: &str| match is_number(name.strip_suffix(".partial").unwrap_or(name)) {
        true => "*".to_owned(),
        false => name.to_owned(),
    };
    folder.split('/').map(step).collect::<Vec<_>>().join("/")
}

/// The complete form of a file's name: `log.mcap` for `log.mcap.partial` and `log.mcap.partial-2`.
pub(super) fn complete_name(name: &str) -> &str {
    match name.rsplit_once(".partial") {
        Some((complete, "")) => complete,
        Some((complete, rest)) if rest.strip_prefix('-').is_some_and(is_number) => complete,
        _ => name,
    }
}
