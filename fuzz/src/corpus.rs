//! The corpus: small valid files, one folder for each parser.

use std::{
    borrow::Cow,
    fs,
    io::Cursor,
    path::{Path, PathBuf},
};

use mcap::{WriteOptions, records::MessageHeader};
use seafix_log::{GreyImage, LogError, TrialLog, Writer};

/// The folder of the corpus.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus")
}

/// The files of a parser's corpus, sorted by name.
///
/// # Errors
/// A folder without files.
pub fn corpus(name: &str) -> Result<Vec<Vec<u8>>, String> {
    let here = folder().join(name);
    let mut paths: Vec<PathBuf> =
        fs::read_dir(&here).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    paths.sort();
    let files: Vec<Vec<u8>> = paths.iter().filter_map(|path| fs::read(path).ok()).collect();
    if files.is_empty() { Err(format!("no corpus in {}", here.display())) } else { Ok(files) }
}

/// An MCAP file without checksums and compression, so that a mutation passes beyond them.
///
/// # Errors
/// The cause, if the file cannot be read.
pub fn rewrite_logs(log: &[u8]) -> Result<Vec<u8>, String> {
    let mut writer = WriteOptions::new()
        .compression(None)
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false)
        .calculate_summary_section_crc(false)
        .create(Cursor::new(Vec::new()))
        .map_err(|error| error.to_string())?;
    for message in mcap::MessageStream::new(log).map_err(|error| error.to_string())? {
        let message = message.map_err(|error| error.to_string())?;
        let (schema, channel) = (message.channel.schema.as_ref(), &message.channel);
        // Descriptors are no input of a reader; without them the file is small.
        let schema = schema.map_or(Ok(0), |schema| {
            let data =
                if schema.encoding == "protobuf" { Cow::Borrowed(&[][..]) } else { Cow::Borrowed(&*schema.data) };
            writer.add_schema(&schema.name, &schema.encoding, &data)
        });
        let id = schema
            .and_then(|schema| writer.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata))
            .map_err(|error| error.to_string())?;
        let (log_time, publish_time) = (message.log_time, message.publish_time);
        let header = MessageHeader { channel_id: id, sequence: message.sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, &message.data).map_err(|error| error.to_string())?;
    }
    writer.finish().map_err(|error| error.to_string())?;
    Ok(writer.into_inner().into_inner())
}

/// A log with the header and first frames of the log at `path`, with images of 8 × 6 px.
///
/// # Errors
/// The cause, if a log cannot be read or written.
pub fn small_log(path: &Path) -> Result<Vec<u8>, String> {
    const SIZE: [u32; 2] = [8, 6];
    let cause = |error: LogError| error.to_string();
    let TrialLog { mut header, mut frames } = seafix_log::read(path).map_err(cause)?;
    header.rig.left.size = SIZE;
    header.rig.right.size = SIZE;
    frames.truncate(2);
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let small = folder.path().join("small.mcap");
    let mut writer = Writer::create(&small, &header).map_err(cause)?;
    for mut frame in frames {
        let pixels = (0..48).map(|k| k * 5).collect();
        let image = GreyImage { width: SIZE[0], height: SIZE[1], pixels };
        frame.images = Some([image.clone(), image]);
        writer.frame(&frame).map_err(cause)?;
    }
    writer.finish().map_err(cause)?;
    fs::read(small).map_err(|error| error.to_string())
}
