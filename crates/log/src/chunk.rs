//! The records of one chunk, in bounded memory.

use std::io::Read as _;

use mcap::{
    McapError,
    records::Record,
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use crate::parse::parse_record;

/// The memory limit (bytes) for a record, the records of a chunk or the messages of a frame, in a file of `size` bytes.
/// Images are already compressed, so an undamaged log stays below it.
pub(crate) fn limit(size: u64) -> usize {
    usize::try_from(size.saturating_mul(4).saturating_add(32 << 20)).unwrap_or(usize::MAX)
}

/// The records of a chunk, all of them or none: nothing is taken before its checksum is verified.
pub(crate) fn chunk(head: &[u8], body: &[u8], size: u64) -> Result<Vec<Record<'static>>, McapError> {
    let limit = limit(size);
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
            LinearReadEvent::Record { opcode, data } => {
                records.push(parse_record(opcode, data)?.into_owned());
                // Tiny records occupy more than their bytes.
                if records.len().saturating_mul(size_of::<Record<'_>>()) > limit {
                    return Err(McapError::ChunkTooLarge(records.len() as u64));
                }
            }
        }
    }
    Ok(records)
}
