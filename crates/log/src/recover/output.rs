//! The file of the recovered records.

use std::{
    collections::HashMap,
    fs::File,
    io::{BufWriter, Write as _},
    path::{Path, PathBuf},
};

use mcap::{
    Attachment, McapError, WriteOptions,
    records::{MessageHeader, Metadata, Record},
};
use seafix_component::PartialFile;

use super::{recovered::Recovered, summary::Summary};
use crate::{
    error::LogError,
    frames::Frames,
    read::Reader,
    record::TrialHeader,
    recording::{Recording, Topic},
    topic::{self, Schema},
    view::Places,
    write::Preamble,
};

/// A message with its channel in the new file.
struct Pending {
    header: MessageHeader,
    data: Vec<u8>,
}

/// The new file.
pub(super) struct Output {
    mcap: mcap::Writer<BufWriter<File>>,
    partial: PartialFile,
    /// The numbers of schemas and channels of the old file, and those of the new one.
    schemas: HashMap<u16, u16>,
    channels: HashMap<u16, (u16, String)>,
    /// The summary of the old file, for schemas and channels whose declaration is lost.
    summary: Summary,
    /// The header of a trial from the last chunk of the old file; such a file has chunks of their own for the records
    /// before the first frame.
    spare: Option<TrialHeader>,
    gaps: usize,
    /// The header as it was written.
    header: Option<Vec<u8>>,
    /// The messages since the last complete frame, and their size (bytes).
    pending: Vec<Pending>,
    pending_bytes: usize,
    /// Maximum size of the messages of a frame (bytes).
    limit: usize,
    /// Whether the log is that of a trial, and whether its first frame may follow.
    trial: bool,
    begun: bool,
    /// Whether a gap may contain the beginning of the current frame.
    torn: bool,
    pub(super) found: Recovered,
}

impl Output {
    pub(super) fn create(
        to: &Path,
        summary: Summary,
        spare: Option<TrialHeader>,
        limit: usize,
    ) -> Result<Self, LogError> {
        let (partial, file) = PartialFile::create(to).map_err(|source| LogError::Io {
            doing: "create",
            path: to.to_owned(),
            source,
            remedy: "choose another place with --out",
        })?;
        let mcap = WriteOptions::new()
            .library(concat!("seafix-log/", env!("CARGO_PKG_VERSION")))
            .compression_threads(0)
            .create(BufWriter::new(file));
        let mcap = mcap.map_err(|error| unwritten(partial.unfinished(), error))?;
        Ok(Self {
            mcap,
            partial,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            summary,
            spare,
            gaps: 0,
            header: None,
            pending: Vec::new(),
            pending_bytes: 0,
            limit,
            trial: false,
            begun: false,
            torn: false,
            found: Recovered::default(),
        })
    }

    /// Notes that records are missing here.
    pub(super) fn gap(&mut self) {
        if self.begun {
            self.drop_pending();
        }
        self.torn = true;
        self.gaps += 1;
    }

    fn drop_pending(&mut self) {
        self.found.dropped += self.pending.len() as u64;
        self.pending.clear();
        self.pending_bytes = 0;
    }

