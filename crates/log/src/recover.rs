//! What of a damaged log can be saved.

use std::{
    collections::HashMap,
    fs::File,
    io::{BufReader, BufWriter, Read, Seek as _, SeekFrom, Write as _},
    path::{Path, PathBuf},
};

use mcap::{
    Attachment, McapError, WriteOptions,
    records::{self, MessageHeader, Record},
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use crate::{LogError, read::looks_like, topic};

/// What was saved of a log, and what was not.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recovered {
    /// Messages written.
    pub messages: u64,
    /// Frames of a trial among them; none in the log of another program.
    pub frames: u64,
    /// Messages that were readable but belong to a frame that is not whole.
    pub dropped: u64,
    /// The stamp of the last message written (ns).
    pub last_ns: u64,
    /// What could not be read: where, and why.
    pub lost: Vec<String>,
}

/// Writes what is sound in the MCAP file `from` as a complete log `to`, under `to` + `.partial` until it is.
///
/// Every chunk and attachment whose check sum holds is kept, in order; metadata records, which have none
/// of their own, as they stand. Of a
/// trial's log only whole frames are kept, so that [`read`](crate::read) takes it; a chunk lost in the
/// middle may cost the frame after it as well. Never is a message changed. Where anything is lost a metadata record
/// `recovered` says what: [`Reader::recovered`](crate::Reader::recovered).
///
/// # Errors
/// [`LogError`] when `from` is no MCAP file, nothing in it can be read, or `to` cannot be written.
pub fn recover(from: &Path, to: &Path) -> Result<Recovered, LogError> {
    let io = |source| LogError::Io { doing: "read", path: from.to_owned(), source, remedy: "is the name right?" };
    let file = File::open(from).map_err(io)?;
    let size = file.metadata().map_err(io)?.len();
    let mut input = BufReader::new(file);
    let mut start = [0; 8];
    let read = read_up_to(&mut input, &mut start).map_err(io)?;
    if start != mcap::MAGIC {
        return Err(LogError::NotMcap { path: from.to_owned(), looks_like: looks_like(&start[..read]) });
    }
    let mut partial = to.as_os_str().to_owned();
    partial.push(".partial");
    let mut output = Output::create(PathBuf::from(partial))?;
    output.summary = summary(from, size).unwrap_or_default();
    let mut at = 8;
    let mut sum = crc32fast::Hasher::new();
    sum.update(mcap::MAGIC);
    loop {
        let lost = |what: String| format!("{what} at byte {at}");
        let mut head = [0; 9];
        if read_up_to(&mut input, &mut head).map_err(io)? < head.len() {
            output.found.lost.push(lost("the file ends without a footer".to_owned()));
            break;
        }
        let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
        if length > size - at - 9 {
            let rest = size - at - 9;
            output.found.lost.push(lost(format!(
                "all behind a damaged head of a record, which claims more than the {rest} bytes left,"
            )));
            break;
        }
        let mut body = vec![0; usize::try_from(length).unwrap_or(usize::MAX)];
        input.read_exact(&mut body).map_err(io)?;
        match mcap::parse_record(head[0], &body) {
            // The sum of an attachment covers all before it.
            Ok(Record::Attachment { header, crc, .. })
                if crc != 0 && crc32fast::hash(&body[..body.len() - 4]) != crc =>
            {
                output.found.lost.push(lost(format!("attachment `{}` (its check sum is wrong)", header.name)));
                output.gap();
            }
            Ok(Record::DataEnd(end)) => {
                let known = end.data_section_crc != 0;
                if known && output.found.lost.is_empty() && sum.finalize() != end.data_section_crc {
                    output.found.lost.push("something between the chunks (the sum of all is wrong)".to_owned());
                }
                break;
            }
            Ok(Record::Chunk { .. }) => match chunk(&head, &body, size) {
                Ok(records) => records.into_iter().try_for_each(|record| output.take(record))?,
                Err(error) => {
                    output.found.lost.push(lost(format!("a chunk of {length} bytes ({error})")));
                    output.gap();
                }
            },
            Ok(
                record @ (Record::Schema { .. }
                | Record::Channel(_)
                | Record::Message { .. }
                | Record::Attachment { .. }
                | Record::Metadata(_)),
            ) => output.take(record.into_owned())?,
            Ok(Record::Header(_) | Record::MessageIndex(_)) => {}
            // What has no place before the end of the data was something else once.
            Ok(_) => {
                output.found.lost.push(lost(format!("a record of kind {:#04x} that does not belong there", head[0])));
                output.gap();
            }
            Err(error) => {
                output.found.lost.push(lost(format!("a record of kind {:#04x} ({error})", head[0])));
                output.gap();
            }
        }
        sum.update(&head);
        sum.update(&body);
        at += 9 + length;
    }
    output.finish(from, to)
}

