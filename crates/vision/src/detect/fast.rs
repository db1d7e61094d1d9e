//! The FAST detector: features from the accelerated segment test.

use multiversion::multiversion;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    corners::MAX_RADIUS,
    detector::Detector,
    peaks::{self, Peaks},
    select::{self, Budget, Selection},
};
use crate::{image::Image, keypoint::Keypoint, workspace::Workspace};

/// FAST-9/16: pixels that differ from an arc of the circle around them.
///
/// A pixel is a corner if 9 consecutive ones of the 16 pixels on a circle of radius 3 px are all brighter than the
/// centre by more than the threshold, or all darker. The response is the largest threshold that the pixel passes (grey
/// levels): the maximum over the 16 arcs of the minimum difference on the arc. The corner is the vertex of the
/// quadratic through the nine responses around a maximum, if they have one.
///
/// Limit: nothing is detected within 4 px of the border. Each value is a difference of two pixels, so a quarter turn of
/// the image turns the corners exactly.
///
/// Source: Rosten and Drummond, *Machine learning for high-speed corner detection*, ECCV 2006.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Fast {
    /// Minimum difference between the arc and the centre (grey levels).
    pub threshold: f64,
    /// Whether corners have subpixel positions.
    pub subpixel: bool,
    /// Radius of non-maximum suppression (px).
    pub radius: usize,
    /// Maximum number of corners.
    pub features: usize,
    /// Selection of corners beyond that number.
    pub selection: Selection,
    /// Number of cells along the longer side of the image, for a balanced selection.
    pub cells: usize,
}

impl Default for Fast {
    fn default() -> Self {
        Self { threshold: 20.0, subpixel: true, radius: 4, features: 1000, selection: Selection::Balanced, cells: 8 }
    }
}

impl Component for Fast {
    const NAME: &'static str = "fast";
    const SUMMARY: &'static str = "corners by the accelerated segment test, 9 of 16, spread over the image";
    const SOURCE: &'static str = "Rosten and Drummond, Machine learning for high-speed corner detection, ECCV 2006";

    fn check(&self) -> Result<(), String> {
        let Self { threshold, subpixel: _, radius, features, selection: _, cells } = *self;
        in_range((0.0..=65535.0).contains(&threshold), "threshold", threshold, "0 to 65535 (grey levels)")?;
        in_range(radius <= MAX_RADIUS, "radius", radius, "at most 1000 (px)")?;
        in_range(features > 0, "features", features, "at least 1")?;
        in_range(cells > 0, "cells", cells, "at least 1")
    }
}

/// The circle (dx, dy), clockwise from the top.
const CIRCLE: [(isize, isize); 16] = [
    (0, -3),
    (1, -3),
    (2, -2),
    (3, -1),
    (3, 0),
    (3, 1),
    (2, 2),
    (1, 3),
    (0, 3),
    (-1, 3),
    (-2, 2),
    (-3, 1),
    (-3, 0),
    (-3, -1),
    (-2, -2),
    (-1, -3),
];

/// The radius of the circle, and one pixel for the neighbours of the subpixel fit.
const MARGIN: usize = 4;

/// The standard deviation of a disc of radius 3 px along either axis (px).
const SCALE: f32 = 1.5;

#[derive(Debug, Default)]
struct Scratch {
    response: Vec<f32>,
    unused: Vec<()>,
    peaks: peaks::Scratch,
    selection: select::Scratch,
}

