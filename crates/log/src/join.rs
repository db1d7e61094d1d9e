//! One log of the logs of its parts.

use std::path::Path;

use crate::{
    convert,
    error::LogError,
    read::{Message, Reader},
    record::Totals,
    topic,
    write::Writer,
};

/// Writes the log of a whole trial to `to` from logs of successive frames of it, each with its totals.
///
/// Messages are copied as they are, totals added up part by part, and the header is written once. The joined log
/// equals a log written at once, except for the rounding of the totals. `go_on` is called before each part; if it returns
/// `false`, no file is written and the result is `false`.
///
/// # Errors
/// [`LogError`]: a part that cannot be read, is damaged or is of another trial, or a log that cannot be written.
pub fn join(parts: &[impl AsRef<Path>], to: &Path, go_on: impl FnMut() -> bool) -> Result<bool, LogError> {
    join_lacking(parts, to, None, go_on)
}

/// The same of parts of which some are `lacking`, in words: the log says so, as one does that [`recover`](crate::recover)
/// saved.
///
/// # Errors
/// As [`join`].
pub fn join_lacking(
    parts: &[impl AsRef<Path>],
    to: &Path,
    lacking: Option<&str>,
    mut go_on: impl FnMut() -> bool,
) -> Result<bool, LogError> {
    let mut lost: Vec<String> = lacking.map(str::to_owned).into_iter().collect();
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
        let mut copy = |messages: &[Message]| -> Result<(), LogError> {
            for message in messages {
                match &message.topic[..] {
                    topic::TOTALS => totals.merge(&convert::totals_record(message.decode(path, "Totals")?)),
                    // The last message before the first frame; a recovered log may lack it.
                    topic::MODEL => begun = true,
                    topic if !begun && !topic::is_of_frame(topic) => {}
                    topic => {
                        begun = true;
                        writer.copy(topic, message.log_time, &message.data)?;
                    }
                }
            }
            Ok(())
        };
        // Some are written, which is to compress them, while the next are read.
        let mut read = some_messages(&mut reader)?;
        while !read.is_empty() {
            let (written, next) = rayon::join(|| copy(&read), || some_messages(&mut reader));
            written?;
            read = next?;
        }
        lost.extend(reader.recovered().map(str::to_owned));
    }
    let Some(mut writer) = writer else {
        return Err(LogError::Record { path: to.to_owned(), what: "there are no parts".to_owned() });
    };
    writer.totals(&totals)?;
    if !lost.is_empty() {
        writer.lacks(&lost.join("; "))?;
    }
    writer.finish()?;
    Ok(true)
}

/// The next messages, some megabytes of them; none at the end.
fn some_messages(reader: &mut Reader) -> Result<Vec<Message>, LogError> {
    const BYTES: usize = 4 << 20;
    let (mut messages, mut bytes) = (Vec::new(), 0);
    while bytes < BYTES {
        let Some(message) = reader.next_message()? else { break };
        bytes += message.data.len();
        messages.push(message);
    }
    Ok(messages)
}
