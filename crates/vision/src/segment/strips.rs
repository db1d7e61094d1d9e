//! The grey levels beside segments.

use nalgebra::Vector2;
use seafix_geometry::{Camera, Pinhole, Point};

use super::{fit::FittedSegment, overlap::between};
use crate::image::Image;

/// The distances from the edge (px) at which its flanks are sampled; nearer the blur of the edge reaches.
const OUT: [f64; 4] = [2.5, 4.0, 5.5, 7.0];
/// The number of bands on a flank.
pub(super) const BANDS: usize = OUT.len();
/// The distance between samples along the edge (px).
const STEP: f64 = 2.0;

/// The levels on both flanks of each segment of an image, at equal steps along it.
#[derive(Debug, Default)]
pub(super) struct Strips {
    levels: Vec<[[f32; OUT.len()]; 2]>,
    /// The first sample of each segment, and the end.
    starts: Vec<usize>,
}

/// The likeness of one flank of two segments.
#[derive(Debug, Clone, Copy)]
pub(super) struct Likeness {
    /// The mean absolute difference (grey levels).
    pub(super) difference: f64,
    /// The zero-normalised cross-correlation.
    pub(super) correlation: f64,
    /// The standard deviation of the levels, the smaller of both (grey levels).
    pub(super) deviation: f64,
}

impl Strips {
    /// Replaces the strips by those of `segments`.
    pub(super) fn fill(&mut self, image: &Image, camera: &Pinhole, segments: &[FittedSegment]) {
        self.levels.clear();
        self.starts.clear();
        for segment in segments {
            self.starts.push(self.levels.len());
            let count = (segment.length / STEP).ceil().max(2.0) as usize;
            for i in 0..=count {
                let s = i as f64 / count as f64;
                let direction = between(&segment.ends, s);
                // The normal turns with the lens; between the half-points it changes evenly.
                let normal = (segment.offsets[0].normal * (1.0 - s) + segment.offsets[1].normal * s).normalize();
                let at = camera.project(&Point::<Camera>::new(direction.x, direction.y, 1.0));
                let sample = |side: f64, out: f64| {
                    at.map_or(0.0, |at| bilinear(image, Vector2::new(at.u, at.v) + normal * (side * out)))
                };
                self.levels.push([-1.0, 1.0].map(|side| OUT.map(|out| sample(side, out))));
            }
        }
        self.starts.push(self.levels.len());
    }

    /// The mean and the standard deviation of each band of a flank of a segment.
    pub(super) fn bands(&self, segment: usize, flank: usize) -> [(f64, f64); BANDS] {
        let all = &self.levels[self.starts[segment]..self.starts[segment + 1]];
        std::array::from_fn(|band| {
            let levels = all.iter().map(|sample| f64::from(sample[flank][band]));
            let (sum, squares) = levels.fold((0.0, 0.0), |(sum, squares), x| (sum + x, squares + x * x));
            let mean = sum / all.len() as f64;
            (mean, (squares / all.len() as f64 - mean * mean).max(0.0).sqrt())
        })
    }

    /// The levels of a flank at the position s of a segment.
    fn at(&self, segment: usize, s: f64, flank: usize) -> [f32; OUT.len()] {
        let (start, end) = (self.starts[segment], self.starts[segment + 1]);
        let place = s.clamp(0.0, 1.0) * (end - start - 1) as f64;
        let index = (place as usize).min(end - start - 2);
        let part = (place - index as f64) as f32;
        let (a, b) = (&self.levels[start + index][flank], &self.levels[start + index + 1][flank]);
        std::array::from_fn(|i| a[i] + part * (b[i] - a[i]))
    }
}

/// The likeness of both flanks over corresponding parts of two segments.
pub(super) fn likeness(
    [left, right]: [&Strips; 2],
    [i, j]: [usize; 2],
    [on_left, on_right]: [[f64; 2]; 2],
) -> [Likeness; 2] {
    const SAMPLES: usize = 16;
    [0, 1].map(|flank| {
        let (mut n, mut difference) = (0.0, 0.0);
        let [mut x, mut y, mut xx, mut xy, mut yy] = [0.0_f64; 5];
        for k in 0..SAMPLES {
            let s = (k as f64 + 0.5) / SAMPLES as f64;
            let a = left.at(i, on_left[0] + s * (on_left[1] - on_left[0]), flank);
            let b = right.at(j, on_right[0] + s * (on_right[1] - on_right[0]), flank);
            for (a, b) in a.into_iter().zip(b) {
                let (a, b) = (f64::from(a), f64::from(b));
                n += 1.0;
                difference += (a - b).abs();
                x += a;
                y += b;
                xx += a * a;
                xy += a * b;
                yy += b * b;
            }
        }
        let (vx, vy) = ((xx - x * x / n).max(0.0), (yy - y * y / n).max(0.0));
        let correlation = if vx * vy > 0.0 { (xy - x * y / n) / (vx * vy).sqrt() } else { 0.0 };
        Likeness { difference: difference / n, correlation, deviation: (vx.min(vy) / n).sqrt() }
    })
}

/// The level at a place, by bilinear interpolation; the border repeats beyond it.
fn bilinear(image: &Image, at: Vector2<f64>) -> f32 {
    let clamp = |x: f64, n: usize| x.clamp(0.0, (n - 1) as f64);
    let (x, y) = (clamp(at.x, image.width()), clamp(at.y, image.height()));
    let (column, row) = (x as usize, y as usize);
    let (s, t) = ((x - column as f64) as f32, (y - row as f64) as f32);
    let (above, below) = (image.row(row), image.row((row + 1).min(image.height() - 1)));
    let next = (column + 1).min(image.width() - 1);
    let along = |row: &[f32]| row[column] + s * (row[next] - row[column]);
    let (a, b) = (along(above), along(below));
    a + t * (b - a)
}
