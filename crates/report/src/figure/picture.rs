//! Both images of one fix with what was found in them, in the manner of the paper's Figure 7.

use std::collections::BTreeSet;

use image::{Rgb, RgbImage, codecs::jpeg::JpegEncoder};
use seafix_log::{FrameRecord, GreyImage, Outcome, Reader};

use super::marks::{BLACK, BLUE, ORANGE, VERMILION, WHITE, disc, plus, ring};
use crate::{
    ReportError,
    run::{Run, Trial},
};

/// Of the JPEG: marks stay sharp, the page stays small.
const QUALITY: u8 = 88;
/// Columns between the two images.
const GAP: u32 = 8;

/// The picture of one frame, and what its caption says.
#[derive(Debug)]
pub(crate) struct Picture {
    /// The two images side by side, JPEG: a page with it can be sent by mail.
    pub(crate) jpeg: Vec<u8>,
    /// Columns and rows.
    pub(crate) size: [u32; 2],
    /// Index of the trial.
    pub(crate) trial: usize,
    /// Number and stamp of the frame.
    pub(crate) frame: u64,
    pub(crate) stamp_ns: u64,
    /// Key points of the left image, points of the cloud, candidates, identified, used.
    pub(crate) counts: [usize; 5],
    /// The targets that were fixed.
    pub(crate) objects: Vec<String>,
}

impl Picture {
    /// The frame with most identified points among those that have images and whose fixes are right;
    /// `None` without images or fixes.
    pub(crate) fn choose(run: &Run) -> Result<Option<Self>, ReportError> {
        let mut best: Vec<(usize, usize, u64)> = Vec::new();
        for (index, trial) in run.trials.iter().enumerate() {
            let frames = trial.frames.iter().map(|frame| {
                let right = |fix: &&seafix_log::TargetRecord| {
                    fix.outcome == Outcome::Referenced && fix.evaluation.wrong != Some(true)
                };
                let identified: usize = frame.targets.iter().filter(right).map(|fix| fix.pairs.len()).sum();
                let wrong = frame.targets.iter().any(|fix| fix.evaluation.wrong == Some(true));
                (if wrong { 0 } else { identified }, frame)
            });
            // The first of equals, so not `max_by_key`.
            let first = frames.fold((0, None), |best, (n, frame)| if n > best.0 { (n, Some(frame)) } else { best });
            if let (identified, Some(frame)) = first {
                best.push((identified, index, frame.stamp_ns));
            }
        }
        best.sort_by_key(|&(identified, index, _)| (usize::MAX - identified, index));
        for (_, index, stamp_ns) in best {
            let trial = &run.trials[index];
            for frame in Reader::open(&trial.path)?.images_at(stamp_ns) {
                let frame = frame?;
                if let (true, Some(images)) = (frame.stamp_ns == stamp_ns, &frame.images) {
                    return Self::draw(trial, index, &frame, images).map(Some);
                }
            }
        }
        Ok(None)
    }

    fn draw(trial: &Trial, index: usize, frame: &FrameRecord, images: &[GreyImage; 2]) -> Result<Self, ReportError> {
        let [left, right] = images;
        let size = [left.width + GAP + right.width, left.height.max(right.height)];
        let mut canvas = RgbImage::from_pixel(size[0], size[1], Rgb(WHITE));
        let offset = f64::from(left.width + GAP);
        copy(&mut canvas, left, 0);
        copy(&mut canvas, right, left.width + GAP);

        let scale = (f64::from(left.width) / 1024.0).max(0.5);
        let places = |cloud: u32| {
            let pixels = frame.cloud.get(cloud as usize).and_then(|point| point.pixels);
            pixels.map(|pixels| [pixels.left, [pixels.right[0] + offset, pixels.right[1]]]).into_iter().flatten()
        };
        let matched: Vec<[f64; 2]> = (0..frame.cloud.len() as u32).flat_map(places).collect();
        for at in frame.key_points.iter().copied().chain(matched.into_iter().filter(|at| at[0] >= offset - 1.0)) {
            plus(&mut canvas, at, 5.5 * scale, 4.0 * scale, BLACK);
            plus(&mut canvas, at, 4.5 * scale, 2.0 * scale, WHITE);
        }
        let fixes: Vec<_> = frame.targets.iter().filter(|target| target.outcome == Outcome::Referenced).collect();
        let candidates: BTreeSet<u32> = frame.targets.iter().flat_map(|target| target.candidates.concat()).collect();
        for at in candidates.iter().flat_map(|&cloud| places(cloud)) {
            ring(&mut canvas, at, 10.5 * scale, 3.0 * scale, BLUE);
        }
        for fix in &fixes {
            for (place, pair) in (0_u32..).zip(&fix.pairs) {
                for at in places(pair.cloud) {
                    disc(&mut canvas, at, 12.0 * scale, ORANGE);
                    disc(&mut canvas, at, 8.0 * scale, BLACK);
                    if fix.used.contains(&place) {
                        ring(&mut canvas, at, 17.0 * scale, 4.0 * scale, VERMILION);
                    }
                }
            }
        }
        let mut jpeg = Vec::new();
        canvas.write_with_encoder(JpegEncoder::new_with_quality(&mut jpeg, QUALITY)).map_err(|error| {
            ReportError::Picture { path: trial.path.clone(), frame: frame.frame, message: error.to_string() }
        })?;
        Ok(Self {
            jpeg,
            size,
            trial: index,
            frame: frame.frame,
            stamp_ns: frame.stamp_ns,
            counts: [
                frame.key_points.len(),
                frame.cloud.len(),
                candidates.len(),
                fixes.iter().map(|fix| fix.pairs.len()).sum(),
                fixes.iter().map(|fix| fix.used.len()).sum(),
            ],
            objects: fixes.iter().map(|fix| fix.object.clone()).collect(),
        })
    }
}

fn copy(canvas: &mut RgbImage, image: &GreyImage, offset: u32) {
    for (row, y) in image.pixels.chunks_exact(image.width.max(1) as usize).zip(0..) {
        for (&grey, x) in row.iter().zip(offset..) {
            canvas.put_pixel(x, y, Rgb([grey; 3]));
        }
    }
}
