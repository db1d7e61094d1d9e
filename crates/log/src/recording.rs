//! Any MCAP file: its topics, and its messages in any order.

use std::{
    collections::{HashMap, hash_map},
    fmt,
    fs::File,
    io::{BufReader, Read as _, Seek as _, SeekFrom},
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use mcap::records::{self, Record};

use crate::{
    chunk::{chunk, limit},
    error::LogError,
    parse::parse_record,
    read::looks_like,
    topic,
    unpacked::{Unpacked, unpacked_message},
};

/// A channel of a recording: its topic, and what its messages are said to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// The name of its messages' schema: `sensor_msgs/msg/Image`.
    pub schema: String,
    /// How the schema is written: `ros2msg`, `ros2idl`, `protobuf`.
    pub schema_encoding: String,
    /// The schema.
    pub definition: Arc<[u8]>,
    /// How its messages are written: `cdr`, `protobuf`.
    pub encoding: String,
}

/// A message of a recording: where it stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// Index of its topic.
    pub topic: usize,
    /// When it was recorded (ns).
    pub log_time: u64,
    /// Its number on its channel.
    pub sequence: u32,
    /// The byte at which its chunk's record begins, or its own where it has no chunk.
    pub offset: u64,
    /// Its place in the chunk.
    place: u32,
}

/// Bytes of the messages of one chunk, in order.
type Chunk = Arc<Vec<Vec<u8>>>;

/// An MCAP file, read through once: every check sum held, and where its messages stand is known.
///
/// In memory are the places of the messages and one chunk.
pub struct Recording {
    path: PathBuf,
    /// The content of a compressed file; `None` where the file itself is read.
    unpacked: Option<Mutex<File>>,
    size: u64,
    topics: Vec<Topic>,
    entries: Vec<Entry>,
    is_protected: bool,
    recovered: Option<String>,
    last_chunk: Mutex<Option<(u64, Chunk)>>,
}

impl fmt::Debug for Recording {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recording").field("path", &self.path).field("topics", &self.topics).finish_non_exhaustive()
    }
}

