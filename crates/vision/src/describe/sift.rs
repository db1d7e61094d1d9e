//! The SIFT descriptor.

use multiversion::multiversion;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    descriptor::{Descriptor, Descriptors},
    gradients::{CELLS, DIRECTIONS, LevelPosition, SIDE, STEP, Window, gradients},
};
use crate::{
    detect::Keypoint,
    image::Image,
    scale_space::{INTERVALS, ScaleSpace, Strip, octaves, sigma},
    workspace::Workspace,
};

/// SIFT's descriptor: histograms of 8 gradient directions in 4×4 cells of 3σ.
///
/// Samples are weighted by the gradient's magnitude and a Gaussian of two cells, and shared among neighbouring cells
/// and directions. The vector is scaled to norm one, clipped at 0.2 and scaled to norm one again.
///
/// The image is smoothed by the Gaussian nearest to the key point's scale σ, whatever its detector, and sampled on a
/// rotated grid: 20 × 20 gradients, ¾ σ apart, from differences across the grid's own squares. The rotation is the peak
/// of a histogram of the gradient directions around the key point, under a Gaussian of 1.5 σ.
///
/// Limits: a key point with two strong directions keeps the stronger (Lowe would describe it twice). All numbers are
/// zero in a flat region.
///
/// Source: Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004; Arandjelović and Zisserman,
/// *Three things everyone should know to improve object retrieval*, CVPR 2012 (`root`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Sift {
    /// Whether the window is upright, for the two views of one instant, or rotated with the image.
    pub upright: bool,
    /// Whether to take the square roots of the numbers (RootSIFT).
    ///
    /// The Euclidean distance then equals the Hellinger distance of the histograms.
    pub root: bool,
    /// Scale σ of every key point (px); 0: the key point's own.
    pub scale: f64,
}

impl Default for Sift {
    fn default() -> Self {
        Self { upright: true, root: true, scale: 0.0 }
    }
}

impl Component for Sift {
    const NAME: &'static str = "sift";
    const SUMMARY: &'static str = "SIFT: histograms of gradient directions in 16 cells, 128 numbers";
    const SOURCE: &'static str = "Lowe, Distinctive image features from scale-invariant keypoints, IJCV 2004";

    fn check(&self) -> Result<(), String> {
        in_range((0.0..=100.0).contains(&self.scale), "scale", self.scale, "a number from 0 to 100 (px)")
    }
}

/// The length of the descriptor.
const LENGTH: usize = CELLS * CELLS * DIRECTIONS;
/// The largest number before the second normalisation.
const MAX: f64 = 0.2;

/// The number of key points in a piece of the work.
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
        let height = |octave: i32| if octave < 0 { 2 * image.height() } else { image.height().div_ceil(1 << octave) };
        let scale = |keypoint: &Keypoint| if self.scale > 0.0 { self.scale } else { f64::from(keypoint.scale) };
        let Scratch { pieces } = work.get();
        let window = Window::new();
        for octave in -1..=coarsest {
            let levels = keypoints.iter().map(|keypoint| level(scale(keypoint), coarsest));
            let Some(highest) = levels.filter(|(other, _)| *other == octave).map(|(_, level)| level).max() else {
                continue;
            };
            let pixel = libm::exp2(f64::from(octave));
            space.sweep(octave, highest, threads, |levels, Strip { rows, first }| {
                threads.pieces(numbers, PIECE * LENGTH, pieces, |piece, numbers, ()| {
                    let here = keypoints[piece * PIECE..].iter();
                    for (numbers, keypoint) in numbers.chunks_exact_mut(LENGTH).zip(here) {
                        let (own, level) = level(scale(keypoint), coarsest);
                        // Key points beyond the image belong to its border rows.
                        let row = ((keypoint.at.v / pixel).max(0.0) as usize).min(height(octave) - 1);
                        if own != octave || !rows.contains(&row) {
                            continue;
                        }
                        let place = LevelPosition::new(levels, (octave, first), level, keypoint, scale(keypoint));
                        let direction = if self.upright { [1.0, 0.0] } else { place.direction(&window) };
                        let numbers: &mut [f32; LENGTH] = numbers.try_into().expect("a row has LENGTH numbers");
                        histograms(&place, direction, &window, numbers);
                        normalise(numbers, self.root);
                    }
                });
            });
        }
        *work.get() = space;
    }
}

