//! The file of key frames that an experiment starts from.

use std::path::Path;

use hmac_sha256::Hash as Sha256;
use seafix::Keyframes;
use seafix_component::{Fault, read_long_text};
use seafix_data::dataset::hex;
use seafix_navigation::PoseGraph;

/// A network is read up to this length (bytes): some five thousand key frames.
const MAX: u64 = 1 << 30;

/// Writes down which file is read, where that is not said; a file that cannot be read is told of when it is opened.
pub(crate) fn pin(keyframes: &mut Keyframes, folder: &Path) {
    if !keyframes.read.is_empty()
        && keyframes.sha256.is_empty()
        && let Ok(text) = read_long_text(&folder.join(&keyframes.read), MAX)
    {
        keyframes.sha256 = digest(&text);
    }
}

/// The network that is read, if one is.
///
/// # Errors
/// A file that is no network, or not the one that was meant.
pub(crate) fn open(keyframes: &Keyframes, folder: &Path) -> Result<Option<PoseGraph>, Fault> {
    if keyframes.read.is_empty() {
        return Ok(None);
    }
    let path = folder.join(&keyframes.read);
    let text = read_long_text(&path, MAX)?;
    let found = digest(&text);
    if found != keyframes.sha256 {
        return Err(Fault::new("another network than the one that was meant", &path)
            .value(format!("sha256 {found}"))
            .remedy(format!("give the one with {}, or leave `sha256` out", keyframes.sha256)));
    }
    PoseGraph::read(&path, &text, &keyframes.settings.recognition).map(Some)
}

/// Of the text, which is what is read: byte order mark and line ends do not count.
fn digest(text: &str) -> String {
    hex(&Sha256::hash(text.as_bytes()))
}
