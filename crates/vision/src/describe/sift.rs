//! The scale-invariant feature transform's descriptor.

use multiversion::multiversion;
use seafix_component::{Component, in_range};
use serde::{Deserialize, Serialize};

use super::{Descriptor, Descriptors, sample::bilinear};
use crate::{
    Image, Keypoint, Workspace,
    scale_space::{INTERVALS, Octave, ScaleSpace, octaves, sigma},
};

/// Histograms of gradient directions in 4×4 cells of 3σ, 8 directions each, weighted by a Gaussian of
/// two cells and by the gradient's magnitude, each sample shared among the neighbouring cells and
/// directions; norm one, no number above 0.2, norm one again.
///
/// The image is taken under the Gaussian nearest to the key point's scale σ, whatever detector found it,
/// and sampled on a grid that is turned with the key point: 20 × 20 gradients, ¾ σ apart, from
/// differences across the grid's own squares. The direction it is turned by is the greatest of a histogram of the
/// gradient directions around, under a Gaussian of 1.5 σ; a key point with two strong directions keeps
/// the stronger (Lowe would describe it twice). Where nothing changes all numbers are zero.
///
/// Source: Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004; Arandjelović
/// and Zisserman, *Three things everyone should know to improve object retrieval*, CVPR 2012 (`root`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Sift {
    /// Whether the window stays upright, for the two views of one instant, or turns with the image.
    pub upright: bool,
    /// Whether the square roots of the numbers are taken (RootSIFT): their Euclidean distance compares
    /// histograms as Hellinger's distance does.
    pub root: bool,
    /// The σ of every key point (px); 0: each its own.
    pub scale: f64,
}

impl Default for Sift {
    fn default() -> Self {
        Self { upright: true, root: true, scale: 0.0 }
    }
}

impl Component for Sift {
    const NAME: &'static str = "sift";
    const SUMMARY: &'static str = "128 numbers: histograms of gradient directions in 16 cells";
    const SOURCE: &'static str = "Lowe, Distinctive image features from scale-invariant keypoints, IJCV 2004";

    fn check(&self) -> Result<(), String> {
        in_range((0.0..=100.0).contains(&self.scale), "scale", self.scale, "a number from 0 to 100 (px)")
    }
}

/// Cells along a side.
const CELLS: usize = 4;
/// Samples along the side of a cell.
const PER_CELL: usize = 4;
/// Gradients along a side: half a cell more on either side, which the outermost cells share in.
const SIDE: usize = (CELLS + 1) * PER_CELL;
/// Directions.
const DIRECTIONS: usize = 8;
/// Numbers in the descriptor.
const LENGTH: usize = CELLS * CELLS * DIRECTIONS;
/// From gradient to gradient (σ): a cell is 3σ wide.
const STEP: f64 = 3.0 / PER_CELL as f64;
/// The greatest number before the second normalisation.
const MOST: f64 = 0.2;

/// Gradients along the side of the window for the direction: 4.5 σ either way.
const AROUND: usize = 19;
/// From gradient to gradient there (σ).
const AROUND_STEP: f64 = 0.5;
/// Standard deviation of that window (σ).
const AROUND_SIGMA: f64 = 1.5;
/// Bins of its histogram.
const BINS: usize = 36;

/// Key points that one thread describes at a time.
const PIECE: usize = 16;

#[derive(Debug, Default)]
struct Scratch {
    pieces: Vec<()>,
}