impl Recording {
    /// Reads the file at `path` through and notes the messages of the topics that are `wanted`.
    ///
    /// # Errors
    /// [`LogError`] when it is no MCAP file, cut off, damaged, or claims more than it can hold.
    pub fn open(path: &Path, wanted: impl Fn(&Topic) -> bool) -> Result<Self, LogError> {
        let io = |source| LogError::Io { doing: "read", path: path.to_owned(), source, remedy: "is the name right?" };
        let Unpacked { file, size, temporary, lost } = Unpacked::open(path)?;
        let mut input = BufReader::new(file);
        let mut start = Vec::new();
        input.by_ref().take(16).read_to_end(&mut start).map_err(io)?;
        if !start.starts_with(mcap::MAGIC) {
            return Err(LogError::NotMcap { path: path.to_owned(), looks_like: looks_like(&start) });
        }
        input.seek(SeekFrom::Start(mcap::MAGIC.len() as u64)).map_err(io)?;
        let mut walk = Walk {
            path,
            size,
            wanted,
            schemas: HashMap::new(),
            declared: 0,
            channels: HashMap::new(),
            topics: Vec::new(),
            entries: Vec::new(),
            messages: 0,
            last_ns: 0,
            is_protected: true,
            recovered: None,
        };
        let damaged = |what| LogError::Damaged { path: path.to_owned(), what };
        walk.through(&mut input).map_err(|error| lost.clone().map_or(error, damaged))?;
        if let Some(what) = lost {
            return Err(damaged(what));
        }
        let Walk { topics, entries, is_protected, recovered, .. } = walk;
        let path = path.to_owned();
        let unpacked = temporary.then(|| Mutex::new(input.into_inner()));
        Ok(Self { path, unpacked, size, topics, entries, is_protected, recovered, last_chunk: Mutex::new(None) })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its topics, whether wanted or not: one a channel.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// The messages of the wanted topics, in the order of the file.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Whether check sums covered all that was read.
    pub fn is_protected(&self) -> bool {
        self.is_protected
    }

    /// What the file lacks, where [`recover`](crate::recover) saved it of one that was not whole.
    pub fn recovered(&self) -> Option<&str> {
        self.recovered.as_deref()
    }

    /// The bytes of a message.
    ///
    /// # Errors
    /// [`LogError`] when the file is no more what it was.
    pub fn message(&self, entry: &Entry) -> Result<Vec<u8>, LogError> {
        let held =
            |last: &Option<(u64, Chunk)>| last.as_ref().filter(|(at, _)| *at == entry.offset).map(|l| l.1.clone());
        let lock = || self.last_chunk.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let held = held(&lock());
        let messages = match held {
            Some(messages) => messages,
            None => {
                let messages = Arc::new(self.messages_at(entry.offset)?);
                *lock() = Some((entry.offset, Arc::clone(&messages)));
                messages
            }
        };
        let damaged = |what| LogError::Damaged { path: self.path.clone(), what };
        let message = messages.get(entry.place as usize).cloned();
        let message = message.ok_or_else(|| damaged(format!("the record at byte {} changed", entry.offset)))?;
        match self.topics[entry.topic].encoding.as_str() {
            "cdr" => unpacked_message(message, self.size).map_err(damaged),
            _ => Ok(message),
        }
    }

    /// The messages of the record at `offset`: those of a chunk, or one that stands by itself.
    fn messages_at(&self, offset: u64) -> Result<Vec<Vec<u8>>, LogError> {
        let io = |source| LogError::Io {
            doing: "read",
            path: self.path.clone(),
            source,
            remedy: "is the disk still there?",
        };
        let (head, body) = match &self.unpacked {
            Some(file) => record_at(&file.lock().unwrap_or_else(std::sync::PoisonError::into_inner), offset, self.size),
            None => File::open(&self.path).and_then(|file| record_at(&file, offset, self.size)),
        }
        .map_err(io)?;
        records_of(&self.path, self.size, offset, &head, &body).map(|records| {
            let data = |record| match record {
                Record::Message { data, .. } => Some(data.into_owned()),
                _ => None,
            };
            records.into_iter().filter_map(data).collect()
        })
    }
}

/// The head and the body of the record at `offset` in a file of `size` bytes.
fn record_at(mut file: &File, offset: u64, size: u64) -> std::io::Result<([u8; 9], Vec<u8>)> {
    file.seek(SeekFrom::Start(offset))?;
    let mut head = [0; 9];
    file.read_exact(&mut head)?;
    let length = length_of(&head);
    if length > size {
        return Err(std::io::Error::other(format!("the record at byte {offset} changed while it was read")));
    }
    let mut body = Vec::new();
    file.take(length).read_to_end(&mut body)?;
    Ok((head, body))
}

fn length_of(head: &[u8; 9]) -> u64 {
    u64::from_le_bytes(head[1..].try_into().expect("eight bytes"))
}

/// The records of a chunk, or the one that is none.
fn records_of(
    path: &Path,
    size: u64,
    offset: u64,
    head: &[u8; 9],
    body: &[u8],
) -> Result<Vec<Record<'static>>, LogError> {
    let damaged = |error: mcap::McapError| match error {
        mcap::McapError::ChunkTooLarge(length) => {
            let what = format!("the chunk at byte {offset} declares {length} bytes");
            LogError::TooLarge { path: path.to_owned(), what }
        }
        mcap::McapError::UnsupportedCompression(name) => {
            let what = format!("the chunk at byte {offset} is compressed with `{name}`; `mcap compress` writes zstd");
            LogError::Foreign { path: path.to_owned(), what }
        }
        error => LogError::Damaged { path: path.to_owned(), what: format!("{error}, in the record at byte {offset}") },
    };
    match parse_record(head[0], body).map_err(damaged)? {
        Record::Chunk { .. } => chunk(head, body, size).map_err(damaged),
        record => Ok(vec![record.into_owned()]),
    }
}

/// One way through the file.
struct Walk<'a, W> {
    path: &'a Path,
    size: u64,
    wanted: W,
    schemas: HashMap<u16, (records::SchemaHeader, Arc<[u8]>)>,
    /// The size of all schemas and topics (bytes).
    declared: usize,
    /// Index of a channel's topic, and whether its messages are wanted.
    channels: HashMap<u16, (usize, bool)>,
    topics: Vec<Topic>,
    entries: Vec<Entry>,
    messages: u64,
    last_ns: u64,
    /// Whether a check sum of its own covers every chunk, and whether all messages are in chunks.
    is_protected: bool,
    recovered: Option<String>,
}

