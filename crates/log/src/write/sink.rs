//! The MCAP file behind a writer.

use std::{
    collections::BTreeMap,
    fmt,
    fs::File,
    io::{BufWriter, Write as _},
    path::{Path, PathBuf},
};

use mcap::{
    Attachment, McapError, WriteOptions,
    records::{MessageHeader, Metadata},
};
use seafix_component::PartialFile;

use crate::{
    error::LogError,
    topic::{self, Logged, Schema},
};

/// What becomes of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    /// It is kept: compressed, and put on the disk before it gets its name.
    Kept,
    /// It is joined with others soon: neither.
    Joined,
}

/// Bytes that wait for the file: every message is several writes.
const BUFFER: usize = 1 << 18;

/// An MCAP file that is renamed from `.partial` when it is complete.
pub(super) struct Sink {
    mcap: mcap::Writer<BufWriter<File>>,
    path: PathBuf,
    partial: PartialFile,
    purpose: Use,
    /// Identity of each topic's channel, and how many messages it has.
    channels: BTreeMap<&'static str, (u16, u32)>,
}

impl fmt::Debug for Sink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sink").field("partial", &self.partial.unfinished()).finish_non_exhaustive()
    }
}

impl Sink {
    pub(super) fn create(path: &Path, purpose: Use) -> Result<Self, LogError> {
        let (partial, file) = PartialFile::create(path).map_err(|source| LogError::Io {
            doing: "create",
            path: path.to_owned(),
            source,
            remedy: "choose another folder with --out",
        })?;
        let compression = match purpose {
            Use::Kept => Some(mcap::Compression::Zstd),
            Use::Joined => None,
        };
        let mcap = WriteOptions::new()
            .compression(compression)
            // Images are compressed already, and the rest hardly gains by more.
            .compression_level(1)
            .library(concat!("seafix-log/", env!("CARGO_PKG_VERSION")))
            // The library's default depends on the machine's number of processors, and so do the bytes.
            .compression_threads(0)
            .create(BufWriter::with_capacity(BUFFER, file))
            .map_err(|error| write_error(partial.unfinished(), error))?;
        Ok(Self { mcap, path: path.to_owned(), partial, purpose, channels: BTreeMap::new() })
    }

    /// The name the complete file will have.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes one message; its topic's channel is made by the first.
    pub(super) fn put<M: Logged>(&mut self, topic: &'static str, stamp: u64, message: &M) -> Result<(), LogError> {
        self.put_bytes(topic, M::schema, stamp, &message.encode_to_vec())
    }

    /// Writes one message that is encoded already.
    pub(super) fn put_bytes(
        &mut self,
        topic: &'static str,
        schema: fn() -> Schema,
        stamp: u64,
        message: &[u8],
    ) -> Result<(), LogError> {
        let (channel_id, sequence) = match self.channels.get(topic) {
            Some(channel) => *channel,
            None => (self.channel(topic, schema).map_err(|error| write_error(self.partial.unfinished(), error))?, 0),
        };
        self.channels.insert(topic, (channel_id, sequence.wrapping_add(1)));
        let header = MessageHeader { channel_id, sequence, log_time: stamp, publish_time: stamp };
        self.mcap
            .write_to_known_channel(&header, message)
            .map_err(|error| write_error(self.partial.unfinished(), error))
    }

    fn channel(&mut self, topic: &str, schema: fn() -> Schema) -> Result<u16, McapError> {
        let (name, descriptors) = schema();
        let schema = self.mcap.add_schema(name, "protobuf", descriptors)?;
        self.mcap.add_channel(schema, topic, "protobuf", &BTreeMap::new())
    }

    /// Ends the current chunk of a log that is kept.
    pub(super) fn end_chunk(&mut self) -> Result<(), LogError> {
        match self.purpose {
            Use::Kept => self.mcap.flush().map_err(|error| write_error(self.partial.unfinished(), error)),
            Use::Joined => Ok(()),
        }
    }

    /// Writes a spare copy of the header into the last chunk of a log that is kept; it serves
    /// [`recover`](crate::recover) when the first chunk is damaged.
    pub(super) fn spare<M: Logged>(&mut self, stamp: u64, header: &M) -> Result<(), LogError> {
        match self.purpose {
            Use::Kept => self.end_chunk().and_then(|()| self.put(topic::HEADER, stamp, header)),
            Use::Joined => Ok(()),
        }
    }

    /// Writes a metadata record.
    pub(super) fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> Result<(), LogError> {
        let record = Metadata { name: name.to_owned(), metadata };
        self.mcap.write_metadata(&record).map_err(|error| write_error(self.partial.unfinished(), error))
    }

    /// Attaches a TOML text, unless it is empty.
    pub(super) fn attach(&mut self, name: &str, text: &str, stamp: u64) -> Result<(), LogError> {
        if text.is_empty() {
            return Ok(());
        }
        let attachment = Attachment {
            log_time: stamp,
            create_time: stamp,
            name: name.to_owned(),
            media_type: "application/toml".to_owned(),
            data: text.as_bytes().into(),
        };
        self.mcap.attach(&attachment).map_err(|error| write_error(self.partial.unfinished(), error))
    }

    /// Writes index and checksums, syncs the file to the disk, and renames it.
    pub(super) fn finish(self) -> Result<(), LogError> {
        let Self { mut mcap, path, partial, purpose, .. } = self;
        let io = |doing| {
            let path = partial.unfinished().to_owned();
            move |source| LogError::Io { doing, path, source, remedy: REMEDY }
        };
        mcap.finish().map_err(|error| write_error(partial.unfinished(), error))?;
        let mut buffer = mcap.into_inner();
        buffer.flush().map_err(io("write"))?;
        if purpose == Use::Kept {
            buffer.get_ref().sync_all().map_err(io("put on the disk"))?;
        }
        drop(buffer);
        let (synced, renamed) = (io("put on the disk the folder of"), io("rename"));
        partial.finish().map_err(renamed)?;
        if purpose == Use::Joined {
            return Ok(());
        }
        // The new name itself has to reach the disk; systems that cannot open a folder do it unasked.
        if let Some(Ok(folder)) = path.parent().map(File::open) {
            folder.sync_all().map_err(synced)?;
        }
        Ok(())
    }
}

fn write_error(partial: &Path, error: McapError) -> LogError {
    match error {
        McapError::Io(source) => LogError::Io { doing: "write", path: partial.to_owned(), source, remedy: REMEDY },
        error => LogError::Write { path: partial.to_owned(), message: error.to_string() },
    }
}

/// The remedy of a log that cannot be written.
const REMEDY: &str = "free some disk space, and run again or resume";
