//! Reading a trial's log.

mod pending;
mod source;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use crate::{
    convert,
    error::LogError,
    record::{FrameRecord, Totals, TrialHeader},
    topic,
};
pub(crate) use pending::Pending;
pub use source::looks_like;
pub(crate) use source::{Message, foreign};
use source::{Source, Take};

/// A whole trial, as its log has it.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialLog {
    /// What the trial is.
    pub header: TrialHeader,
    /// Its frames, in order.
    pub frames: Vec<FrameRecord>,
}

/// Reads the log at `path` back into the records it was written from, images included.
///
/// # Errors
/// [`LogError`] when the file is no MCAP file, cut off, damaged, or no log of a trial: never a silent
/// short result.
pub fn read(path: &Path) -> Result<TrialLog, LogError> {
    let mut reader = Reader::open(path)?;
    let frames = reader.by_ref().collect::<Result<_, _>>()?;
    Ok(TrialLog { header: reader.header, frames })
}

/// Reads a log frame by frame, in memory for one frame.
///
/// Check sums are verified as the reading goes; a log that is cut off or damaged ends in an error, after
/// the frames before it.
#[derive(Debug)]
pub struct Reader {
    source: Source,
    header: TrialHeader,
    images: Images,
    inputs: bool,
    bare: bool,
    seen_images: bool,
    totals: Option<Totals>,
    ended: bool,
}

/// Of which frames the images are decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Images {
    All,
    None,
    At(BTreeSet<u64>),
}

impl Images {
    fn wanted(&self, stamp_ns: u64) -> bool {
        match self {
            Self::All => true,
            Self::None => false,
            Self::At(stamps) => stamps.contains(&stamp_ns),
        }
    }
}