impl Descriptor for Sift {
    fn describe_into(&self, image: &Image, keypoints: &[Keypoint], work: &mut Workspace, described: &mut Descriptors) {
        let threads = work.threads();
        let numbers = described.numbers_mut(keypoints.len(), LENGTH);
        if keypoints.is_empty() {
            return;
        }
        let mut space = std::mem::take(work.get::<ScaleSpace>());
        space.look_at(image);
        let coarsest = octaves(image.width(), image.height()) - 1;
        let scale = |keypoint: &Keypoint| if self.scale > 0.0 { self.scale } else { f64::from(keypoint.scale) };
        for keypoint in keypoints {
            let (octave, level) = level(scale(keypoint), coarsest);
            space.octave(octave, level, threads);
        }
        let Scratch { pieces } = work.get();
        let window = Window::new();
        threads.pieces(numbers, PIECE * LENGTH, pieces, |piece, numbers, ()| {
            let here = keypoints[piece * PIECE..].iter();
            for (numbers, keypoint) in numbers.chunks_exact_mut(LENGTH).zip(here) {
                let (octave, level) = level(scale(keypoint), coarsest);
                let place = Place::new(space.made(octave), octave, level, keypoint, scale(keypoint));
                let direction = if self.upright { [1.0, 0.0] } else { place.direction(&window) };
                let numbers: &mut [f32; LENGTH] = numbers.try_into().expect("a row has this length");
                histograms(&place, direction, &window, numbers);
                normalise(numbers, self.root);
            }
        });
        *work.get() = space;
    }
}

/// The octave and the level in it whose Gaussian is nearest to σ.
fn level(scale: f64, coarsest: i32) -> (i32, usize) {
    let intervals = INTERVALS as f64;
    // Level 1 of octave −1 is the first that the detector looks at.
    let finest = sigma(-1, 1.0);
    let index = libm::round(intervals * libm::log2(scale.max(finest) / sigma(0, 0.0)));
    let octave = libm::floor((index - 1.0) / intervals).clamp(-1.0, f64::from(coarsest));
    let level = (index - intervals * octave).clamp(1.0, intervals);
    (octave as i32, level as usize)
}

/// What is the same for all key points.
struct Window {
    /// How much a sample counts for each cell along one axis, the Gaussian included.
    cells: [[f32; CELLS]; SIDE],
    /// The Gaussian of the direction's window along one axis.
    around: [f32; AROUND],
}

impl Window {
    fn new() -> Self {
        let gaussian = |steps: f64, sigma: f64| libm::exp(-0.5 * steps * steps / (sigma * sigma));
        let cells = std::array::from_fn(|i| {
            let steps = i as f64 - 0.5 * (SIDE - 1) as f64;
            let cell = steps / PER_CELL as f64 + 0.5 * (CELLS - 1) as f64;
            let weight = gaussian(steps, (CELLS / 2 * PER_CELL) as f64);
            std::array::from_fn(|c| (weight * (1.0 - (cell - c as f64).abs()).max(0.0)) as f32)
        });
        let around =
            std::array::from_fn(|i| gaussian(i as f64 - 0.5 * (AROUND - 1) as f64, AROUND_SIGMA / AROUND_STEP) as f32);
        Self { cells, around }
    }
}

/// Where a key point lies in its level.
struct Place<'a> {
    pixels: &'a [f32],
    width: usize,
    at: [f32; 2],
    /// σ in pixels of the octave.
    sigma: f64,
}

impl<'a> Place<'a> {
    fn new(levels: &'a Octave, octave: i32, level: usize, keypoint: &Keypoint, scale: f64) -> Self {
        let pixel = libm::exp2(f64::from(octave));
        let at = [keypoint.at.u, keypoint.at.v].map(|x| (x / pixel) as f32);
        Self { pixels: levels.level(level), width: levels.width(), at, sigma: scale.max(0.1) / pixel }
    }

    /// The brightness at the corners of a grid of squares, `step` σ wide and turned to `direction`.
    fn grid<const N: usize>(&self, step: f64, direction: [f32; 2]) -> [[f32; N]; N] {
        let step = (step * self.sigma) as f32;
        let [cos, sin] = direction.map(|part| part * step);
        let middle = 0.5 * (N - 1) as f32;
        std::array::from_fn(|j| {
            let y = j as f32 - middle;
            std::array::from_fn(|i| {
                let x = i as f32 - middle;
                let [u, v] = self.at;
                bilinear(self.pixels, self.width, u + (cos * x - sin * y), v + (sin * x + cos * y))
            })
        })
    }

