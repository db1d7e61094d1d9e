//! A log that is cut off, altered or no log at all is refused: never a wrong record, never a panic.

use std::{fs, path::PathBuf};

use seafix_log::{LogError, Reader, read};

use crate::synthetic;

fn log() -> (tempfile::TempDir, PathBuf, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    synthetic::write(&path, 2);
    let bytes = fs::read(&path).unwrap();
    (folder, path, bytes)
}

#[test]
fn a_log_cut_at_any_byte_is_reported_as_cut() {
    let (_folder, path, bytes) = log();
    let full = read(&path).unwrap();
    for length in (0..bytes.len()).rev().step_by(61).chain(bytes.len() - 60..bytes.len()) {
        fs::write(&path, &bytes[..length]).unwrap();
        let error = read(&path).unwrap_err();
        let expected = if length < 8 { "not an MCAP file" } else { "has no footer" };
        assert!(error.to_string().contains(expected), "{length}: {error}");
        if let Ok(reader) = Reader::open(&path) {
            for (frame, expected) in reader.map_while(Result::ok).zip(&full.frames) {
                assert!(frame == *expected, "{length}");
            }
        }
    }
}

#[test]
fn any_flipped_bit_is_noticed() {
    let (_folder, path, bytes) = log();
    for place in (0..bytes.len()).step_by(17).chain(bytes.len() - 200..bytes.len()) {
        let mut altered = bytes.clone();
        altered[place] ^= 1 << (place % 8);
        fs::write(&path, &altered).unwrap();
        assert!(read(&path).is_err(), "byte {place} of {}", bytes.len());
    }
}

/// Seen to fail where the first bytes are not looked at.
#[test]
fn other_files_are_named_for_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.mcap");
    for (bytes, expected) in [
        (&b""[..], "empty"),
        (b"#ROSBAG V2.0\n", "rosbags-convert"),
        (b"SQLite format 3\0", "ROS 2"),
        (b"PK\x03\x04abcd", "zip"),
        (b"hello", "bytes [68"),
    ] {
        fs::write(&path, bytes).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains(expected) && !error.contains('\n'), "{error}");
    }
    assert!(matches!(read(&folder.path().join("none.mcap")), Err(LogError::Io { .. })));
}

#[test]
fn another_programs_log_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    let channel = writer.add_channel(0, "/chatter", "json", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    assert!(matches!(read(&path), Err(LogError::Foreign { .. })));
}

/// A record and a chunk that claim gigabytes must not get them.
#[test]
fn claims_are_not_believed() {
    let (_folder, path, bytes) = log();
    let record = 8; // the header record: opcode, then its length
    let mut altered = bytes.clone();
    altered[record + 1..record + 9].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    fs::write(&path, &altered).unwrap();
    let error = read(&path).unwrap_err();
    assert!(matches!(error, LogError::TooLarge { .. }), "{error}");
}
