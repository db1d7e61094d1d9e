//! Folders that belong to the program, and files that get their name when they are complete.

mod marker;
mod names;
mod partial;
mod walk;

pub use marker::{Marker, Ownership};
pub use names::{LOCK, MARKER, is_plain_name};
pub use partial::PartialFile;

/// Creates the folder `path` unless it exists.
///
/// # Errors
/// The error of the operating system; a symbolic link to a folder is an error too, so that nothing is written through it.
pub fn create_real_folder(path: &std::path::Path) -> Result<(), std::io::Error> {
    match std::fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => Ok(()),
        Ok(_) => Err(std::io::Error::new(std::io::ErrorKind::AlreadyExists, "a file or symbolic link has this name")),
        Err(_) => std::fs::create_dir_all(path),
    }
}