    /// The direction (cosine, sine) in which most of the brightness around grows.
    fn direction(&self, window: &Window) -> [f32; 2] {
        let corners: [[f32; AROUND + 1]; AROUND + 1] = self.grid(AROUND_STEP, [1.0, 0.0]);
        let mut histogram = [0.0_f32; BINS];
        for (j, pair) in corners.windows(2).enumerate() {
            let (magnitude, turn) = gradients::<{ AROUND + 1 }, AROUND>(&pair[0], &pair[1]);
            for i in 0..AROUND {
                let bin = turn[i] * BINS as f32;
                let low = (bin as usize).min(BINS - 1);
                let (weight, rest) = (magnitude[i] * window.around[i] * window.around[j], bin - low as f32);
                histogram[low] += weight * (1.0 - rest);
                histogram[(low + 1) % BINS] += weight * rest;
            }
        }
        let at = |i: usize| histogram[i % BINS];
        let smooth: [f32; BINS] = std::array::from_fn(|i| {
            let i = i + BINS;
            (at(i - 2) + at(i + 2)) * (1.0 / 16.0) + (at(i - 1) + at(i + 1)) * (4.0 / 16.0) + at(i) * (6.0 / 16.0)
        });
        let peak = (1..BINS).fold(0, |best, i| if smooth[i] > smooth[best] { i } else { best });
        let [left, here, right] = [peak + BINS - 1, peak, peak + 1].map(|i| f64::from(smooth[i % BINS]));
        // The vertex of the parabola through the peak and its neighbours.
        let bend = left - 2.0 * here + right;
        let part = if bend < 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
        let (sin, cos) = libm::sincos((peak as f64 + part) * (std::f64::consts::TAU / BINS as f64));
        [cos as f32, sin as f32]
    }
}

/// Magnitude and direction (in turns, 0 to 1) of the gradients in the squares between two rows of corners.
#[inline(always)]
fn gradients<const C: usize, const N: usize>(upper: &[f32; C], lower: &[f32; C]) -> ([f32; N], [f32; N]) {
    let (mut magnitude, mut turn) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        let (falling, rising) = (lower[i + 1] - upper[i], upper[i + 1] - lower[i]);
        let (x, y) = (falling + rising, falling - rising);
        magnitude[i] = (x * x + y * y).sqrt();
        turn[i] = turn_of(x, y);
    }
    (magnitude, turn)
}

/// The angle of (x, y) in turns, 0 to 1; to 1.3e-5 of a turn, in operations that are exact everywhere.
#[inline(always)]
fn turn_of(x: f32, y: f32) -> f32 {
    let (a, b) = (x.abs(), y.abs());
    let (small, great) = if a < b { (a, b) } else { (b, a) };
    // Of no gradient the angle is zero.
    let t = small / (great + f32::MIN_POSITIVE);
    let s = t * t;
    // atan t / 2π, least greatest error on 0 to 1.
    let eighth = t * (0.159_029_8 + s * (-0.051_116_57 + s * (0.023_278_67 - s * 0.006_204_87)));
    let quarter = if a < b { 0.25 - eighth } else { eighth };
    let half = if x < 0.0 { 0.5 - quarter } else { quarter };
    if y < 0.0 { 1.0 - half } else { half }
}

/// The histograms of all cells, row by row.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn histograms(place: &Place<'_>, direction: [f32; 2], window: &Window, numbers: &mut [f32; LENGTH]) {
    let corners: [[f32; SIDE + 1]; SIDE + 1] = place.grid(STEP, direction);
    let mut cells = [[0.0_f32; DIRECTIONS]; CELLS * CELLS];
    for (pair, down) in corners.windows(2).zip(&window.cells) {
        let (magnitude, turn) = gradients::<{ SIDE + 1 }, SIDE>(&pair[0], &pair[1]);
        let mut row = [[0.0_f32; DIRECTIONS]; CELLS];
        for i in 0..SIDE {
            let direction = turn[i] * DIRECTIONS as f32;
            let mut shares = [0.0; DIRECTIONS];
            for (k, share) in shares.iter_mut().enumerate() {
                // How far the direction is from this one, the shorter way round.
                let away = (direction - k as f32).abs();
                let away = if away > 4.0 { 8.0 - away } else { away };
                let near = 1.0 - away;
                *share = if near > 0.0 { near * magnitude[i] } else { 0.0 };
            }
            for (cell, &across) in row.iter_mut().zip(&window.cells[i]) {
                for (sum, share) in cell.iter_mut().zip(&shares) {
                    *sum += across * share;
                }
            }
        }
        for (cells, &down) in cells.chunks_exact_mut(CELLS).zip(down) {
            for (sum, part) in cells.as_flattened_mut().iter_mut().zip(row.as_flattened()) {
                *sum += down * part;
            }
        }
    }
    numbers.copy_from_slice(cells.as_flattened());
}