impl Detector for Fast {
    fn detect_into(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        let threads = work.threads();
        let (width, height) = (image.width(), image.height());
        let Scratch { response, unused, peaks, selection } = work.get::<Scratch>();
        found.clear();
        if width.min(height) <= 2 * MARGIN {
            return;
        }
        response.resize(width * height, 0.0);
        let min = self.threshold as f32;
        let rows = threads.rows_a_band(height);
        threads.pieces(response, rows * width, unused, |index, band, ()| {
            for (y, out) in (index * rows..).zip(band.chunks_exact_mut(width)) {
                out.fill(0.0);
                if y >= MARGIN && y < height - MARGIN {
                    let rows = std::array::from_fn(|i| image.row(y + i - 3));
                    row_response(&rows, min, out);
                }
            }
        });
        Peaks { min: 0.0, radius: self.radius }.find(response, width, threads, peaks, found);
        let budget = Budget { features: self.features, selection: self.selection, cells: self.cells };
        budget.keep(found, [width, height], selection);
        for corner in found {
            corner.scale = SCALE;
            if self.subpixel {
                let (x, y) = (corner.at.u as usize, corner.at.v as usize);
                let row = |y: usize| std::array::from_fn(|i| response_at(image, x + i - 1, y));
                let [dx, dy] = peaks::vertex([row(y - 1), row(y), row(y + 1)]);
                corner.at.u += dx;
                corner.at.v += dy;
            }
        }
    }
}

/// The response at a pixel, which is at least the circle's radius from the border.
fn response_at(image: &Image, x: usize, y: usize) -> f32 {
    let pixel = |(dx, dy)| image.row(y.wrapping_add_signed(dy))[x.wrapping_add_signed(dx)];
    response(CIRCLE.map(|step| pixel(step) - pixel((0, 0))))
}

#[inline(always)]
fn less(a: f32, b: f32) -> f32 {
    if a < b { a } else { b } // a single instruction, unlike f32::min
}