    pub(super) fn take(&mut self, record: Record<'static>) -> Result<(), LogError> {
        let taken = match record {
            Record::Schema { header, data } => self.mcap.add_schema(&header.name, &header.encoding, &data).map(|id| {
                self.schemas.insert(header.id, id);
            }),
            Record::Channel(channel) => {
                // A lost chunk may have held the schema of a channel that a later one declares.
                let declared = self.schemas.contains_key(&channel.schema_id);
                if let Some(schema) = self.summary.schemas.remove(&channel.schema_id).filter(|_| !declared) {
                    self.take(schema)?;
                }
                let schema = self.schemas.get(&channel.schema_id).copied().unwrap_or(0);
                let id = self.mcap.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata);
                id.map(|id| {
                    self.channels.insert(channel.id, (id, channel.topic));
                })
            }
            Record::Message { header, data } => return self.message(header, data.into_owned()),
            Record::Attachment { header, data, .. } => self.mcap.attach(&Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data,
            }),
            Record::Metadata(metadata) => self.mcap.write_metadata(&metadata),
            _ => Ok(()),
        };
        taken.map_err(|error| unwritten(self.partial.unfinished(), error))
    }

    fn message(&mut self, header: MessageHeader, data: Vec<u8>) -> Result<(), LogError> {
        let declared = self.channels.contains_key(&header.channel_id);
        if let Some(channel) = self.summary.channels.remove(&header.channel_id).filter(|_| !declared) {
            self.take(Record::Channel(channel))?;
        }
        let Some((channel_id, topic)) = self.channels.get(&header.channel_id).cloned() else {
            self.found.dropped += 1;
            return Ok(());
        };
        if topic == topic::HEADER {
            if self.trial {
                // The spare copy; the new file gets its own.
                return Ok(());
            }
            self.trial = true;
            self.header = Some(data.clone());
        } else if !self.trial && self.spare.is_some() {
            self.restore(header.log_time)?;
        }
        if self.trial && !self.begun && topic::is_of_frame(&topic) {
            self.begun = true;
            // A single gap before the first frame took nothing of it.
            self.torn &= self.spare.is_none() || self.gaps > 1;
        }
        let message = Pending { header: MessageHeader { channel_id, ..header }, data };
        // The totals are correct whatever is lost of the frames.
        let totals = self.trial && topic == topic::TOTALS;
        if !self.trial || !self.begun || totals {
            self.write(&message)?;
            if self.trial && topic == topic::MODEL {
                // A gap before the first frame took nothing of it. As in the log of a run, the records before the first
                // frame have a chunk of their own.
                (self.begun, self.torn) = (true, false);
                self.mcap.flush().map_err(|error| unwritten(self.partial.unfinished(), error))?;
            }
            return Ok(());
        }
        self.pending_bytes += message.data.len() + size_of::<Pending>();
        if self.pending_bytes > self.limit {
            self.found.lost.push(format!("a frame of more than {} bytes", self.limit));
            self.gap();
        }
        self.pending.push(message);
        if topic != topic::FRAME {
            return Ok(());
        }
        if std::mem::take(&mut self.torn) {
            self.drop_pending();
            return Ok(());
        }
        self.pending_bytes = 0;
        self.found.frames += 1;
        std::mem::take(&mut self.pending).iter().try_for_each(|message| self.write(message))
    }

    /// Writes the records before the first frame anew from the spare header.
    fn restore(&mut self, stamp: u64) -> Result<(), LogError> {
        let Some(header) = self.spare.clone() else { return Ok(()) };
        let record = |what| LogError::Record { path: self.partial.unfinished().to_owned(), what };
        let places = Places::of(&header).map_err(record)?;
        let preamble = Preamble::of(&header, &places, stamp);
        // Attachments and metadata are no part of a chunk, and have been copied.
        for (topic, schema, data) in preamble.messages {
            let channel_id =
                self.channel(topic, schema).map_err(|error| unwritten(self.partial.unfinished(), error))?;
            if topic == topic::HEADER {
                self.header = Some(data.clone());
            }
            let header = MessageHeader { channel_id, sequence: 0, log_time: stamp, publish_time: stamp };
            self.write(&Pending { header, data })?;
        }
        self.trial = true;
        self.mcap.flush().map_err(|error| unwritten(self.partial.unfinished(), error))
    }

    fn channel(&mut self, topic: &str, schema: fn() -> Schema) -> Result<u16, McapError> {
        let (name, descriptors) = schema();
        let schema = self.mcap.add_schema(name, "protobuf", descriptors)?;
        self.mcap.add_channel(schema, topic, "protobuf", &std::collections::BTreeMap::new())
    }

    fn write(&mut self, message: &Pending) -> Result<(), LogError> {
        self.found.messages += 1;
        self.found.last_ns = message.header.log_time;
        let written = self.mcap.write_to_known_channel(&message.header, &message.data);
        written.map_err(|error| unwritten(self.partial.unfinished(), error))
    }

    /// Completes the file and gives it its name, if its reader takes it.
    pub(super) fn finish(mut self, from: &Path) -> Result<Recovered, LogError> {
        self.drop_pending();
        let path = from.to_owned();
        if self.found.messages == 0 {
            return Err(LogError::Lost { path, what: self.found.lost.join("; ") });
        }
        let mut lost = self.found.lost.clone();
        if self.found.dropped > 0 {
            lost.push(format!("{} messages of torn frames", self.found.dropped));
        }
        let failed = |error| unwritten(self.partial.unfinished(), error);
        if !lost.is_empty() {
            // The file must not be mistaken for a complete one.
            let Metadata { name, metadata } = topic::recovered(&lost.join("; "));
            self.mcap.write_metadata(&Metadata { name, metadata }).map_err(failed)?;
        }
        let spare = match self.header.take().filter(|_| self.trial) {
            Some(header) => {
                self.channel(topic::HEADER, <crate::proto::TrialHeader as topic::Logged>::schema).map(|id| {
                    let stamp = self.found.last_ns;
                    let place = MessageHeader { channel_id: id, sequence: 1, log_time: stamp, publish_time: stamp };
                    self.mcap.flush().and_then(|()| self.mcap.write_to_known_channel(&place, &header))
                })
            }
            None => Ok(Ok(())),
        };
        let failed = |error| unwritten(self.partial.unfinished(), error);
        spare.and_then(|written| written).map_err(failed)?;
        self.mcap.finish().map_err(failed)?;
        let Self { mcap, partial, trial, found, .. } = self;
        let io =
            |source| LogError::Io { doing: "write", path: partial.unfinished().to_owned(), source, remedy: REMEDY };
        let mut buffer = mcap.into_inner();
        buffer.flush().and_then(|()| buffer.get_ref().sync_all()).map_err(io)?;
        drop(buffer);
        readable(partial.unfinished(), trial).map_err(|error| {
            let what = format!("{}; the rest has no reader: {}", found.lost.join("; "), cause(&error));
            LogError::Lost { path, what }
        })?;
        let failed = partial.unfinished().to_owned();
        partial.finish().map_err(|source| LogError::Io { doing: "rename", path: failed, source, remedy: REMEDY })?;
        Ok(found)
    }
}

