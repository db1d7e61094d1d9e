//! One log of the logs of its parts.

use std::path::Path;

use crate::{LogError, Reader, Totals, Writer, convert, topic};

/// Writes the log of a whole trial to `to` from logs of successive frames of it, each with its totals.
///
/// Messages are copied as they are, totals added up part by part, and the header is written once. Nothing but the
/// rounding of those sums tells where one part ends and the next begins. `go_on` is asked before each part; when it
/// says no, `false` is returned and `to` + `.partial` is left.
///
/// # Errors
/// [`LogError`]: a part that cannot be read, is damaged or is of another trial, or a log that cannot be written.
pub fn join(parts: &[impl AsRef<Path>], to: &Path, mut go_on: impl FnMut() -> bool) -> Result<bool, LogError> {
    let mut writer: Option<Writer> = None;
    let mut totals = Totals::default();
    for part in parts {
        if !go_on() {
            return Ok(false);
        }
        let path = part.as_ref();
        let mut reader = Reader::open(path)?;
        let writer = match &mut writer {
            Some(writer) if writer.header() == reader.header() => writer,
            Some(_) => {
                let what = "its header differs from that of the part before it".to_owned();
                return Err(LogError::Foreign { path: path.to_owned(), what });
            }
            None => writer.insert(Writer::create(to, reader.header())?),
        };
        let mut begun = false;
        while let Some(message) = reader.next_message()? {
            match &message.topic[..] {
                topic::TOTALS => totals.merge(&convert::totals_record(message.decode(path, "Totals")?)),
                // The last of what stands before the first frame.
                topic::MODEL => begun = true,
                _ if !begun => {}
                topic => writer.copy(topic, message.log_time, &message.data)?,
            }
        }
    }
    let Some(mut writer) = writer else {
        return Err(LogError::Record { path: to.to_owned(), what: "there are no parts".to_owned() });
    };
    writer.totals(&totals)?;
    writer.finish()?;
    Ok(true)
}
