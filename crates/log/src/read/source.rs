//! Messages out of an MCAP file, with every check sum verified and memory bounded.

use std::{
    collections::HashMap,
    fmt,
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
    sync::Arc,
};

use mcap::{
    McapError,
    records::Record,
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};
use prost::bytes::Bytes;

use crate::{chunk::limit, error::LogError, parse::parse_record, proto, topic};

/// A message as it stands in the file.
#[derive(Debug)]
pub(crate) struct Message {
    pub(crate) topic: Arc<str>,
    pub(crate) schema: Arc<str>,
    pub(crate) encoding: Arc<str>,
    pub(crate) sequence: u32,
    pub(crate) log_time: u64,
    /// Shared, so that what is decoded may refer to it.
    pub(crate) data: Bytes,
}

impl Message {
    /// The content, which must be this project's own message `name`.
    pub(crate) fn decode<M: prost::Message + Default>(&self, path: &Path, name: &str) -> Result<M, LogError> {
        let own = self.schema.strip_prefix(proto::PACKAGE) == Some(name);
        self.decode_if(own, path, || format!("{}{name}", proto::PACKAGE))
    }

    /// The content, which must have this schema.
    pub(crate) fn decode_as<M: prost::Message + Default>(&self, path: &Path, schema: &str) -> Result<M, LogError> {
        self.decode_if(&*self.schema == schema, path, || schema.to_owned())
    }

    /// The content, if its schema is the one that is `named`.
    fn decode_if<M: prost::Message + Default>(
        &self,
        is: bool,
        path: &Path,
        named: impl Fn() -> String,
    ) -> Result<M, LogError> {
        if !is || &*self.encoding != "protobuf" {
            let what = format!(
                "it is a `{}` in `{}`; this version reads `{}` in `protobuf`",
                self.schema,
                self.encoding,
                named()
            );
            return Err(foreign(path, self, &what));
        }
        M::decode(self.data.clone()).map_err(|error| foreign(path, self, &error.to_string()))
    }
}

/// A channel of the file: topic, schema's name, encoding of messages.
#[derive(Debug)]
struct Channel {
    topic: Arc<str>,
    schema: Arc<str>,
    encoding: Arc<str>,
}

/// What a reader takes of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Take {
    /// All of it.
    Full,
    /// That it is there.
    Mark,
    /// Nothing.
    Nothing,
}

/// An MCAP file read from start to end.
pub(super) struct Source {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    limit: usize,
    schemas: HashMap<u16, Arc<str>>,
    channels: HashMap<u16, Channel>,
    fed: u64,
    messages: u64,
    last_ns: u64,
    past_data: bool,
    /// What the file lacks, if it was saved of one that was not whole.
    recovered: Option<String>,
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Source").field("path", &self.path).field("messages", &self.messages).finish_non_exhaustive()
    }
}