impl<W: Fn(&Topic) -> bool> Walk<'_, W> {
    /// From the first record to the end of the data.
    fn through(&mut self, input: &mut BufReader<File>) -> Result<(), LogError> {
        let mut sum = crc32fast::Hasher::new();
        sum.update(mcap::MAGIC);
        let mut at = mcap::MAGIC.len() as u64;
        loop {
            let (head, body) = self.record(input, at)?;
            let records = records_of(self.path, self.size, at, &head, &body)?;
            if let [Record::DataEnd(end)] = &records[..] {
                if end.data_section_crc != 0 && end.data_section_crc != sum.finalize() {
                    let what = "the check sum of the data is wrong".to_owned();
                    return Err(LogError::Damaged { path: self.path.to_owned(), what });
                }
                self.is_protected |= end.data_section_crc != 0;
                return self.to_the_footer(input, at + 9 + body.len() as u64);
            }
            match parse_record(head[0], &body) {
                Ok(Record::Chunk { header, .. }) => self.is_protected &= header.uncompressed_crc != 0,
                Ok(Record::Message { .. }) => self.is_protected = false,
                _ => {}
            }
            let mut place = 0;
            for record in records {
                let is_message = matches!(record, Record::Message { .. });
                self.take(record, at, place)?;
                place += u32::from(is_message);
            }
            sum.update(&head);
            sum.update(&body);
            at += 9 + body.len() as u64;
        }
    }

    /// The record at byte `at`, or that the file ends before its end.
    fn record(&self, input: &mut BufReader<File>, at: u64) -> Result<([u8; 9], Vec<u8>), LogError> {
        let io = |source| LogError::Io {
            doing: "read",
            path: self.path.to_owned(),
            source,
            remedy: "is the disk still there?",
        };
        let cut_off =
            LogError::Truncated { path: self.path.to_owned(), messages: self.messages, last_ns: self.last_ns };
        let mut head = [0; 9];
        let Some(room) = self.size.checked_sub(at + 9) else { return Err(cut_off) };
        input.read_exact(&mut head).map_err(io)?;
        if length_of(&head) > room {
            return Err(cut_off);
        }
        let mut body = vec![0; usize::try_from(length_of(&head)).unwrap_or(usize::MAX)];
        input.read_exact(&mut body).map_err(io)?;
        Ok((head, body))
    }

    /// What follows the data only repeats; without it the file is not complete.
    fn to_the_footer(&self, input: &mut BufReader<File>, mut at: u64) -> Result<(), LogError> {
        loop {
            let (head, body) = self.record(input, at)?;
            at += 9 + body.len() as u64;
            if head[0] == records::op::FOOTER {
                let mut end = Vec::new();
                input.by_ref().take(8).read_to_end(&mut end).map_err(|source| LogError::Io {
                    doing: "read",
                    path: self.path.to_owned(),
                    source,
                    remedy: "is the disk still there?",
                })?;
                return if end == mcap::MAGIC {
                    Ok(())
                } else {
                    let (path, messages) = (self.path.to_owned(), self.messages);
                    Err(LogError::Truncated { path, messages, last_ns: self.last_ns })
                };
            }
        }
    }

    /// Counts the bytes of a declaration.
    fn declare(&mut self, bytes: usize) -> Result<(), LogError> {
        self.declared += bytes;
        if self.declared > limit(self.size) {
            let what = format!("its schemas and topics have more than {} bytes", self.declared);
            return Err(LogError::TooLarge { path: self.path.to_owned(), what });
        }
        Ok(())
    }

    fn take(&mut self, record: Record<'_>, offset: u64, place: u32) -> Result<(), LogError> {
        match record {
            Record::Schema { header, data } => {
                self.declare(data.len())?;
                self.schemas.insert(header.id, (header, data.into()));
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id);
                let topic = Topic {
                    name: channel.topic,
                    schema: schema.map_or_else(String::new, |(header, _)| header.name.clone()),
                    schema_encoding: schema.map_or_else(String::new, |(header, _)| header.encoding.clone()),
                    definition: schema.map_or_else(|| [].into(), |(_, definition)| Arc::clone(definition)),
                    encoding: channel.message_encoding,
                };
                self.declare(topic.name.len())?;
                // Writers may declare a channel again in every chunk.
                let (index, wanted) = (self.topics.len(), (self.wanted)(&topic));
                if let hash_map::Entry::Vacant(place) = self.channels.entry(channel.id) {
                    place.insert((index, wanted));
                    self.topics.push(topic);
                }
            }
            Record::Message { header, .. } => {
                let Some(&(topic, wanted)) = self.channels.get(&header.channel_id) else {
                    let what = format!("a message on channel {}, which it never declares", header.channel_id);
                    return Err(LogError::Damaged { path: self.path.to_owned(), what });
                };
                self.messages += 1;
                self.last_ns = header.log_time;
                if wanted {
                    let (log_time, sequence) = (header.log_time, header.sequence);
                    self.entries.push(Entry { topic, log_time, sequence, offset, place });
                }
                // Nothing honest has more messages than bytes.
                if (self.entries.len() * size_of::<Entry>()) as u64 > self.size * 4 + (64 << 20) {
                    let what = format!("{} messages in {} bytes", self.entries.len(), self.size);
                    return Err(LogError::TooLarge { path: self.path.to_owned(), what });
                }
            }
            Record::Metadata(metadata) => self.recovered = self.recovered.take().or_else(|| topic::lost(&metadata)),
            _ => {}
        }
        Ok(())
    }
}
