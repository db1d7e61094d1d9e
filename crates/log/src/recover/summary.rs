//! The summary at the end of an MCAP file: a second source for what a damaged data section lacks.

use std::{
    collections::{BTreeMap, HashMap},
    fs::File,
    io::{Read as _, Seek as _, SeekFrom},
};

use mcap::records::{self, Record, op};

use crate::{chunk::chunk, convert, parse::parse_record, proto, record::TrialHeader, topic};

/// The place of a record according to the summary.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// The kind of the record.
    pub(super) opcode: u8,
    /// The length of the record with its head (bytes).
    pub(super) length: u64,
    /// The length of the message index behind a chunk, which only repeats its content (bytes).
    pub(super) index: u64,
}

/// The content of a summary whose checksum holds; empty without one.
#[derive(Debug, Default)]
pub(super) struct Summary {
    pub(super) schemas: HashMap<u16, Record<'static>>,
    pub(super) channels: HashMap<u16, records::Channel>,
    /// The records of the data section by their offsets.
    pub(super) places: BTreeMap<u64, Place>,
}

/// The length of footer and magic (bytes).
const END: u64 = 9 + 20 + 8;

impl Summary {
    /// The summary of a file of `size` bytes; `None` if it is damaged or absent.
    pub(super) fn read(mut file: &File, size: u64) -> Option<Self> {
        let mut end = [0; END as usize];
        file.seek(SeekFrom::Start(size.checked_sub(END)?)).ok()?;
        file.read_exact(&mut end).ok()?;
        let Ok(Record::Footer(footer)) = parse_record(end[0], &end[9..29]) else { return None };
        let length = size.checked_sub(END)?.checked_sub(footer.summary_start)?;
        if end[29..] != *mcap::MAGIC || footer.summary_start == 0 {
            return None;
        }
        file.seek(SeekFrom::Start(footer.summary_start)).ok()?;
        let mut bytes = Vec::new();
        file.take(length).read_to_end(&mut bytes).ok()?;
        // The checksum covers the footer up to itself.
        let mut sum = crc32fast::Hasher::new();
        sum.update(&bytes);
        sum.update(&end[..25]);
        if footer.summary_crc != 0 && sum.finalize() != footer.summary_crc {
            return None;
        }
        let mut found = Self::default();
        let mut rest = &bytes[..];
        while let Some((head, after)) = rest.split_at_checked(9) {
            let length = usize::try_from(u64::from_le_bytes(head[1..].try_into().ok()?)).ok()?;
            let (body, next) = after.split_at_checked(length)?;
            found.take(parse_record(head[0], body).ok()?.into_owned());
            rest = next;
        }
        found.places.retain(|at, place| {
            let end = place.length.checked_add(place.index).and_then(|length| at.checked_add(length));
            place.length >= 9 && end.is_some_and(|end| end <= footer.summary_start)
        });
        Some(found)
    }

    fn take(&mut self, record: Record<'static>) {
        let (at, opcode, length, index) = match record {
            Record::Channel(channel) => return drop(self.channels.insert(channel.id, channel)),
            Record::Schema { header, data } => {
                return drop(self.schemas.insert(header.id, Record::Schema { header, data }));
            }
            Record::ChunkIndex(chunk) => {
                (chunk.chunk_start_offset, op::CHUNK, chunk.chunk_length, chunk.message_index_length)
            }
            Record::AttachmentIndex(attachment) => (attachment.offset, op::ATTACHMENT, attachment.length, 0),
            Record::MetadataIndex(metadata) => (metadata.offset, op::METADATA, metadata.length, 0),
            _ => return,
        };
        self.places.insert(at, Place { opcode, length, index });
    }

    /// The spare header of a trial in the last chunk.
    pub(super) fn spare_header(&self, mut file: &File, size: u64) -> Option<TrialHeader> {
        let own = |id: &u16| self.channels.get(id).is_some_and(|channel| channel.topic == topic::HEADER);
        let (at, place) = self.places.iter().rev().find(|(_, place)| place.opcode == op::CHUNK)?;
        file.seek(SeekFrom::Start(*at)).ok()?;
        let mut bytes = vec![0; usize::try_from(place.length.min(size)).ok()?];
        file.read_exact(&mut bytes).ok()?;
        let (head, body) = bytes.split_at_checked(9)?;
        let records = chunk(head, body, size).ok()?;
        let header = records.into_iter().find_map(|record| match record {
            Record::Message { header, data } if own(&header.channel_id) => Some(data),
            _ => None,
        })?;
        let header: proto::TrialHeader = prost::Message::decode(&header[..]).ok()?;
        convert::header_record(header).ok()
    }
}