/// The schemas and channels that the summary at the end of the file repeats, by their numbers.
#[derive(Debug, Default)]
struct Summary {
    schemas: HashMap<u16, Record<'static>>,
    channels: HashMap<u16, records::Channel>,
}

/// The summary of a file whose end is whole.
fn summary(path: &Path, size: u64) -> Option<Summary> {
    const FOOTER: u64 = 9 + 20 + 8;
    let mut file = File::open(path).ok()?;
    file.seek(SeekFrom::Start(size.checked_sub(FOOTER)?)).ok()?;
    let mut end = Vec::new();
    file.read_to_end(&mut end).ok()?;
    let (footer, magic) = end.split_at_checked(29)?;
    let Ok(Record::Footer(footer)) = mcap::parse_record(*footer.first()?, &footer[9..]) else { return None };
    let length = size.checked_sub(FOOTER)?.checked_sub(footer.summary_start)?;
    if magic != mcap::MAGIC || footer.summary_start == 0 {
        return None;
    }
    file.seek(SeekFrom::Start(footer.summary_start)).ok()?;
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes).ok()?;
    let mut found = Summary::default();
    let mut rest = &bytes[..];
    while let Some((head, after)) = rest.split_at_checked(9) {
        let length = usize::try_from(u64::from_le_bytes(head[1..].try_into().ok()?)).ok()?;
        let (body, next) = after.split_at_checked(length)?;
        match mcap::parse_record(head[0], body).ok()?.into_owned() {
            Record::Channel(channel) => drop(found.channels.insert(channel.id, channel)),
            Record::Schema { header, data } => {
                drop(found.schemas.insert(header.id, Record::Schema { header, data }));
            }
            _ => {}
        }
        rest = next;
    }
    Some(found)
}

/// The records of a chunk, all of them or none: nothing is taken before its check sum is verified.
pub(crate) fn chunk(head: &[u8], body: &[u8], size: u64) -> Result<Vec<Record<'static>>, McapError> {
    // Images are compressed already, so nothing honest grows more.
    let limit = usize::try_from(size.saturating_mul(4).saturating_add(32 << 20)).unwrap_or(usize::MAX);
    let mut reader = LinearReader::new_with_options(
        LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(limit),
    );
    let mut input = head.chain(body);
    let mut records = Vec::new();
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(need) => {
                let read = input.read(reader.insert(need))?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode, data } => records.push(mcap::parse_record(opcode, data)?.into_owned()),
        }
    }
    Ok(records)
}

/// Reads until the buffer is full or the file ends; how many bytes.
fn read_up_to(input: &mut impl Read, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match input.read(&mut buffer[filled..])? {
            0 => break,
            n => filled += n,
        }
    }
    Ok(filled)
}

/// A message on its way: its channel in the new file.
struct Pending {
    header: MessageHeader,
    data: Vec<u8>,
}

/// The new file.
struct Output {
    mcap: mcap::Writer<BufWriter<File>>,
    partial: PathBuf,
    /// From the numbers of the old file to those of the new.
    schemas: HashMap<u16, u16>,
    channels: HashMap<u16, (u16, String)>,
    /// What the end of the old file says of those whose declaration is lost.
    summary: Summary,
    /// The messages since the last whole frame.
    pending: Vec<Pending>,
    /// Whether this is a trial's log, and its header has been passed.
    trial: bool,
    begun: bool,
    /// Whether a gap may have taken the beginning of the frame that is being read.
    torn: bool,
    found: Recovered,
}

