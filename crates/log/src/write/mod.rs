//! Writing a trial's log.

mod preamble;
mod sink;

use std::path::Path;

use crate::{
    check, convert,
    error::LogError,
    png,
    record::{FrameRecord, Totals, TrialHeader},
    topic,
    view::{self, Places},
};
pub(crate) use preamble::Preamble;
use sink::{Sink, Use};

/// Writes the log of one trial.
///
/// The file is called `NAME.mcap.partial` until [`Writer::finish`]; a writer that is dropped before removes it. A killed
/// process leaves it.
#[derive(Debug)]
pub struct Writer {
    sink: Sink,
    header: TrialHeader,
    places: Places,
    last: Option<u64>,
}

impl Writer {
    /// Begins the log of the trial `header` describes at `path` (`….mcap`), in `path` + `.partial`.
    ///
    /// # Errors
    /// [`LogError`] when the file cannot be created or the header contradicts itself.
    pub fn create(path: &Path, header: &TrialHeader) -> Result<Self, LogError> {
        Self::new(path, header, Use::Kept)
    }

    /// The same for a log of some of the trial's frames that [`join`](crate::join) shall take soon: it is not
    /// compressed, and [`Writer::finish`] does not wait for the disk.
    ///
    /// # Errors
    /// As [`Writer::create`].
    pub fn piece(path: &Path, header: &TrialHeader) -> Result<Self, LogError> {
        Self::new(path, header, Use::Joined)
    }

    fn new(path: &Path, header: &TrialHeader, purpose: Use) -> Result<Self, LogError> {
        let record = |what| LogError::Record { path: path.to_owned(), what };
        check::header(header).map_err(record)?;
        let places = Places::of(header).map_err(record)?;
        Ok(Self { sink: Sink::create(path, purpose)?, header: header.clone(), places, last: None })
    }

    /// The trial it writes of.
    pub(crate) fn header(&self) -> &TrialHeader {
        &self.header
    }

    /// Adds one frame; stamps must not decrease.
    ///
    /// # Errors
    /// [`LogError`] when the record contradicts itself or the header (nothing of it is then written),
    /// or nothing more can be written.
    pub fn frame(&mut self, frame: &FrameRecord) -> Result<(), LogError> {
        self.frame_with(frame, None)
    }

    /// The same with the frame's images as PNG ([`encode_png`](crate::encode_png)), where they are known: logs of several
    /// trials hold the same images.
    ///
    /// # Errors
    /// As [`Writer::frame`].
    pub fn frame_with(&mut self, frame: &FrameRecord, pngs: Option<&[Vec<u8>; 2]>) -> Result<(), LogError> {
        let path = self.sink.path().to_owned();
        let record = |what| LogError::Record { path: path.clone(), what: format!("frame {}: {what}", frame.frame) };
        check::frame(&self.header, frame, self.last).map_err(record)?;
        let transforms = view::moving_transforms(&self.places, frame).map_err(record)?;
        let poses = view::body_pose(&self.places, frame).map_err(record)?;
        let paths = view::path(&self.places, frame).map_err(record)?;
        let pngs = match (&frame.images, pngs) {
            (None, _) => Vec::new(),
            (Some(_), Some(known)) => known.to_vec(),
            (Some([left, right]), None) => {
                vec![png::encode_png(left).map_err(record)?, png::encode_png(right).map_err(record)?]
            }
        };

        let stamp = frame.stamp_ns;
        if self.last.is_none() {
            self.begin(stamp)?;
        }
        self.last = Some(stamp);
        let sink = &mut self.sink;
        for (side, png) in pngs.into_iter().enumerate() {
            sink.put(topic::IMAGES[side], stamp, &view::compressed(side, png, stamp))?;
        }
        if frame.images.is_some() {
            for side in [0, 1] {
                sink.put(topic::ANNOTATIONS[side], stamp, &view::annotations(&self.header, frame, side))?;
            }
            // Programs read large runs without images, people those with images.
            sink.put(topic::CLOUD_LINES, stamp, &view::measured_lines(&self.header, frame))?;
            sink.put(topic::CLOUD_GATES, stamp, &view::gates(&self.header, &self.places, frame))?;
            sink.put(topic::POSE_COVARIANCE, stamp, &view::position_covariance(&self.places, frame))?;
            for (topic, path) in paths {
                sink.put(topic, stamp, &path)?;
            }
        }
        if !transforms.transforms.is_empty() {
            sink.put(topic::TF, stamp, &transforms)?;
        }
        for (topic, pose) in poses {
            sink.put(topic, stamp, &pose)?;
        }
        sink.put(topic::CLOUD, stamp, &view::measured_cloud(frame))?;
        sink.put(topic::CLOUD_CANDIDATES, stamp, &view::candidate_cloud(frame))?;
        sink.put(topic::CLOUD_IDENTIFIED, stamp, &view::identified_cloud(&self.header, frame))?;
        for index in 0..frame.targets.len() {
            sink.put(topic::CANDIDATES, stamp, &convert::candidates_message(frame, index))?;
            sink.put(topic::RESULT, stamp, &convert::result_message(frame, index))?;
            sink.put(topic::EVALUATION, stamp, &convert::evaluation_message(frame, index))?;
        }
        if !frame.poi.is_empty() {
            sink.put(topic::INSPECTION, stamp, &convert::inspection_message(frame))?;
        }
        sink.put(topic::TIMING, stamp, &convert::timing_message(frame))?;
        if let Some(inputs) = &frame.inputs {
            sink.put(topic::INPUTS, stamp, &convert::inputs_message(frame, inputs))?;
        }
        sink.put(topic::FRAME, stamp, &convert::frame_message(frame))
    }