/// The octave and the level in it whose Gaussian is nearest to σ.
fn level(scale: f64, coarsest: i32) -> (i32, usize) {
    let intervals = INTERVALS as f64;
    // Level 1 of octave −1 is the first that the detector searches.
    let finest = sigma(-1, 1.0);
    let index = libm::round(intervals * libm::log2(scale.max(finest) / sigma(0, 0.0)));
    let octave = libm::floor((index - 1.0) / intervals).clamp(-1.0, f64::from(coarsest));
    let level = (index - intervals * octave).clamp(1.0, intervals);
    (octave as i32, level as usize)
}

/// Computes the histograms of all cells, row by row.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn histograms(place: &LevelPosition<'_>, direction: [f32; 2], window: &Window, numbers: &mut [f32; LENGTH]) {
    let corners: [[f32; SIDE + 1]; SIDE + 1] = place.grid(STEP, direction);
    let mut cells = [[0.0_f32; DIRECTIONS]; CELLS * CELLS];
    for (pair, down) in corners.windows(2).zip(&window.cells) {
        let (magnitude, turn) = gradients::<{ SIDE + 1 }, SIDE>(&pair[0], &pair[1]);
        let mut row = [[0.0_f32; DIRECTIONS]; CELLS];
        for i in 0..SIDE {
            let direction = turn[i] * DIRECTIONS as f32;
            let mut fractions = [0.0; DIRECTIONS];
            for (k, fraction) in fractions.iter_mut().enumerate() {
                // The angular distance from this direction, the shorter of both.
                let away = (direction - k as f32).abs();
                let away = if away > 4.0 { 8.0 - away } else { away };
                let near = 1.0 - away;
                *fraction = if near > 0.0 { near * magnitude[i] } else { 0.0 };
            }
            for (cell, &across) in row.iter_mut().zip(&window.cells[i]) {
                for (sum, fraction) in cell.iter_mut().zip(&fractions) {
                    *sum += across * fraction;
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

/// Scales to norm one, clips at 0.2, scales to norm one again, and takes the roots with `root`.
fn normalise(numbers: &mut [f32; LENGTH], root: bool) {
    let sum = |numbers: &[f32; LENGTH], of: fn(f64) -> f64| numbers.iter().map(|&x| of(f64::from(x))).sum::<f64>();
    let square = |x: f64| x * x;
    let norm = sum(numbers, square).sqrt();
    // Smoothing leaves rounding errors of 1e-5 grey levels in flat regions.
    if !(norm > 1e-2) {
        numbers.fill(0.0);
        return;
    }
    numbers.iter_mut().for_each(|x| *x = (f64::from(*x) / norm).min(MAX) as f32);
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
    use crate::{
        detect::{Detector, Dog},
        workspace::Threads,
    };
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
    fn the_level_is_the_nearest() {
        assert_eq!(level(2.0, 5), (0, 1));
        assert_eq!(level(1.6, 5), (-1, 3));
        assert_eq!(level(3.3, 5), (0, 3));
        assert_eq!(level(3.9, 5), (1, 1));
        assert_eq!(level(1000.0, 2), (2, 3));
        assert_eq!((level(0.0, 2), level(f64::NAN, 2)), ((-1, 1), (-1, 1)));
    }

    #[test]
    fn strips_change_no_descriptor() {
        let image = image(80, 600, waves);
        let keypoints = Dog { contrast: 0.5, ..Dog::default() }.detect(&image);
        let sift = Sift::default();
        let mut work = crate::workspace::Workspace::default();
        *work.get() = ScaleSpace::keeping(3000);
        let mut found = Descriptors::default();
        sift.describe_into(&image, &keypoints, &mut work, &mut found);
        let full = sift.describe(&image, &keypoints);
        let worst = (0..keypoints.len()).map(|i| distance(&found, i, &full, i)).fold(0.0, f32::max);
        // Positions are relative to the strip, with another rounding.
        assert!(keypoints.len() > 30 && worst < 1e-3, "{}: {worst}", keypoints.len());
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
            // All ramps are equal after rotation with the image.
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
        // A rotation by 30° about the middle.
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