impl Output {
    fn create(partial: PathBuf) -> Result<Self, LogError> {
        let file = File::create(&partial).map_err(|source| LogError::Io {
            doing: "create",
            path: partial.clone(),
            source,
            remedy: "choose another place with --out",
        })?;
        let mcap = WriteOptions::new()
            .library(concat!("seafix-log/", env!("CARGO_PKG_VERSION")))
            .compression_threads(0)
            .create(BufWriter::new(file));
        let mcap = mcap.map_err(|error| unwritten(&partial, error))?;
        let (schemas, channels, pending) = (HashMap::new(), HashMap::new(), Vec::new());
        let (summary, found) = (Summary::default(), Recovered::default());
        Ok(Self { mcap, partial, schemas, channels, summary, pending, trial: false, begun: false, torn: false, found })
    }

    /// Some records are missing here.
    fn gap(&mut self) {
        if self.begun {
            self.found.dropped += self.pending.len() as u64;
            self.pending.clear();
            self.torn = true;
        }
    }

    fn take(&mut self, record: Record<'static>) -> Result<(), LogError> {
        let taken = match record {
            Record::Schema { header, data } => self.mcap.add_schema(&header.name, &header.encoding, &data).map(|id| {
                self.schemas.insert(header.id, id);
            }),
            Record::Channel(channel) => {
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
        taken.map_err(|error| unwritten(&self.partial, error))
    }

    fn message(&mut self, header: MessageHeader, data: Vec<u8>) -> Result<(), LogError> {
        let declared = self.channels.contains_key(&header.channel_id);
        if let Some(channel) = self.summary.channels.remove(&header.channel_id).filter(|_| !declared) {
            if let Some(schema) = self.summary.schemas.remove(&channel.schema_id) {
                self.take(schema)?;
            }
            self.take(Record::Channel(channel))?;
        }
        let Some((channel_id, topic)) = self.channels.get(&header.channel_id) else {
            self.found.dropped += 1;
            return Ok(());
        };
        let message = Pending { header: MessageHeader { channel_id: *channel_id, ..header }, data };
        self.trial |= topic == topic::HEADER;
        let (closes, begins) = (topic == topic::FRAME, topic == topic::MODEL);
        // What all frames add up to holds whatever was lost of them.
        let totals = self.trial && topic == topic::TOTALS;
        if !self.trial || !self.begun || totals {
            self.begun |= self.trial && begins;
            return self.write(&message);
        }
        self.pending.push(message);
        if !closes {
            return Ok(());
        }
        let frame = std::mem::take(&mut self.pending);
        if std::mem::take(&mut self.torn) {
            self.found.dropped += frame.len() as u64;
            return Ok(());
        }
        self.found.frames += 1;
        frame.iter().try_for_each(|message| self.write(message))
    }

    fn write(&mut self, message: &Pending) -> Result<(), LogError> {
        self.found.messages += 1;
        self.found.last_ns = message.header.log_time;
        self.mcap.write_to_known_channel(&message.header, &message.data).map_err(|e| unwritten(&self.partial, e))
    }

    fn finish(mut self, from: &Path, to: &Path) -> Result<Recovered, LogError> {
        self.found.dropped += self.pending.len() as u64;
        if self.found.messages == 0 {
            drop(self.mcap);
            let _ = std::fs::remove_file(&self.partial);
            return Err(LogError::Lost { path: from.to_owned(), what: self.found.lost.join("; ") });
        }
        let mut lost = self.found.lost.clone();
        if self.found.dropped > 0 {
            lost.push(format!("{} messages of torn frames", self.found.dropped));
        }
        if !lost.is_empty() {
            // Nobody shall take it for whole.
            let mark = topic::recovered(&lost.join("; "));
            self.mcap.write_metadata(&mark).map_err(|error| unwritten(&self.partial, error))?;
        }
        self.mcap.finish().map_err(|error| unwritten(&self.partial, error))?;
        let mut buffer = self.mcap.into_inner();
        let done = buffer.flush().and_then(|()| buffer.get_ref().sync_all());
        done.and_then(|()| std::fs::rename(&self.partial, to)).map_err(|source| LogError::Io {
            doing: "write",
            path: self.partial.clone(),
            source,
            remedy: REMEDY,
        })?;
        Ok(self.found)
    }
}

fn unwritten(partial: &Path, error: McapError) -> LogError {
    match error {
        // The library's own words leave out why.
        McapError::Io(source) => LogError::Io { doing: "write", path: partial.to_owned(), source, remedy: REMEDY },
        error => LogError::Write { path: partial.to_owned(), message: error.to_string() },
    }
}

const REMEDY: &str = "make room on the disk, or choose another place with --out";
