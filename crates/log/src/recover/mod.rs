//! Recovery of the intact part of a damaged log.

mod output;
mod recovered;
mod summary;

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufReader, Read, Seek as _, SeekFrom},
    path::Path,
};

use crc32fast::Hasher;
use mcap::records::{Record, op};

use crate::{
    chunk::{chunk, limit},
    error::LogError,
    parse::parse_record,
    read::looks_like,
    unpacked::Unpacked,
};
use output::Output;
pub use recovered::Recovered;
use summary::{Place, Summary};

/// Writes the intact part of the MCAP file `from` as a complete log `to`.
///
/// Every chunk and attachment with a correct checksum is kept, in order, and metadata records, which have no checksum.
/// A trial's log keeps complete frames only; a lost chunk in the middle may cost the frame after it as well. Messages
/// are never changed. A lost first chunk is restored from the spare header in the last one. The index in the summary
/// locates the records behind a damaged head. A metadata record `recovered` lists losses:
/// [`Reader::recovered`](crate::Reader::recovered).
///
/// # Errors
/// [`LogError`] when `from` is no MCAP file, nothing in it can be read, the result would have no reader, or `to` cannot
/// be written. Nothing is written then.
pub fn recover(from: &Path, to: &Path) -> Result<Recovered, LogError> {
    let mut scan = Scan::start(from, to)?;
    while scan.next_record()? {}
    scan.output.finish(from)
}

/// The place in a damaged file, and the output with the records before it.
struct Scan<'a> {
    from: &'a Path,
    input: BufReader<File>,
    /// The size of the file (bytes).
    size: u64,
    /// The offset of the next record.
    at: u64,
    /// The checksum of all bytes before it.
    sum: Hasher,
    /// The records of the data section according to the summary, by their offsets.
    places: BTreeMap<u64, Place>,
    output: Output,
}

impl<'a> Scan<'a> {
    /// Reads the summary and the first bytes of `from`, and creates `to`.
    fn start(from: &'a Path, to: &Path) -> Result<Self, LogError> {
        let Unpacked { mut file, size, lost, .. } = Unpacked::open(from)?;
        let summary = Summary::read(&file, size);
        let spare = summary.as_ref().and_then(|summary| summary.spare_header(&file, size));
        file.seek(SeekFrom::Start(0)).map_err(unread(from))?;
        let mut input = BufReader::new(file);
        let mut start = [0; 8];
        let read = read_up_to(&mut input, &mut start).map_err(unread(from))?;
        if start != mcap::MAGIC && summary.is_none() {
            return Err(LogError::NotMcap { path: from.to_owned(), looks_like: looks_like(&start[..read]) });
        }
        let summary = summary.unwrap_or_default();
        let places = summary.places.clone();
        let mut output = Output::create(to, summary, spare, limit(size))?;
        if start != mcap::MAGIC {
            output.found.lost.push("the first bytes of the file".to_owned());
        }
        output.found.lost.extend(lost);
        let mut sum = Hasher::new();
        sum.update(&start);
        Ok(Self { from, input, size, at: 8, sum, places, output })
    }

    /// Reads one record and keeps its content if that is intact; returns whether another may follow.
    fn next_record(&mut self) -> Result<bool, LogError> {
        let mut head = [0; 9];
        if read_up_to(&mut self.input, &mut head).map_err(unread(self.from))? < head.len() {
            self.lost("the file ends without a footer");
            return Ok(false);
        }
        let place = self.places.get(&self.at).copied();
        if let Some(place) = place {
            // The index repeats the head, so that damage in it costs nothing.
            head[0] = place.opcode;
            head[1..].copy_from_slice(&(place.length - 9).to_le_bytes());
        }
        let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
        let end = length.checked_add(9).and_then(|length| self.at.checked_add(length));
        let passed = self.next_place().filter(|next| place.is_none() && end.is_none_or(|end| end > *next));
        if let Some(next) = passed {
            self.gap(format!("a record with a damaged head, {} bytes,", next - self.at));
            // The head may reach into that record.
            self.input.seek(SeekFrom::Start(next)).map_err(unread(self.from))?;
            self.at = next;
            return Ok(true);
        }
        if end.is_none_or(|end| end > self.size) {
            let rest = self.size.saturating_sub(self.at + 9);
            self.lost(format!("all behind a damaged head of a record, which claims more than the {rest} bytes left,"));
            return Ok(false);
        }
        let mut body = vec![0; usize::try_from(length).unwrap_or(usize::MAX)];
        self.input.read_exact(&mut body).map_err(unread(self.from))?;
        if !self.keep(head, &body)? {
            return Ok(false);
        }
        self.sum.update(&head);
        self.sum.update(&body);
        self.at += 9 + length;
        self.pass_index(place).map_err(unread(self.from))?;
        Ok(true)
    }