impl Reader {
    /// Opens the log at `path` and reads its header.
    ///
    /// # Errors
    /// [`LogError`] when the file is no MCAP file, cut off or damaged before the header, or no log of a
    /// trial.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let mut source = Source::open(path)?;
        while let Some(message) = source.next_message(|_, _| Take::Full)? {
            if &*message.topic == topic::HEADER {
                let header = message.decode(path, "TrialHeader").and_then(|header| {
                    convert::header_record(header).map_err(|error| foreign(path, &message, &error.0))
                })?;
                return Ok(Self {
                    source,
                    header,
                    images: Images::All,
                    inputs: true,
                    bare: false,
                    seen_images: false,
                    totals: None,
                    ended: false,
                });
            }
        }
        Err(LogError::Foreign { path: path.to_owned(), what: format!("it has no message on {}", topic::HEADER) })
    }

    /// The same, without decoding images: frames come with `images: None`.
    #[must_use]
    pub fn without_images(mut self) -> Self {
        self.images = Images::None;
        self
    }

    /// The same, without what methods were given to the last bit: frames come with `inputs: None`.
    #[must_use]
    pub fn without_inputs(mut self) -> Self {
        self.inputs = false;
        self
    }

    /// The same, for who wants results alone: frames come without prior and points in view, and cloud points by their pixels
    /// alone, place and covariance NaN. That is three quarters of what decoding a frame allocates.
    #[must_use]
    pub fn bare(mut self) -> Self {
        self.bare = true;
        self
    }

    /// The same, decoding only the images of frames with these stamps.
    #[must_use]
    pub fn images_at(mut self, stamps_ns: impl IntoIterator<Item = u64>) -> Self {
        self.images = Images::At(stamps_ns.into_iter().collect());
        self
    }

    /// What the trial is.
    pub fn header(&self) -> &TrialHeader {
        &self.header
    }

    /// The next message behind the header as it stands in the file; `None` at the end, when every check sum held.
    pub(crate) fn next_message(&mut self) -> Result<Option<Message>, LogError> {
        self.source.next_message(|_, _| Take::Full)
    }

    /// Whether a frame read so far has images in the log, decoded or not.
    pub fn has_images(&self) -> bool {
        self.seen_images
    }

    /// What all frames of the trial add up to, logged or not: known after the last frame, where the log says it.
    pub fn totals(&self) -> Option<&Totals> {
        self.totals.as_ref()
    }

    /// What the log lacks, where it was saved of one that was not whole: known after the last frame.
    pub fn recovered(&self) -> Option<&str> {
        self.source.recovered()
    }

    /// Calls `take` with each remaining frame, in order. The current rayon pool decodes frames while the next are read.
    ///
    /// # Errors
    /// [`LogError`] as the reading goes; not all frames before it need have been taken.
    pub fn for_each_frame(&mut self, mut take: impl FnMut(FrameRecord) + Send) -> Result<(), LogError> {
        let mut read = self.some_messages()?;
        while !read.is_empty() {
            let (path, images, bare) = (self.source.path().to_owned(), self.images.clone(), self.bare);
            let decode = || -> Result<Vec<FrameRecord>, LogError> {
                read.par_iter().map(|messages| decoded(&path, &images, bare, messages)).collect()
            };
            let (frames, next) = rayon::join(decode, || self.some_messages());
            frames?.into_iter().for_each(&mut take);
            read = next?;
        }
        self.ended = true;
        Ok(())
    }

    fn next_frame(&mut self) -> Result<Option<FrameRecord>, LogError> {
        self.next_messages()?
            .map(|messages| decoded(self.source.path(), &self.images, self.bare, &messages))
            .transpose()
    }

    /// The messages of the next frames; none at the end.
    fn some_messages(&mut self) -> Result<Vec<Vec<Message>>, LogError> {
        /// So many frames are read at a time, or so many bytes.
        const MAX: (usize, usize) = (256, 16 << 20);
        let (mut frames, mut bytes) = (Vec::new(), 0);
        while frames.len() < MAX.0 && bytes < MAX.1 {
            let Some(messages) = self.next_messages()? else { break };
            bytes += messages.iter().map(|message| message.data.len()).sum::<usize>();
            frames.push(messages);
        }
        Ok(frames)
    }

    /// The messages of the next frame, the last of which closes it.
    fn next_messages(&mut self) -> Result<Option<Vec<Message>>, LogError> {
        let (images, inputs) = (&self.images, self.inputs);
        let take = |topic: &str, stamp: u64| match topic {
            topic::RESULT
            | topic::CANDIDATES
            | topic::EVALUATION
            | topic::INSPECTION
            | topic::TIMING
            | topic::FRAME
            | topic::TOTALS => Take::Full,
            topic::INPUTS if inputs => Take::Full,
            topic if !topic::IMAGES.contains(&topic) => Take::Nothing,
            _ if images.wanted(stamp) => Take::Full,
            _ => Take::Mark,
        };
        let (mut messages, mut bytes) = (Vec::new(), 0);
        while let Some(message) = self.source.next_message(take)? {
            bytes += message.data.len() + size_of::<Message>();
            if bytes > self.source.limit() {
                let what = format!("the frame at {} ns has more than {bytes} bytes", message.log_time);
                return Err(LogError::TooLarge { path: self.source.path().to_owned(), what });
            }
            if &*message.topic == topic::TOTALS {
                self.totals = Some(convert::totals_record(message.decode(self.source.path(), "Totals")?));
                continue;
            }
            self.seen_images |= topic::IMAGES.contains(&&message.topic[..]);
            let closes = &*message.topic == topic::FRAME;
            messages.push(message);
            if closes {
                return Ok(Some(messages));
            }
        }
        if messages.is_empty() {
            Ok(None)
        } else {
            let path: PathBuf = self.source.path().to_owned();
            Err(LogError::Foreign { path, what: "its last frame is not closed".to_owned() })
        }
    }
}

/// The frame of these messages.
fn decoded(path: &Path, images: &Images, bare: bool, messages: &[Message]) -> Result<FrameRecord, LogError> {
    let mut pending = if bare { Pending::bare() } else { Pending::default() };
    for message in messages {
        if let Some(frame) = pending.take(path, message, images.wanted(message.log_time))? {
            return Ok(frame);
        }
    }
    unreachable!("the last message of a frame closes it")
}

impl Iterator for Reader {
    type Item = Result<FrameRecord, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let frame = self.next_frame().transpose();
        self.ended = !matches!(frame, Some(Ok(_)));
        frame
    }
}
