//! Pictures of a frame with its identified points, like Figures 7 to 9 of the paper.

use std::collections::BTreeSet;

use nalgebra::{Matrix4, Point3};
use seafix_log::{CameraRecord, FrameRecord, GreyImage, Outcome, Reader, TargetRecord, TrialHeader};

use crate::{
    error::ReportError,
    figure::{
        canvas::{self, Canvas},
        marks::{BLACK, BLUE, ORANGE, VERMILION, WHITE, digit, disc, frame as rectangle, plus, ring},
    },
    place::matrix,
    run::Trial,
};

/// The gap between the two images (px).
const GAP: u32 = 8;
/// The half size of a gate in standard deviations, √11.34.
///
/// 11.34 is the 99 % quantile of χ² with three degrees of freedom.
const GATE: f64 = 3.368;

/// The picture of a frame.
#[derive(Debug)]
pub(crate) struct Marked {
    canvas: Canvas,
    pub(crate) frame: u64,
    pub(crate) stamp_ns: u64,
    /// The counts of key points in the left image, cloud points, candidates, identified points and used points.
    pub(crate) counts: [usize; 5],
    /// The targets with a fix.
    pub(crate) objects: Vec<String>,
}

/// The pictures of the frames of `trial` with these stamps, in the order of the log.
///
/// Frames without images are skipped. The log is read up to the last stamp.
pub(crate) fn draw(trial: &Trial, stamps: &[u64]) -> Result<Vec<Marked>, ReportError> {
    let mut wanted: BTreeSet<u64> = stamps.iter().copied().collect();
    let mut pictures: Vec<Marked> = Vec::new();
    let mut frames = Reader::open(&trial.path)?.without_inputs().images_at(wanted.iter().copied());
    while !wanted.is_empty()
        && let Some(frame) = frames.next().transpose()?
    {
        if let Some(images) = &frame.images
            && wanted.remove(&frame.stamp_ns)
        {
            pictures.push(Marked::draw(&trial.header, &frame, images));
        }
    }
    Ok(pictures)
}

impl Marked {
    fn draw(header: &TrialHeader, frame: &FrameRecord, images: &[GreyImage; 2]) -> Self {
        let [left, right] = [0, 1].map(|side| full(&images[side], [&header.rig.left, &header.rig.right][side].size));
        let offset = f64::from(left.width + GAP);
        let size = [left.width + GAP + right.width, left.height.max(right.height)];
        let mut canvas = Canvas::new(size[0], size[1], WHITE);
        copy(&mut canvas, &left, 0);
        copy(&mut canvas, &right, left.width + GAP);

        let scale = (f64::from(left.width) / 1024.0).max(0.5);
        let places = |cloud: u32| {
            let pixels = frame.cloud.get(cloud as usize).and_then(|point| point.pixels);
            pixels.map(|pixels| [pixels.left, [pixels.right[0] + offset, pixels.right[1]]]).into_iter().flatten()
        };
        for (centre, half) in gates(header, frame, offset) {
            rectangle(&mut canvas, centre, half, 1.6 * scale, BLUE);
        }
        let matched = (0..frame.cloud.len() as u32).flat_map(places).filter(|at| at[0] >= offset - 1.0);
        for at in frame.key_points.iter().copied().chain(matched.collect::<Vec<_>>()) {
            plus(&mut canvas, at, 5.5 * scale, 4.0 * scale, BLACK);
            plus(&mut canvas, at, 4.5 * scale, 2.0 * scale, WHITE);
        }
        let fixes: Vec<&TargetRecord> = frame.targets.iter().filter(|row| row.outcome == Outcome::Fix).collect();
        let candidates: BTreeSet<u32> = frame.targets.iter().flat_map(|target| target.candidates.concat()).collect();
        for at in candidates.iter().flat_map(|&cloud| places(cloud)) {
            ring(&mut canvas, at, 10.5 * scale, 3.0 * scale, BLUE);
        }
        for fix in &fixes {
            for (place, pair) in (0_u32..).zip(&fix.pairs) {
                let number = fix.used.iter().position(|used| *used == place);
                for at in places(pair.cloud) {
                    disc(&mut canvas, at, 12.0 * scale, ORANGE);
                    disc(&mut canvas, at, 9.5 * scale, BLACK);
                    if let Some(number) = number {
                        ring(&mut canvas, at, 17.0 * scale, 4.0 * scale, VERMILION);
                        if number < 9 {
                            digit(&mut canvas, at, number + 1, 5.5 * scale, WHITE);
                        }
                    }
                }
            }
        }
        Self {
            canvas,
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
        }
    }

