//! A trial's log, frame by frame in any order.

use std::path::Path;

use prost::bytes::Bytes;

use crate::{
    convert,
    error::LogError,
    read::{Message, Pending, foreign},
    record::{FrameRecord, TrialHeader},
    recording::{Entry, Recording},
    topic,
};

/// A trial's log, read through once: its frames in any order, from several threads.
#[derive(Debug)]
pub struct Frames {
    recording: Recording,
    header: TrialHeader,
    /// The messages of each frame, the last of which closes it: places in the recording's list.
    frames: Vec<std::ops::Range<usize>>,
}

impl Frames {
    /// Opens the log at `path`, reads it through and verifies every check sum.
    ///
    /// # Errors
    /// [`LogError`] when the file is no MCAP file, cut off, damaged, or no log of a trial.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let recording = Recording::open(path, |wanted| {
            let own = [topic::HEADER, topic::RESULT, topic::CANDIDATES, topic::EVALUATION, topic::TIMING];
            own.contains(&&wanted.name[..])
                || topic::IMAGES.contains(&&wanted.name[..])
                || [topic::FRAME, topic::INPUTS].contains(&&wanted.name[..])
        })?;
        let name = |entry: &Entry| recording.topics()[entry.topic].name.as_str();
        let lacks =
            || LogError::Foreign { path: path.to_owned(), what: format!("it has no message on {}", topic::HEADER) };
        let at = recording.entries().iter().position(|entry| name(entry) == topic::HEADER).ok_or_else(lacks)?;
        let message = message(&recording, &recording.entries()[at], true)?;
        let header = message.decode(path, "TrialHeader")?;
        let header = convert::header_record(header).map_err(|error| foreign(path, &message, &error.0))?;
        let (mut frames, mut first) = (Vec::new(), at + 1);
        for (index, entry) in recording.entries().iter().enumerate().skip(at + 1) {
            if name(entry) == topic::FRAME {
                frames.push(first..index + 1);
                first = index + 1;
            }
        }
        // The header is repeated at the end.
        if recording.entries()[first..].iter().any(|entry| name(entry) != topic::HEADER) {
            return Err(LogError::Foreign { path: path.to_owned(), what: "its last frame is not closed".to_owned() });
        }
        Ok(Self { recording, header, frames })
    }

    /// What the trial is.
    pub fn header(&self) -> &TrialHeader {
        &self.header
    }

    /// What the log lacks, where it was saved of one that was not whole.
    pub fn recovered(&self) -> Option<&str> {
        self.recording.recovered()
    }

    /// How many frames the log holds.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether it holds none.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Whether the frame in this place of the log has images.
    pub fn has_images(&self, place: usize) -> bool {
        let entries = &self.recording.entries()[self.frames[place].clone()];
        entries.iter().any(|entry| topic::IMAGES.contains(&&self.recording.topics()[entry.topic].name[..]))
    }

    /// The frame in this place of the log, with its images if they are wanted.
    ///
    /// # Errors
    /// [`LogError`] when a message is not what its topic promises.
    pub fn frame(&self, place: usize, images: bool) -> Result<FrameRecord, LogError> {
        let path = self.recording.path();
        let mut pending = Pending::default();
        for entry in &self.recording.entries()[self.frames[place].clone()] {
            let wanted = images || !topic::IMAGES.contains(&&self.recording.topics()[entry.topic].name[..]);
            let message = message(&self.recording, entry, wanted)?;
            if let Some(frame) = pending.take(path, &message, images)? {
                return Ok(frame);
            }
        }
        unreachable!("the last message of a frame closes it")
    }
}

/// A message of the recording; without its bytes if they are not wanted.
fn message(recording: &Recording, entry: &Entry, wanted: bool) -> Result<Message, LogError> {
    let topic = &recording.topics()[entry.topic];
    Ok(Message {
        topic: topic.name.as_str().into(),
        schema: topic.schema.as_str().into(),
        encoding: topic.encoding.as_str().into(),
        sequence: entry.sequence,
        log_time: entry.log_time,
        data: if wanted { recording.message(entry)?.into() } else { Bytes::new() },
    })
}