    /// Adds a message of a frame as another log of the same trial has it; topics that no frame has are left out.
    pub(crate) fn copy(&mut self, topic: &str, stamp: u64, message: &[u8]) -> Result<(), LogError> {
        let Some(&(topic, schema)) = topic::OF_FRAMES.iter().find(|(name, _)| *name == topic) else { return Ok(()) };
        if let Some(last) = self.last.filter(|last| stamp < *last) {
            let what = format!("stamp {stamp} ns follows {last} ns; stamps must not decrease");
            return Err(LogError::Record { path: self.sink.path().to_owned(), what });
        }
        if self.last.is_none() {
            self.begin(stamp)?;
        }
        self.last = Some(stamp);
        self.sink.put_bytes(topic, schema, stamp, message)
    }

    /// Adds what all frames of the trial add up to, those that were not logged included; after the last frame.
    ///
    /// # Errors
    /// [`LogError`] when nothing more can be written.
    pub fn totals(&mut self, totals: &Totals) -> Result<(), LogError> {
        let stamp = self.last.unwrap_or(0);
        if self.last.is_none() {
            self.begin(stamp)?;
            self.last = Some(stamp);
        }
        self.sink.put(topic::TOTALS, stamp, &convert::totals_message(totals))
    }

    /// Marks the log as one that is not whole; after the totals.
    pub(crate) fn lacks(&mut self, lost: &str) -> Result<(), LogError> {
        let mark = topic::recovered(lost);
        self.sink.metadata(&mark.name, mark.metadata)
    }

    /// Completes the log: a second copy of the header in the last chunk, index, checksums, sync, final name.
    ///
    /// # Errors
    /// [`LogError`] when any of it fails; the unfinished file is then removed.
    pub fn finish(mut self) -> Result<(), LogError> {
        if self.last.is_none() {
            self.begin(0)?;
        }
        self.sink.spare(self.last.unwrap_or(0), &convert::header_message(&self.header))?;
        self.sink.finish()
    }

    /// Writes the records before the first frame, as chunks of their own: damage there costs no frame.
    fn begin(&mut self, stamp: u64) -> Result<(), LogError> {
        let (preamble, sink) = (Preamble::of(&self.header, &self.places, stamp), &mut self.sink);
        sink.metadata(Preamble::METADATA, preamble.metadata)?;
        for (name, text) in preamble.attachments {
            sink.attach(name, text, stamp)?;
        }
        for (topic, schema, message) in &preamble.messages {
            sink.put_bytes(topic, *schema, stamp, message)?;
        }
        sink.end_chunk()
    }
}
