//! Reading of text files.

use std::{io::Read, path::Path};

use crate::Fault;

/// The text of a file of at most 64 MiB: UTF-8, with an optional byte order mark and LF or CRLF line ends.
///
/// # Errors
/// A file that is missing, too large, or not UTF-8.
pub fn read_text(path: &Path) -> Result<String, Fault> {
    read_long_text(path, 64 << 20)
}

/// The text of a file of at most `limit` bytes.
///
/// It serves files that programs write and that grow with a run.
///
/// # Errors
/// As [`read_text`].
pub fn read_long_text(path: &Path, limit: u64) -> Result<String, Fault> {
    let unreadable = |error: std::io::Error| {
        Fault::new(format!("cannot read ({error})"), path).remedy("check the path and its permissions")
    };
    let mut bytes = Vec::new();
    // The size is limited while reading: a device file reports no size and may have no end.
    let file = std::fs::File::open(path).map_err(unreadable)?;
    file.take(limit + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > limit {
        return Err(Fault::new("text file too large", path)
            .value(format!("more than {limit} bytes"))
            .remedy(format!("at most {limit} bytes are read")));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        Fault::new("not UTF-8", path).value(format!("byte {at}")).remedy("save the file as UTF-8")
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(&text).replace("\r\n", "\n"))
}