impl Source {
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let io = |source| LogError::Io { doing: "read", path: path.to_owned(), source, remedy: "is the name right?" };
        let mut file = BufReader::new(File::open(path).map_err(io)?);
        let mut start = Vec::new();
        file.by_ref().take(16).read_to_end(&mut start).map_err(io)?;
        if !start.starts_with(mcap::MAGIC) {
            return Err(LogError::NotMcap { path: path.to_owned(), looks_like: looks_like(&start) });
        }
        let size = file.seek(SeekFrom::End(0)).map_err(io)?;
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        let limit = limit(size);
        let reader = LinearReader::new_with_options(
            LinearReaderOptions::default()
                .with_prevalidate_chunk_crcs(true)
                .with_validate_data_section_crc(true)
                .with_validate_summary_section_crc(true)
                .with_check_finishes_after_end_magic(true)
                .with_record_length_limit(limit),
        );
        Ok(Self {
            path: path.to_owned(),
            file,
            reader,
            limit,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            fed: 0,
            messages: 0,
            last_ns: 0,
            past_data: false,
            recovered: None,
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Maximum size of the messages of one frame (bytes).
    pub(super) fn limit(&self) -> usize {
        self.limit
    }

    pub(super) fn recovered(&self) -> Option<&str> {
        self.recovered.as_deref()
    }

    /// The next message of which anything is taken, by its topic and stamp; `None` when the file has been read to its end
    /// and every check sum held.
    pub(super) fn next_message(&mut self, take: impl Fn(&str, u64) -> Take) -> Result<Option<Message>, LogError> {
        loop {
            let record = match self.reader.next_event() {
                None => return Ok(None),
                Some(Err(error)) => return Err(read_error(&self.path, error, self.fed, self.messages, self.last_ns)),
                Some(Ok(LinearReadEvent::ReadRequest(need))) => {
                    let read = self.file.read(self.reader.insert(need)).map_err(|source| LogError::Io {
                        doing: "read",
                        path: self.path.clone(),
                        source,
                        remedy: "is the disk still there?",
                    })?;
                    self.reader.notify_read(read);
                    self.fed += read as u64;
                    continue;
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => parse_record(opcode, data),
            };
            let record = match record {
                Ok(record) => record,
                Err(error) => return Err(read_error(&self.path, error, self.fed, self.messages, self.last_ns)),
            };
            match record {
                Record::DataEnd(_) => self.past_data = true,
                // The summary repeats schemas and channels.
                _ if self.past_data => {}
                Record::Metadata(metadata) => {
                    self.recovered = self.recovered.take().or_else(|| topic::lost(&metadata));
                }
                Record::Schema { header, .. } => {
                    self.schemas.insert(header.id, header.name.into());
                }
                Record::Channel(channel) => {
                    let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_else(|| "".into());
                    let (topic, encoding) = (channel.topic.into(), channel.message_encoding.into());
                    let known = Channel { topic, schema, encoding };
                    self.channels.insert(channel.id, known);
                }
                Record::Message { header, data } => {
                    let Some(channel) = self.channels.get(&header.channel_id) else {
                        let what = format!("a message on channel {}, which it never declares", header.channel_id);
                        return Err(LogError::Damaged { path: self.path.clone(), what });
                    };
                    self.messages += 1;
                    self.last_ns = header.log_time;
                    let data = match take(&channel.topic, header.log_time) {
                        Take::Full => data.into_owned().into(),
                        Take::Mark => Bytes::new(),
                        Take::Nothing => continue,
                    };
                    return Ok(Some(Message {
                        topic: Arc::clone(&channel.topic),
                        schema: Arc::clone(&channel.schema),
                        encoding: Arc::clone(&channel.encoding),
                        sequence: header.sequence,
                        log_time: header.log_time,
                        data,
                    }));
                }
                _ => {}
            }
        }
    }
}

/// What a file that does not begin like an MCAP file looks like, and what to do about it.
pub fn looks_like(start: &[u8]) -> String {
    let known: [(&[u8], &str); 5] = [
        (
            b"#ROSBAG",
            // Messages shorten a text of more than 120 letters.
            "a ROS 1 bag; PyPI's `rosbags-convert --src IN.bag --dst OUT --dst-storage mcap --dst-typestore ros2_humble`",
        ),
        (
            b"SQLite format 3",
            "it looks like a ROS 2 bag in SQLite; convert it with `ros2 bag convert` or `mcap convert`",
        ),
        (b"PK\x03\x04", "it looks like a zip archive; unpack it first"),
        (b"\x28\xb5\x2f\xfd", "it is compressed with zstd; decompress it with `zstd -d`"),
        (b"PAR1", "it looks like Parquet; logs end in .mcap"),
    ];
    if start.is_empty() {
        return "it is empty; was the run interrupted?".to_owned();
    }
    match known.iter().find(|(magic, _)| start.starts_with(magic)) {
        Some((_, text)) => (*text).to_owned(),
        None => format!("it begins with the bytes {start:02x?}; logs end in .mcap"),
    }
}

fn read_error(path: &Path, error: McapError, fed: u64, messages: u64, last_ns: u64) -> LogError {
    let path = path.to_owned();
    match error {
        McapError::UnexpectedEof => LogError::Truncated { path, messages, last_ns },
        McapError::ChunkTooLarge(length) => {
            LogError::TooLarge { path, what: format!("a chunk before byte {fed} declares {length} bytes") }
        }
        McapError::RecordTooLarge { opcode, len } => {
            let what = format!("a record of kind {opcode:#04x} before byte {fed} declares {len} bytes");
            LogError::TooLarge { path, what }
        }
        error => LogError::Damaged { path, what: format!("{error}, before byte {fed}") },
    }
}

/// The error that `message` is not what its topic promises.
pub(crate) fn foreign(path: &Path, message: &Message, what: &str) -> LogError {
    let what = format!("message {} on {} at {} ns: {what}", message.sequence, message.topic, message.log_time);
    LogError::Foreign { path: path.to_owned(), what }
}