/// Norm one, nothing above 0.2, norm one again; then the roots, if asked for.
fn normalise(numbers: &mut [f32; LENGTH], root: bool) {
    let sum = |numbers: &[f32; LENGTH], of: fn(f64) -> f64| numbers.iter().map(|&x| of(f64::from(x))).sum::<f64>();
    let square = |x: f64| x * x;
    let norm = sum(numbers, square).sqrt();
    // Smoothing leaves rounding errors of 1e-5 grey levels where nothing changes.
    if !(norm > 1e-2) {
        numbers.fill(0.0);
        return;
    }
    numbers.iter_mut().for_each(|x| *x = (f64::from(*x) / norm).min(MOST) as f32);
    if root {
        let total = sum(numbers, |x| x);
        numbers.iter_mut().for_each(|x| *x = (f64::from(*x) / total).sqrt() as f32);
    } else {
        let norm = sum(numbers, square).sqrt();
        numbers.iter_mut().for_each(|x| *x = (f64::from(*x) / norm) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detector, Dog, Threads};
    use seafix_geometry::Pixel;

    fn image(width: usize, height: usize, f: impl Fn(f64, f64) -> f64) -> Image {
        let value = |i: usize| f((i % width) as f64, (i / width) as f64) as f32;
        Image::new(width, height, (0..width * height).map(value).collect()).unwrap()
    }

    fn waves(x: f64, y: f64) -> f64 {
        100.0 + 40.0 * libm::sin(0.31 * x + 0.1 * y) + 30.0 * libm::cos(0.23 * y - 0.05 * x * x / 10.0)
    }

    fn at(u: f64, v: f64, scale: f32) -> Keypoint {
        Keypoint { at: Pixel { u, v }, response: 1.0, scale }
    }

    fn distance(a: &Descriptors, i: usize, b: &Descriptors, j: usize) -> f32 {
        let (a, b) = (a.numbers().unwrap().row(i), b.numbers().unwrap().row(j));
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt()
    }

    #[test]
    fn turns_are_those_of_atan2() {
        for i in -1000..=1000 {
            for (x, y) in [(1.0, i as f32 * 0.01), (-1.0, i as f32 * 0.01), (i as f32 * 0.003, 2.0)] {
                let expected = libm::atan2(f64::from(y), f64::from(x)).rem_euclid(std::f64::consts::TAU);
                let away = (f64::from(turn_of(x, y)) - expected / std::f64::consts::TAU).abs();
                assert!(away.min(1.0 - away) < 1.4e-5, "{x}, {y}: {away}");
            }
        }
        assert_eq!(turn_of(0.0, 0.0), 0.0);
    }

    #[test]
    fn the_level_is_the_nearest() {
        assert_eq!(level(2.0, 5), (0, 1));
        assert_eq!(level(1.6, 5), (-1, 3));
        assert_eq!(level(3.3, 5), (0, 3));
        assert_eq!(level(3.9, 5), (1, 1));
        assert_eq!(level(1000.0, 2), (2, 3));
        assert_eq!((level(0.0, 2), level(f64::NAN, 2)), ((-1, 1), (-1, 1)));
    }

    #[test]
    fn a_ramp_has_one_direction() {
        let point = [at(60.0, 50.0, 2.0)];
        let plain = Sift { root: false, ..Sift::default() };
        for (ramp, bin) in [
            (image(120, 100, |x, _| x), 0),
            (image(120, 100, |x, y| x + y), 1),
            (image(120, 100, |_, y| y), 2),
            (image(120, 100, |x, _| 200.0 - x), 4),
        ] {
            let described = plain.describe(&ramp, &point);
            for cell in described.numbers().unwrap().row(0).chunks_exact(DIRECTIONS) {
                for (k, value) in cell.iter().enumerate() {
                    assert!(if k == bin { *value > 0.1 } else { *value < 1e-3 }, "{bin}: {cell:?}");
                }
            }
            // Turned with the image every ramp is the same.
            let turned = Sift { upright: false, root: false, ..Sift::default() }.describe(&ramp, &point);
            let first = turned.numbers().unwrap().row(0).chunks_exact(DIRECTIONS).all(|cell| cell[0] > 0.1);
            assert!(first, "{bin}");
        }
    }

    #[test]
    fn the_norm_is_one_or_nothing_changes() {
        let points = [at(40.0, 30.0, 2.0), at(0.0, 0.0, 0.0), at(79.0, 59.0, 30.0), at(12.3, 45.6, 1.1)];
        for sift in [Sift::default(), Sift { root: false, upright: false, scale: 0.0 }] {
            let described = sift.describe(&image(80, 60, waves), &points);
            for i in 0..points.len() {
                let norm = described.numbers().unwrap().row(i).iter().map(|x| x * x).sum::<f32>();
                assert!((norm - 1.0).abs() < 1e-5, "{i}: {norm}");
            }
            let flat = sift.describe(&image(80, 60, |_, _| 137.3), &points);
            assert!(flat.numbers().unwrap().values().iter().all(|x| *x == 0.0));
        }
    }

    #[test]
    fn light_and_contrast_drop_out() {
        let points = [at(40.2, 30.7, 2.0), at(3.0, 2.0, 3.0)];
        for sift in [Sift::default(), Sift { upright: false, ..Sift::default() }] {
            let a = sift.describe(&image(80, 60, waves), &points);
            let b = sift.describe(&image(80, 60, |x, y| 0.5 * waves(x, y) + 64.0), &points);
            assert!((0..2).all(|i| distance(&a, i, &b, i) < 1e-3));
        }
    }

    #[test]
    fn a_turn_of_the_image_turns_the_window() {
        let before = image(140, 140, waves);
        // By 30° about the middle.
        let (cos, sin) = (0.75_f64.sqrt(), 0.5);
        let to =
            |x: f64, y: f64| (70.0 + cos * (x - 70.0) - sin * (y - 70.0), 70.0 + sin * (x - 70.0) + cos * (y - 70.0));
        let after = image(140, 140, |x, y| {
            let (x, y) = to(x, y);
            waves(x, y)
        });
        let sift = Sift { upright: false, ..Sift::default() };
        for (u, v) in [(70.0, 70.0), (60.3, 75.8), (84.0, 66.5)] {
            let (x, y) = to(u, v);
            let (a, b) = (sift.describe(&before, &[at(x, y, 2.5)]), sift.describe(&after, &[at(u, v, 2.5)]));
            assert!(distance(&a, 0, &b, 0) < 0.12, "{}", distance(&a, 0, &b, 0));
            let (a, b) = (
                Sift::default().describe(&before, &[at(x, y, 2.5)]),
                Sift::default().describe(&after, &[at(u, v, 2.5)]),
            );
            assert!(distance(&a, 0, &b, 0) > 0.3);
        }
    }

    #[test]
    fn threads_memory_and_what_the_detector_left_change_nothing() {
        let images = [image(150, 120, waves), image(90, 140, |x, y| waves(y, x))];
        let sift = Sift { upright: false, ..Sift::default() };
        let (mut found, mut described) = (Vec::new(), Descriptors::default());
        for mut work in [Workspace::new(Threads::One), Workspace::new(Threads::Pool)] {
            for image in images.iter().chain(&images) {
                Dog { contrast: 0.5, ..Dog::default() }.detect_into(image, &mut work, &mut found);
                found.extend((0..40).map(|i| at(f64::from(i) * 2.7, f64::from(i), 1.0 + i as f32 * 0.2)));
                sift.describe_into(image, &found, &mut work, &mut described);
                assert_eq!(described, sift.describe(image, &found));
            }
        }
        assert!(sift.describe(&images[0], &[]).is_empty());
        let one = Image::new(1, 1, vec![3.0]).unwrap();
        assert_eq!(sift.describe(&one, &[at(0.0, 0.0, 2.0)]).len(), 1);
    }
}
