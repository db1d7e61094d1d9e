//! Corners by the structure tensor: what the detectors that rest on it share.

use std::ops::{Range, RangeInclusive};

use seafix_component::in_range;
use seafix_geometry::Pixel;

use super::{
    Keypoint,
    peaks::{Disc, in_rows, to_vertex},
    select,
    select::Budget,
    tensor::{Stream, Tensor, Weights},
};
use crate::{Image, Threads, Workspace};

/// The greatest responses of a structure tensor, to a fraction of a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corners {
    pub(super) tensor: Tensor,
    /// The weakest response worth keeping, relative to the strongest of the image.
    pub(super) quality: f64,
    /// No corner has a stronger one within this distance (px).
    pub(super) radius: usize,
    pub(super) budget: Budget,
}

#[derive(Debug, Default)]
struct Scratch {
    weights: Option<Weights>,
    disc: Disc,
    bands: Vec<Band>,
    selection: select::Scratch,
}

/// The memory of a band of rows, and the corners in it.
#[derive(Debug, Default)]
struct Band {
    stream: Stream,
    /// The response at a few rows: they stay in the second-level cache until their corners are found.
    response: Vec<f32>,
    marks: Vec<u8>,
    /// At whole pixels, row by row, and from there to where the response peaks.
    found: Vec<(Keypoint, [f64; 2])>,
}

/// A window narrower than a pixel's neighbours holds one gradient, which is no corner's.
pub(super) const SIGMAS: RangeInclusive<f64> = 0.3..=100.0;
/// Corners this far apart are a handful in an image; the disc around each takes memory and time.
pub(super) const MAX_RADIUS: usize = 1000;
/// Rows whose corners are sought at a time.
const ROWS: usize = 32;

impl Corners {
    /// Whether the settings can be.
    pub(super) fn check(&self) -> Result<(), String> {
        let Self { tensor: Tensor { sigma, .. }, quality, radius, budget: Budget { features, cells, .. } } = *self;
        in_range(SIGMAS.contains(&sigma), "sigma", sigma, "a number from 0.3 to 100 (px)")?;
        in_range(radius <= MAX_RADIUS, "radius", radius, "at most 1000 (px)")?;
        in_range((0.0..=1.0).contains(&quality), "quality", quality, "a number from 0 to 1")?;
        in_range(features > 0, "features", features, "at least 1")?;
        in_range(cells > 0, "cells", cells, "at least 1")
    }

    /// Replaces `found` by the corners, strongest first.
    pub(super) fn find(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        let threads = work.threads();
        let (width, height) = (image.width(), image.height());
        let Scratch { weights, disc, bands, selection } = work.get::<Scratch>();
        found.clear();
        let Some(weights) = self.tensor.weights(image, weights) else { return };
        let radius = self.radius.min(width.max(height));
        disc.set(radius);
        // Few bands: each begins with rows that belong to the one before.
        let rows = match threads {
            Threads::One => height,
            Threads::Pool => height.div_ceil(2 * rayon::current_num_threads()).max(ROWS),
        };
        let count = (height - 2).div_ceil(rows);
        bands.resize_with(count.max(bands.len()), Band::default);
        threads.pieces(&mut bands[..count], 1, &mut Vec::<()>::new(), |index, band, ()| {
            let rows = 1 + index * rows..(1 + (index + 1) * rows).min(height - 1);
            band[0].search(self, image, weights, (radius, disc), rows);
        });
        let bands = &bands[..count];
        let strongest = bands.iter().map(|band| band.stream.strongest).fold(0.0, f32::max);
        let min = self.min(strongest);
        let all = || bands.iter().flat_map(|band| &band.found);
        found.extend(all().map(|(corner, _)| *corner).filter(|corner| corner.response >= min));
        self.budget.keep(found, [width, height], selection);
        for corner in found {
            // Bands follow each other, and in each the corners are in order.
            let before = |other: &Keypoint| (other.at.v, other.at.u) < (corner.at.v, corner.at.u);
            let reaches = |band: &&Band| band.found.last().is_some_and(|(last, _)| !before(last));
            let of_band = &bands.iter().find(reaches).expect("every corner is one of a band's").found;
            let [dx, dy] = of_band[of_band.partition_point(|(other, _)| before(other))].1;
            corner.at.u += dx;
            corner.at.v += dy;
            corner.scale = self.tensor.sigma as f32;
        }
    }

    /// The weakest response worth keeping where this is the strongest.
    fn min(&self, strongest: f32) -> f32 {
        (f64::from(strongest) * self.quality) as f32
    }
}

impl Band {
    /// Finds the corners in some rows, but for those that are too weak already beside the strongest of the band so far.
    fn search(
        &mut self,
        corners: &Corners,
        image: &Image,
        weights: &Weights,
        (radius, disc): (usize, &Disc),
        rows: Range<usize>,
    ) {
        let Self { stream, response, marks, found } = self;
        let (width, height) = (image.width(), image.height());
        // Rows above and below that decide about a corner.
        let around = radius.max(1);
        found.clear();
        stream.begin();
        // The rows of the image that `response` holds.
        let mut held = 0..0;
        for first in rows.clone().step_by(ROWS) {
            let last = (first + ROWS).min(rows.end);
            let needed = first.saturating_sub(around)..(last + around).min(height);
            let kept = needed.start.max(held.start)..held.end.max(needed.start);
            if !kept.is_empty() {
                response.copy_within((kept.start - held.start) * width..(kept.end - held.start) * width, 0);
            }
            response.resize(needed.len() * width, 0.0);
            stream.fill(image, &corners.tensor, weights, kept.end, &mut response[kept.len() * width..]);
            held = needed;
            let min = corners.min(stream.strongest);
            let (response, rows) = (&**response, first - held.start..last - held.start);
            in_rows(response, width, rows, min, disc, marks, |x, y| {
                let at = Pixel { u: x as f64, v: (held.start + y) as f64 };
                let corner = Keypoint { at, response: response[y * width + x], scale: 0.0 };
                found.push((corner, to_vertex(response, width, [x, y])));
            });
        }
    }
}
