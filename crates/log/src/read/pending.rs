//! The messages of a frame until the one that closes it.

use std::path::Path;

use crate::{
    convert,
    error::LogError,
    png,
    proto::{self, foxglove::CompressedImage},
    record::{Evaluation, FrameRecord, GreyImage},
    topic,
};

use super::source::{Message, foreign};

/// What has come of the frame that is being read.
#[derive(Debug, Default)]
pub(crate) struct Pending {
    images: Vec<GreyImage>,
    skipped_images: usize,
    results: Vec<proto::ReferencingResult>,
    candidates: Vec<proto::Candidates>,
    evaluations: Vec<proto::Evaluation>,
    inspection: Option<proto::Inspection>,
    timing: Option<proto::Timing>,
    inputs: Option<proto::Inputs>,
    /// Whether the frame comes without what results do not need.
    bare: bool,
}

impl Pending {
    /// Nothing yet, of a frame that comes without what results do not need.
    pub(crate) fn bare() -> Self {
        Self { bare: true, ..Self::default() }
    }

    /// Takes in one message; the whole frame, if it closes one.
    pub(crate) fn take(
        &mut self,
        path: &Path,
        message: &Message,
        images: bool,
    ) -> Result<Option<FrameRecord>, LogError> {
        match &message.topic[..] {
            topic if topic::IMAGES.contains(&topic) => {
                if images {
                    let image: CompressedImage = message.decode_as(path, "foxglove.CompressedImage")?;
                    let image = png::decode(&image.data).map_err(|error| foreign(path, message, &error))?;
                    self.images.push(image);
                } else {
                    self.skipped_images += 1;
                }
            }
            topic::RESULT => self.results.push(message.decode(path, "ReferencingResult")?),
            topic::CANDIDATES => self.candidates.push(message.decode(path, "Candidates")?),
            topic::EVALUATION => self.evaluations.push(message.decode(path, "Evaluation")?),
            topic::INSPECTION => self.inspection = Some(message.decode(path, "Inspection")?),
            topic::INPUTS => self.inputs = Some(message.decode(path, "Inputs")?),
            topic::TIMING => self.timing = Some(message.decode(path, "Timing")?),
            topic::FRAME => {
                let closed = if self.bare {
                    let frame: convert::BareFrame = message.decode(path, "Frame")?;
                    let closing = [frame.images, frame.results];
                    convert::bare_frame_record(frame).map(|frame| (frame, closing))
                } else {
                    let frame: proto::Frame = message.decode(path, "Frame")?;
                    let closing = [frame.images, frame.results];
                    convert::frame_record(frame).map(|frame| (frame, closing))
                };
                let full = closed.map_err(|error| error.0).and_then(|closed| std::mem::take(self).close(closed));
                return full.map(Some).map_err(|what| foreign(path, message, &what));
            }
            _ => {}
        }
        Ok(None)
    }

    /// `frame` with all that it closes, so many images and results, or what it lacks.
    fn close(self, (mut frame, closing): (FrameRecord, [u32; 2])) -> Result<FrameRecord, String> {
        let (number, [images, results]) = (frame.frame, closing.map(|count| count as usize));
        let timing = self.timing.ok_or_else(|| format!("frame {number} has no times"))?;
        for (what, found, expected) in [
            ("images", self.images.len() + self.skipped_images, images),
            ("results", self.results.len(), results),
            ("lists of candidates", self.candidates.len(), results),
            ("evaluations", self.evaluations.len(), results),
            ("times of targets", timing.targets.len(), results),
        ] {
            if found != expected {
                return Err(format!("frame {number} has {found} {what} instead of {expected}"));
            }
        }
        let (times, target_times) = convert::target_times(&timing);
        frame.times = times;
        if let Some(inputs) = self.inputs {
            if inputs.frame != number {
                return Err(format!("the inputs of frame {} stand in frame {number}", inputs.frame));
            }
            frame.inputs = Some(Box::new(convert::inputs_record(inputs).map_err(|error| error.0)?));
        }
        if let Some(inspection) = self.inspection {
            if inspection.frame != number {
                return Err(format!("the inspection of frame {} stands in frame {number}", inspection.frame));
            }
            frame.poi = convert::inspection_record(inspection).map_err(|error| error.0)?;
        }
        frame.images = <[GreyImage; 2]>::try_from(self.images).ok();
        let attempts = self.results.into_iter().zip(self.candidates).zip(self.evaluations).zip(target_times);
        for (index, (((result, candidates), evaluation), times)) in (0..).zip(attempts) {
            let places = [
                (result.frame, result.index),
                (candidates.frame, candidates.index),
                (evaluation.frame, evaluation.index),
            ];
            if places != [(number, index); 3] {
                return Err(format!("result {index} of frame {number} is mixed with another"));
            }
            let mut target = convert::result_record(result, candidates).map_err(|error| error.0)?;
            target.evaluation = Evaluation::of(&evaluation);
            target.times = times;
            frame.targets.push(target);
        }
        Ok(frame)
    }
}