    /// The width and height (px) at a scale.
    pub(crate) fn size(&self, scale: f64) -> [u32; 2] {
        [self.canvas.width, self.canvas.height].map(|side| ((f64::from(side) * scale).round() as u32).max(1))
    }

    /// The JPEG file at a scale and quality.
    pub(crate) fn jpeg(&self, scale: f64, quality: u8) -> Vec<u8> {
        if scale >= 1.0 {
            return self.canvas.jpeg(quality);
        }
        let [width, height] = self.size(scale);
        self.canvas.resized(width, height).jpeg(quality)
    }
}

/// The gates of the model points with candidates, in both images.
///
/// Each has its centre by the prior pose and its half size (px).
fn gates(header: &TrialHeader, frame: &FrameRecord, offset: f64) -> Vec<([f64; 2], [f64; 2])> {
    let (Some(prior), Some(position)) = (&frame.prior, header.prior_position_sigma) else { return Vec::new() };
    let attitude = header.prior_attitude_sigma.unwrap_or(0.0);
    let Some(camera_from_world) = matrix(&prior.world_from_camera).try_inverse() else { return Vec::new() };
    let right_from_left = matrix(&header.rig.right_from_left);
    let mut gates = Vec::new();
    for target in &frame.targets {
        let Some(model) = header.targets.iter().find(|model| model.id == target.object) else { continue };
        let (Some(site), Some(object)) = (header.world_from_site, model.site_from_object) else { continue };
        let camera_from_object = camera_from_world * matrix(&site) * matrix(&object);
        for (point, candidates) in model.points.iter().zip(&target.candidates) {
            if candidates.is_empty() {
                continue;
            }
            let at = camera_from_object.transform_point(&Point3::from(point.at));
            let half = GATE * (position * position + (attitude * at.coords.norm()).powi(2)).sqrt();
            let sides = [(&header.rig.left, Matrix4::identity(), 0.0), (&header.rig.right, right_from_left, offset)];
            for (camera, motion, offset) in sides {
                gates.extend(seen(camera, motion.transform_point(&at), half, offset));
            }
        }
    }
    gates
}

/// The projection of a cube by an undistorted camera: centre and half sizes (px).
fn seen(camera: &CameraRecord, at: Point3<f64>, half: f64, offset: f64) -> Option<([f64; 2], [f64; 2])> {
    let k = camera.matrix;
    let inside = at.z > 2.0 * half.max(0.05);
    inside.then(|| {
        let centre = [k[0][0] * at.x / at.z + k[0][2] + offset, k[1][1] * at.y / at.z + k[1][2]];
        (centre, [k[0][0] * half / at.z, k[1][1] * half / at.z])
    })
}

/// A thumbnail enlarged to the size of the camera's image, so that marks are placed correctly.
fn full(image: &GreyImage, [width, height]: [u32; 2]) -> GreyImage {
    if [image.width, image.height] == [width, height] {
        return image.clone();
    }
    let [from, to] = [[image.width, image.height], [width, height]].map(|size| size.map(|side| side as usize));
    GreyImage { width, height, pixels: canvas::resized(&image.pixels, from, to) }
}

fn copy(canvas: &mut Canvas, image: &GreyImage, offset: u32) {
    for (row, y) in image.pixels.chunks_exact(image.width.max(1) as usize).zip(0..) {
        for (&grey, x) in row.iter().zip(offset..) {
            canvas.set(x, y, [grey; 3]);
        }
    }
}
