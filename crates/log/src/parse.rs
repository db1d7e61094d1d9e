//! Records of MCAP whose lengths are checked before memory is allocated for them.

use mcap::{
    McapError,
    records::{Record, op},
};

/// Parses a record. The library allocates what the length of a text declares, up to 4 GB for a few bytes.
pub(crate) fn parse_record(kind: u8, body: &[u8]) -> Result<Record<'_>, McapError> {
    match fits(kind, body) {
        Some(()) => mcap::parse_record(kind, body),
        None => Err(McapError::UnexpectedEof),
    }
}

/// Whether every text of a record lies within it.
fn fits(kind: u8, body: &[u8]) -> Option<()> {
    // The number of bytes before the first text, the number of texts, and whether a map of texts follows.
    let (before, texts, map) = match kind {
        op::HEADER => (0, 2, false),
        op::SCHEMA => (2, 3, false),
        op::CHANNEL => (4, 2, true),
        op::CHUNK => (28, 1, false),
        op::MESSAGE_INDEX => (2, 1, false),
        op::ATTACHMENT => (16, 2, false),
        op::ATTACHMENT_INDEX => (40, 2, false),
        op::METADATA => (0, 1, true),
        op::METADATA_INDEX => (16, 1, false),
        op::CHUNK_INDEX => {
            let (_, rest) = text(body.get(32..)?)?;
            return text(rest.get(8..)?).map(drop);
        }
        _ => return Some(()),
    };
    let mut rest = body.get(before..)?;
    for _ in 0..texts {
        rest = text(rest)?.1;
    }
    if map {
        let (mut inside, _) = text(rest)?;
        while !inside.is_empty() {
            inside = text(inside)?.1;
        }
    }
    Some(())
}

/// The content of a text with its length before it, and the rest.
fn text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails without the check: the library allocates 4 GB.
    #[test]
    fn a_text_longer_than_its_record_is_rejected() {
        let channel = |length: u32| [&[1, 0, 1, 0][..], &length.to_le_bytes(), b"a", &[0; 8]].concat();
        assert!(parse_record(op::CHANNEL, &channel(1)).is_ok());
        assert!(parse_record(op::CHANNEL, &channel(u32::MAX)).is_err());
        assert!(parse_record(op::METADATA, &[255; 8]).is_err());
    }
}