#[inline(always)]
fn more(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The largest threshold that the differences d of some arc of nine all exceed, with either sign.
#[inline(always)]
fn response(d: [f32; 16]) -> f32 {
    // Two neighbouring arcs share eight pixels: those from each odd position.
    let shared = |pick: fn(f32, f32) -> f32| -> [f32; 8] {
        let two: [f32; 8] = std::array::from_fn(|i| pick(d[2 * i + 1], d[(2 * i + 2) % 16]));
        let four: [f32; 8] = std::array::from_fn(|i| pick(two[i], two[(i + 1) % 8]));
        std::array::from_fn(|i| pick(four[i], four[(i + 2) % 8]))
    };
    let (min, greatest) = (shared(less), shared(more));
    let (mut bright, mut dark) = (f32::NEG_INFINITY, f32::INFINITY);
    for i in 0..8 {
        let (before, after) = (d[2 * i], d[(2 * i + 9) % 16]);
        bright = more(bright, less(min[i], more(before, after)));
        dark = less(dark, more(greatest[i], less(before, after)));
    }
    more(bright, -dark)
}

/// The number of pixels of a row that are tested together.
const BLOCK: usize = 32;

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn row_response(rows: &[&[f32]; 7], min: f32, out: &mut [f32]) {
    row_response_in_any_lanes(rows, min, out);
}

/// Writes the responses above `min` of the middle one of seven rows; other values stay.
#[inline(always)]
fn row_response_in_any_lanes(rows: &[&[f32]; 7], min: f32, out: &mut [f32]) {
    let end = out.len() - MARGIN;
    let from = |left: usize, (dx, dy): (isize, isize)| &rows[(dy + 3) as usize][left.wrapping_add_signed(dx)..];
    if end - MARGIN < BLOCK {
        for x in MARGIN..end {
            let r = response(CIRCLE.map(|step| from(x, step)[0] - rows[3][x]));
            out[x] = if r > min { r } else { 0.0 };
        }
        return;
    }
    // The last block ends with the row and overlaps the block before.
    for left in (MARGIN..end).step_by(BLOCK).map(|left| left.min(end - BLOCK)) {
        let block = |step| -> &[f32; BLOCK] { from(left, step).first_chunk().expect("within the row") };
        let centre = block((0, 0));
        if passes(centre, [0, 4, 8, 12].map(|i| block(CIRCLE[i])), min) {
            let circle = CIRCLE.map(block);
            for (x, out) in out[left..left + BLOCK].iter_mut().enumerate() {
                let r = response(circle.map(|pixels| pixels[x] - centre[x]));
                *out = if r > min { r } else { 0.0 };
            }
        }
    }
}

/// Whether any pixel may pass the test: an arc of nine holds two neighbouring compass points.
#[inline(always)]
fn passes(centre: &[f32; BLOCK], [n, e, s, w]: [&[f32; BLOCK]; 4], min: f32) -> bool {
    let mut any = [0_u32; BLOCK];
    for x in 0..BLOCK {
        let c = centre[x];
        let (n, e, s, w) = (n[x] - c, e[x] - c, s[x] - c, w[x] - c);
        // Two neighbours are one of north and south, and one of east and west.
        let bright = less(more(n, s), more(e, w));
        let dark = more(less(n, s), less(e, w));
        any[x] = u32::from((bright > min) | (-dark > min));
    }
    any.iter().fold(0, |all, one| all | one) != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_values(n: usize) -> Vec<f32> {
        let value = |i: usize| {
            let h = (i as u32).wrapping_mul(0x9E37_79B1);
            ((h ^ (h >> 15)).wrapping_mul(0x85EB_CA77) >> 24) as f32
        };
        (0..n).map(value).collect()
    }

    /// The test as the paper defines it.
    fn is_corner(d: &[f32; 16], threshold: f32) -> bool {
        (0..16).any(|first| {
            let arc = || (first..first + 9).map(|i| d[i % 16]);
            arc().all(|d| d > threshold) || arc().all(|d| d < -threshold)
        })
    }

    #[test]
    fn the_response_is_the_greatest_threshold_that_passes() {
        let bright = std::array::from_fn(|i| if (3..12).contains(&i) { 30.0 + i as f32 } else { -5.0 });
        assert_eq!(response(bright), 33.0);
        assert_eq!(response(bright.map(|d| -d)), 33.0);
        assert!(response(std::array::from_fn(|i| if i < 8 { 50.0 } else { 0.0 })) <= 0.0, "an arc of eight passes");
        for start in 0..16 {
            let arc: [f32; 16] = std::array::from_fn(|i| if (i + start) % 16 < 9 { 10.0 } else { 0.0 });
            assert_eq!(response(arc), 10.0, "an arc of nine fails");
        }
        for d in random_values(16 * 500).as_chunks::<16>().0 {
            let d = d.map(|d| d - 128.0);
            let r = response(d);
            assert!(!is_corner(&d, r.max(0.0)));
            assert!(r <= 0.0 || is_corner(&d, r - 0.5));
        }
    }

    #[test]
    fn every_instruction_set_and_block_gives_the_response_of_the_pixel() {
        for width in [9, 20, 39, 40, 41, 150] {
            let image = Image::new(width, 7, random_values(7 * width)).unwrap();
            let rows = std::array::from_fn(|y| image.row(y));
            let (mut any, mut plain) = (vec![0.0; width], vec![0.0; width]);
            row_response(&rows, 12.0, &mut any);
            row_response_in_any_lanes(&rows, 12.0, &mut plain);
            let expected = |x: usize| {
                let inner = x >= MARGIN && x < width - MARGIN;
                if inner { Some(response_at(&image, x, 3)).filter(|r| *r > 12.0).unwrap_or(0.0) } else { 0.0 }
            };
            let expected: Vec<_> = (0..width).map(expected).collect();
            assert_eq!(any, expected);
            assert_eq!(plain, expected);
        }
    }

    #[test]
    fn the_corner_of_a_box_is_found() {
        let pixel = |i: usize| if i % 30 >= 15 && i / 30 >= 12 { 200.0 } else { 50.0 };
        let image = Image::new(30, 30, (0..900).map(pixel).collect()).unwrap();
        let found = Fast::default().detect(&image);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].at.u - 15.0).abs() <= 1.0 && (found[0].at.v - 12.0).abs() <= 1.0, "{found:?}");
        assert_eq!(found[0].response, 150.0);
        assert_eq!(Fast { threshold: 151.0, ..Fast::default() }.detect(&image), []);
    }
}