/// Reads the new file as `check` and `replay` do.
fn readable(path: &Path, trial: bool) -> Result<(), LogError> {
    if trial {
        Reader::open(path)?.without_images().for_each_frame(drop)?;
        return Frames::open(path).map(drop);
    }
    let recording = Recording::open(path, |_| true)?;
    // Of any version.
    let own = |topic: &Topic| topic.schema.starts_with("seafix.");
    match recording.topics().iter().any(own) {
        // A trial without its header.
        true => Err(LogError::Foreign { path: PathBuf::new(), what: "the header of its trial is lost".to_owned() }),
        false => Ok(()),
    }
}

/// The cause without the name of the unfinished file.
fn cause(error: &LogError) -> String {
    match error {
        LogError::Foreign { what, .. } | LogError::Damaged { what, .. } | LogError::TooLarge { what, .. } => {
            what.clone()
        }
        other => other.to_string(),
    }
}

fn unwritten(partial: &Path, error: McapError) -> LogError {
    match error {
        // The library's message omits the cause.
        McapError::Io(source) => LogError::Io { doing: "write", path: partial.to_owned(), source, remedy: REMEDY },
        error => LogError::Write { path: partial.to_owned(), message: error.to_string() },
    }
}

const REMEDY: &str = "make room on the disk, or choose another place with --out";
