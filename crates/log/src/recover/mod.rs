//! Recovery of the intact part of a damaged log.

mod output;
mod recovered;
mod summary;

use std::{
    io::{BufReader, Read, Seek as _, SeekFrom},
    path::Path,
};

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
use summary::Summary;

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
    let io = |source| LogError::Io { doing: "read", path: from.to_owned(), source, remedy: "is the name right?" };
    let Unpacked { mut file, size, lost, .. } = Unpacked::open(from)?;
    let summary = Summary::read(&file, size);
    let spare = summary.as_ref().and_then(|summary| summary.spare_header(&file, size));
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let mut input = BufReader::new(file);
    let mut start = [0; 8];
    let read = read_up_to(&mut input, &mut start).map_err(io)?;
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
    let mut at = 8;
    let mut sum = crc32fast::Hasher::new();
    sum.update(&start);
    loop {
        let lost = |what: String| format!("{what} at byte {at}");
        let mut head = [0; 9];
        if read_up_to(&mut input, &mut head).map_err(io)? < head.len() {
            output.found.lost.push(lost("the file ends without a footer".to_owned()));
            break;
        }
        let place = places.get(&at).copied();
        if let Some(place) = place {
            // The index repeats the head, so that damage in it costs nothing.
            head[0] = place.opcode;
            head[1..].copy_from_slice(&(place.length - 9).to_le_bytes());
        }
        let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
        let next = places.range(at + 1..).next().map(|(next, _)| *next);
        let claimed = length.checked_add(9).and_then(|length| at.checked_add(length));
        let misplaced = place.is_none() && next.is_some_and(|next| claimed.is_none_or(|end| end > next));
        if let (true, Some(next)) = (misplaced, next) {
            output.found.lost.push(lost(format!("a record with a damaged head, {} bytes,", next - at)));
            output.gap();
            pass(&mut input, next.saturating_sub(at + 9)).map_err(io)?;
            at = next;
            continue;
        }
        if claimed.is_none_or(|end| end > size) {
            let rest = size.saturating_sub(at + 9);
            output.found.lost.push(lost(format!(
                "all behind a damaged head of a record, which claims more than the {rest} bytes left,"
            )));
            break;
        }
        let mut body = vec![0; usize::try_from(length).unwrap_or(usize::MAX)];
        input.read_exact(&mut body).map_err(io)?;
        match parse_record(head[0], &body) {
            // The checksum of an attachment covers everything before it.
            Ok(Record::Attachment { header, crc, .. })
                if crc != 0 && crc32fast::hash(&body[..body.len() - 4]) != crc =>
            {
                output.found.lost.push(lost(format!("attachment `{}` (its check sum is wrong)", header.name)));
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
            // The index has no record here; what follows repeats the data.
            _ if !places.is_empty() && next.is_none() => {
                output.found.lost.push(lost(format!("a record of kind {:#04x} behind the data", head[0])));
                break;
            }
            // Some other record before the damage.
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
        let index = place.map_or(0, |place| place.index);
        if place.is_some_and(|place| place.opcode == op::CHUNK) && index > 0 {
            // The message index has no other content than the chunk.
            let mut bytes = Vec::new();
            input.by_ref().take(index).read_to_end(&mut bytes).map_err(io)?;
            sum.update(&bytes);
            at += index;
        }
    }
    output.finish(from)
}

/// Skips `length` bytes.
fn pass(input: &mut impl Read, length: u64) -> std::io::Result<()> {
    std::io::copy(&mut input.take(length), &mut std::io::sink()).map(drop)
}

/// Reads until the buffer is full or the file ends; returns the number of bytes.
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
