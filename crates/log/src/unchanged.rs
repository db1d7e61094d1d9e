//! The check of a run's file against the manifest beside it.

use std::{
    fs::File,
    io::{ErrorKind, Read as _},
    path::Path,
};

use hmac_sha256::Hash as Sha256;
use serde::Deserialize;

use crate::error::LogError;

/// The part of a manifest with the hashes.
#[derive(Deserialize)]
struct Hashes {
    state: String,
    #[serde(default)]
    outputs: std::collections::BTreeMap<String, String>,
}

/// The maximum size of a manifest (bytes).
const MAX_MANIFEST: u64 = 64 << 20;

/// Checks a log or table against the SHA-256 in the `manifest.json` of its folder.
///
/// A file without the manifest of a finished run, or one that the manifest does not list, passes: there is nothing to
/// compare it with.
///
/// # Errors
/// [`LogError`] when the file differs or cannot be read.
pub fn unchanged(file: &Path) -> Result<(), LogError> {
    let io = |source| LogError::Io { doing: "read", path: file.to_owned(), source, remedy: "is the name right?" };
    let manifest = match File::open(file.with_file_name("manifest.json")) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        manifest => manifest.map_err(io)?,
    };
    let mut text = Vec::new();
    manifest.take(MAX_MANIFEST).read_to_end(&mut text).map_err(io)?;
    let Ok(Hashes { state, outputs }) = serde_json::from_slice(&text) else { return Ok(()) };
    let known = file.file_name().and_then(|name| outputs.get(&*name.to_string_lossy()));
    let Some(known) = known.filter(|_| state == "finished") else { return Ok(()) };
    let (mut opened, mut hash) = (File::open(file).map_err(io)?, Sha256::new());
    let mut buffer = vec![0; 1 << 18];
    loop {
        match opened.read(&mut buffer).map_err(io)? {
            0 => break,
            read => hash.update(&buffer[..read]),
        }
    }
    let found: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    if found == *known {
        return Ok(());
    }
    Err(LogError::Changed { path: file.to_owned() })
}
