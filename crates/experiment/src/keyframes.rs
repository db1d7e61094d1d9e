//! The pose graph file that an experiment starts from.

use std::path::Path;

use hmac_sha256::Hash as Sha256;
use seafix::KeyframeSettings;
use seafix_component::{Fault, read_long_text};
use seafix_data::dataset::hex;
use seafix_navigation::PoseGraph;

/// The maximum size of a pose graph file (bytes), about five thousand key frames.
const MAX: u64 = 1 << 30;

/// Records the hash of the file that is read, unless the settings have one. A file that cannot be read is reported on
/// opening.
pub(crate) fn pin(keyframes: &mut KeyframeSettings, folder: &Path) {
    if !keyframes.read.is_empty()
        && keyframes.sha256.is_empty()
        && let Ok(text) = read_long_text(&folder.join(&keyframes.read), MAX)
    {
        keyframes.sha256 = digest(&text);
    }
}

/// Opens the pose graph that the settings name, if there is one.
///
/// # Errors
/// A file without a valid pose graph, or with another hash than expected.
pub(crate) fn open(keyframes: &KeyframeSettings, folder: &Path) -> Result<Option<PoseGraph>, Fault> {
    if keyframes.read.is_empty() {
        return Ok(None);
    }
    let path = folder.join(&keyframes.read);
    let text = read_long_text(&path, MAX)?;
    let found = digest(&text);
    if found != keyframes.sha256 {
        return Err(Fault::new("a pose graph with another SHA-256 than expected", &path)
            .value(format!("sha256 {found}"))
            .remedy(format!("give the file with {}, or remove `sha256`", keyframes.sha256)));
    }
    PoseGraph::read(&path, &text, &keyframes.settings.recognition).map(Some)
}

/// The hash of the text; byte order mark and line ends are ignored.
fn digest(text: &str) -> String {
    hex(&Sha256::hash(text.as_bytes()))
}