    /// Keeps a record if it is intact; returns whether another may follow.
    fn keep(&mut self, head: [u8; 9], body: &[u8]) -> Result<bool, LogError> {
        match parse_record(head[0], body) {
            // The checksum of an attachment covers everything before it.
            Ok(Record::Attachment { header, crc, .. })
                if crc != 0 && crc32fast::hash(&body[..body.len() - 4]) != crc =>
            {
                self.lost(format!("attachment `{}` (its check sum is wrong)", header.name));
            }
            Ok(Record::DataEnd(end)) => {
                let known = end.data_section_crc != 0;
                if known && self.output.found.lost.is_empty() && self.sum.clone().finalize() != end.data_section_crc {
                    self.output.found.lost.push("something between the chunks (the sum of all is wrong)".to_owned());
                }
                return Ok(false);
            }
            Ok(Record::Chunk { .. }) => match chunk(&head, body, self.size) {
                Ok(records) => records.into_iter().try_for_each(|record| self.output.take(record))?,
                Err(error) => self.gap(format!("a chunk of {} bytes ({error})", body.len())),
            },
            Ok(
                record @ (Record::Schema { .. }
                | Record::Channel(_)
                | Record::Message { .. }
                | Record::Attachment { .. }
                | Record::Metadata(_)),
            ) => self.output.take(record.into_owned())?,
            Ok(Record::Header(_) | Record::MessageIndex(_)) => {}
            // The index has no record here; what follows repeats the data.
            _ if !self.places.is_empty() && self.next_place().is_none() => {
                self.lost(format!("a record of kind {:#04x} behind the data", head[0]));
                return Ok(false);
            }
            // Some other record before the damage.
            Ok(_) => self.gap(format!("a record of kind {:#04x} that does not belong there", head[0])),
            Err(error) => self.gap(format!("a record of kind {:#04x} ({error})", head[0])),
        }
        Ok(true)
    }

    /// Passes the message index of a chunk, which has no other content than the chunk.
    fn pass_index(&mut self, place: Option<Place>) -> io::Result<()> {
        if let Some(Place { opcode: op::CHUNK, index: index @ 1.., .. }) = place {
            let mut bytes = Vec::new();
            self.input.by_ref().take(index).read_to_end(&mut bytes)?;
            self.sum.update(&bytes);
            self.at += index;
        }
        Ok(())
    }

    /// The offset of the first indexed record behind this one.
    fn next_place(&self) -> Option<u64> {
        self.places.range(self.at + 1..).next().map(|(next, _)| *next)
    }

    /// Notes a loss with its place.
    fn lost(&mut self, what: impl std::fmt::Display) {
        self.output.found.lost.push(format!("{what} at byte {}", self.at));
    }

    /// Notes a loss that may contain messages.
    fn gap(&mut self, what: String) {
        self.lost(what);
        self.output.gap();
    }
}

fn unread(from: &Path) -> impl Fn(io::Error) -> LogError {
    move |source| LogError::Io { doing: "read", path: from.to_owned(), source, remedy: "is the name right?" }
}

/// Reads until the buffer is full or the file ends; returns the number of bytes.
fn read_up_to(input: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match input.read(&mut buffer[filled..])? {
            0 => break,
            n => filled += n,
        }
    }
    Ok(filled)
}
