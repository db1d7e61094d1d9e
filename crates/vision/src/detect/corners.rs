//! Corner detection by the structure tensor, shared by Harris' and Shi and Tomasi's detectors.

use std::ops::{Range, RangeInclusive};

use seafix_component::in_range;
use seafix_geometry::Pixel;

use super::{
    peaks::{Disc, in_rows, to_vertex},
    select::{self, Budget},
    tensor::{Stream, Tensor, Weights},
};
use crate::{
    image::Image,
    keypoint::Keypoint,
    workspace::{Threads, Workspace},
};

/// The maxima of a structure tensor's response, with subpixel positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corners {
    pub(super) tensor: Tensor,
    /// The minimum response, relative to the strongest of the image.
    pub(super) quality: f64,
    /// The radius (px) of non-maximum suppression.
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

/// The working memory of a band of rows, with its corners.
#[derive(Debug, Default)]
struct Band {
    stream: Stream,
    /// The response of a few rows, which stay in the second-level cache until their corners are found.
    response: Vec<f32>,
    marks: Vec<u8>,
    /// The corners at integer pixels in row-major order, with the offsets to the vertices of the response.
    found: Vec<(Keypoint, [f64; 2])>,
}

/// The range of the window's standard deviation (px); a narrower window holds one gradient alone.
pub(super) const SIGMAS: RangeInclusive<f64> = 0.3..=100.0;
/// The largest radius (px): beyond it an image has a handful of corners, and the disc takes memory and time.
pub(super) const MAX_RADIUS: usize = 1000;
/// The number of rows that are searched at a time.
const ROWS: usize = 32;

impl Corners {
    /// Checks the settings' ranges.
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
        // Few bands, since each repeats rows of the one before.
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
            // Bands follow each other, and each holds its corners in order.
            let before = |other: &Keypoint| (other.at.v, other.at.u) < (corner.at.v, corner.at.u);
            let reaches = |band: &&Band| band.found.last().is_some_and(|(last, _)| !before(last));
            let of_band = &bands.iter().find(reaches).expect("every corner belongs to a band").found;
            let [dx, dy] = of_band[of_band.partition_point(|(other, _)| before(other))].1;
            corner.at.u += dx;
            corner.at.v += dy;
            corner.scale = self.tensor.sigma as f32;
        }
    }

    /// The minimum response for this strongest response.
    fn min(&self, strongest: f32) -> f32 {
        (f64::from(strongest) * self.quality) as f32
    }
}

impl Band {
    /// Finds the corners in some rows, except those below the threshold of the band's strongest response so far.
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
        // The rows above and below that affect a corner.
        let around = radius.max(1);
        found.clear();
        stream.begin();
        // The image rows in `response`.
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
