//! The Gaussian scale space of an image.

use std::ops::Range;

use crate::{
    gaussian::{half_kernel_into, smooth_into},
    image::Image,
    workspace::Threads,
};

/// The number of levels from one octave to the next; Lowe found the most repeatable extrema with three.
pub(crate) const INTERVALS: usize = 3;
/// The number of levels of an octave: differences are needed one level beyond the three on either side.
pub(crate) const LEVELS: usize = INTERVALS + 3;
/// The standard deviation of an octave's first level (px of the octave).
const SIGMA: f64 = 1.6;
/// The assumed blur of an image before any smoothing (px).
const IMAGE_SIGMA: f64 = 0.5;
/// The cut-off of the Gaussians (standard deviations).
const CUT: f64 = 4.0;
/// The minimum side of an octave (px).
const MIN_SIDE: usize = 16;

/// The Gaussian scale space of an image: Gaussians of growing width, at half the resolution after each doubling.
///
/// Level l of octave o has the standard deviation 1.6 · 2^(o + l/3) px of the image. Octave 0 has the image's pixels,
/// octave −1 twice as many along each side. Pixel (x, y) of octave o lies at (x, y) · 2^o in the image.
///
/// Levels are computed on first use and kept, so a descriptor reuses the levels of the detector on the same image. They
/// depend on the image alone.
///
/// Octaves of more than [`MAX_FULL`] pixels are not kept; they are computed anew in strips of rows
/// ([`sweep`](Self::sweep)), since 64 Mpx would take 7 GB. Smaller images hold about 32 bytes a pixel, 130 with octave
/// −1.
///
/// Source: Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004.
#[derive(Debug)]
pub(crate) struct ScaleSpace {
    image: Option<Image>,
    /// The octaves from −1 on; an octave above the size limit holds its first level alone, from octave 1 on.
    octaves: Vec<Octave>,
    strip: Octave,
    kernel: Vec<f32>,
    rows: Vec<Vec<f32>>,
    doubled: Vec<f32>,
    /// The largest number of pixels of an octave that is kept.
    max_full: usize,
}

impl Default for ScaleSpace {
    fn default() -> Self {
        Self::keeping(MAX_FULL)
    }
}

/// The largest number of pixels of an octave that is kept: 200 MB.
const MAX_FULL: usize = 8 << 20;
/// The number of extra rows on either side of a strip.
///
/// The strip's edge affects up to 48 rows in the last level; an extremum reads 12 rows beyond its own, a descriptor 40.
const MARGIN: usize = 96;

/// The levels of an image at one resolution.
#[derive(Debug, Default)]
pub(crate) struct Octave {
    width: usize,
    levels: [Vec<f32>; LEVELS],
    /// The number of computed levels.
    made: usize,
}

/// A strip of rows of an octave with its margins.
#[derive(Debug, Clone)]
pub(crate) struct Strip {
    /// The rows, in the octave's numbering.
    pub(crate) rows: Range<usize>,
    /// The octave's row that is the first row of the levels.
    pub(crate) first: usize,
}

impl Octave {
    /// The width (px).
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// The number of rows.
    pub(crate) fn height(&self) -> usize {
        self.levels[0].len() / self.width
    }

    /// The pixels of one level in row-major order.
    pub(crate) fn level(&self, level: usize) -> &[f32] {
        &self.levels[level]
    }
}

/// The standard deviation of a level (px of the image).
pub(crate) fn sigma(octave: i32, level: f64) -> f64 {
    SIGMA * libm::exp2(f64::from(octave) + level / INTERVALS as f64)
}

/// The number of octaves from 0 on for an image of this size; at least one.
pub(crate) fn octaves(width: usize, height: usize) -> i32 {
    let mut count = 1;
    while width.min(height) >> count >= MIN_SIDE {
        count += 1;
    }
    count
}

impl ScaleSpace {
    /// Sets the image; the levels stay if it is the same image.
    pub(crate) fn look_at(&mut self, image: &Image) {
        match &mut self.image {
            Some(known) if known == image => return,
            Some(known) => known.copy_from(image),
            None => self.image = Some(image.clone()),
        }
        self.octaves.iter_mut().for_each(|octave| octave.made = 0);
    }

    /// An empty scale space that keeps octaves of at most `max_full` pixels.
    pub(crate) fn keeping(max_full: usize) -> Self {
        Self {
            image: None,
            octaves: Vec::new(),
            strip: Octave::default(),
            kernel: Vec::new(),
            rows: Vec::new(),
            doubled: Vec::new(),
            max_full,
        }
    }

    /// Width and height of an octave.
    fn size(&self, octave: i32) -> [usize; 2] {
        let image = self.image.as_ref().expect("the image is set");
        let side = |n: usize| if octave < 0 { 2 * n } else { n.div_ceil(1 << octave) };
        [image.width(), image.height()].map(side)
    }

    /// Whether an octave is kept; the others are computed in strips.
    pub(crate) fn keeps(&self, octave: i32) -> bool {
        self.size(octave).iter().product::<usize>() <= self.max_full
    }

    /// Calls `visit` with an octave whose levels are computed up to `level`.
    ///
    /// An octave that is kept is passed at once. Others are passed strip by strip, with margins so large that results
    /// do not depend on the strips.
    ///
    /// # Panics
    /// If no image is set.
    pub(crate) fn sweep(&mut self, octave: i32, level: usize, threads: Threads, mut visit: impl FnMut(&Octave, Strip)) {
        let [width, height] = self.size(octave);
        if self.keeps(octave) {
            return visit(self.octave(octave, level, threads), Strip { rows: 0..height, first: 0 });
        }
        if octave > 0 {
            self.begin(octave, threads);
        }
        let next = index(octave + 1);
        if self.octaves.len() <= next {
            self.octaves.resize_with(next + 1, Octave::default);
        }
        // The next octave begins with a level of this one.
        let begins = octave >= 0 && self.octaves[next].made == 0;
        if begins {
            self.octaves[next].levels[0].clear();
        }
        let level = if begins { level.max(INTERVALS) } else { level };
        // A strip has as many rows as the size limit allows, yet more than its margins; even, as doubled rows are.
        let step = (self.max_full / width).saturating_sub(2 * MARGIN).max(2 * MARGIN) & !1;
        for begin in (0..height).step_by(step) {
            let rows = begin..(begin + step).min(height);
            let first = rows.start.saturating_sub(MARGIN);
            self.make(octave, first..(rows.end + MARGIN).min(height), level, threads);
            visit(&self.strip, Strip { rows: rows.clone(), first });
            if begins {
                let inner = &self.strip.levels[INTERVALS][(rows.start - first) * width..(rows.end - first) * width];
                halve(inner, width, &mut self.octaves[next].levels[0]);
            }
        }
        if begins {
            (self.octaves[next].width, self.octaves[next].made) = (width.div_ceil(2), 1);
        }
    }

    /// Computes these rows of an octave in the strip.
    fn make(&mut self, octave: i32, rows: Range<usize>, level: usize, threads: Threads) {
        let [width, _] = self.size(octave);
        let Self { image, octaves, strip, kernel, rows: scratch, doubled, .. } = self;
        let image = image.as_ref().expect("the image is set");
        strip.width = width;
        let part = rows.start * width..rows.end * width;
        if octave > 0 {
            strip.levels[0].clear();
            strip.levels[0].extend_from_slice(&octaves[index(octave)].levels[0][part]);
        } else {
            let pixels = if octave < 0 {
                double(image, rows.start / 2..rows.end / 2, doubled);
                &doubled[..]
            } else {
                &image.pixels()[part]
            };
            first_kernel(octave, kernel);
            smooth_into(pixels, width, kernel, threads, scratch, &mut strip.levels[0]);
        }
        strip.made = 1;
        strip.smooth(level, kernel, threads, scratch);
    }

    /// An octave of the image with its levels computed up to `level`.
    ///
    /// # Panics
    /// If no image is set, or the octave is not kept.
    pub(crate) fn octave(&mut self, octave: i32, level: usize, threads: Threads) -> &Octave {
        assert!(self.keeps(octave), "octave above the size limit; use sweep");
        let index = index(octave);
        if self.octaves.len() <= index {
            self.octaves.resize_with(index + 1, Octave::default);
        }
        self.begin(octave, threads);
        let Self { octaves, kernel, rows, .. } = self;
        octaves[index].smooth(level, kernel, threads, rows);
        &octaves[index]
    }

    /// Computes the first level of an octave.
    fn begin(&mut self, octave: i32, threads: Threads) {
        let index = index(octave);
        if self.octaves.get(index).is_some_and(|octave| octave.made > 0) {
            return;
        }
        if octave > 0 && !self.keeps(octave - 1) {
            return self.sweep(octave - 1, INTERVALS, threads, |_, _| ());
        }
        if octave > 0 {
            self.octave(octave - 1, INTERVALS, threads);
            if self.octaves.len() <= index {
                self.octaves.resize_with(index + 1, Octave::default);
            }
            let (finer, coarser) = self.octaves.split_at_mut(index);
            let (finer, coarser) = (&finer[index - 1], &mut coarser[0]);
            coarser.levels[0].clear();
            coarser.width = halve(&finer.levels[INTERVALS], finer.width, &mut coarser.levels[0]);
            coarser.made = 1;
            return;
        }
        let Self { image, octaves, kernel, rows, doubled, .. } = self;
        let image = image.as_ref().expect("the image is set");
        let pixels = if octave < 0 {
            double(image, 0..image.height(), doubled);
            &doubled[..]
        } else {
            image.pixels()
        };
        first_kernel(octave, kernel);
        let Octave { width, levels, made } = &mut octaves[index];
        *width = if octave < 0 { 2 * image.width() } else { image.width() };
        smooth_into(pixels, *width, kernel, threads, rows, &mut levels[0]);
        *made = 1;
    }
}

impl Octave {
    /// Computes the levels up to `level` from the first.
    fn smooth(&mut self, level: usize, kernel: &mut Vec<f32>, threads: Threads, rows: &mut Vec<Vec<f32>>) {
        let Self { width, levels, made } = self;
        while *made <= level {
            let [from, to] = [*made - 1, *made].map(|level| sigma(0, level as f64));
            half_kernel_into(libm::sqrt(to * to - from * from), CUT, kernel);
            let (below, above) = levels.split_at_mut(*made);
            smooth_into(&below[*made - 1], *width, kernel, threads, rows, &mut above[0]);
            *made += 1;
        }
    }
}

/// The kernel for the first level of octave −1 or 0, less the assumed blur of the image.
fn first_kernel(octave: i32, kernel: &mut Vec<f32>) {
    let known = IMAGE_SIGMA / if octave < 0 { 0.5 } else { 1.0 };
    half_kernel_into(libm::sqrt(SIGMA * SIGMA - known * known), CUT, kernel);
}

/// The index of an octave.
fn index(octave: i32) -> usize {
    (octave + 1) as usize
}

/// Appends every second pixel of every second row to `out`; returns the new width.
fn halve(pixels: &[f32], width: usize, out: &mut Vec<f32>) -> usize {
    for row in pixels.chunks_exact(width).step_by(2) {
        out.extend(row.iter().step_by(2));
    }
    width.div_ceil(2)
}

/// Doubles these rows along each side by linear interpolation: pixel (x, y) lies at (x/2, y/2) of the image.
fn double(image: &Image, rows: Range<usize>, out: &mut Vec<f32>) {
    let (width, height) = (image.width(), image.height());
    out.resize(4 * width * rows.len(), 0.0);
    for (y, rows) in rows.zip(out.chunks_exact_mut(4 * width)) {
        let (here, next) = (image.row(y), image.row((y + 1).min(height - 1)));
        let (even, odd) = rows.split_at_mut(2 * width);
        for (x, (even, odd)) in even.chunks_exact_mut(2).zip(odd.chunks_exact_mut(2)).enumerate() {
            let right = (x + 1).min(width - 1);
            even[0] = here[x];
            even[1] = 0.5 * (here[x] + here[right]);
            odd[0] = 0.5 * (here[x] + next[x]);
            odd[1] = 0.5 * (even[1] + 0.5 * (next[x] + next[right]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian blob of standard deviation `width`.
    fn blob(width: f64, at: [f64; 2]) -> Image {
        let value = |i: usize| {
            let (x, y) = ((i % 160) as f64 - at[0], (i / 160) as f64 - at[1]);
            100.0 * libm::exp(-0.5 * (x * x + y * y) / (width * width))
        };
        Image::new(160, 120, (0..160 * 120).map(|i| value(i) as f32).collect()).unwrap()
    }

    #[test]
    fn a_level_has_the_width_and_place_it_should() {
        // A blob of σ under a Gaussian of t is a blob of √(σ² + t²) with a peak of σ²/(σ² + t²).
        let (width, at) = (6.0, [80.0, 56.0]);
        let image = blob(width, at);
        let mut space = ScaleSpace::default();
        space.look_at(&image);
        for octave in [2, -1, 0, 1] {
            for level in [0, 3, 5] {
                let found = space.octave(octave, level, Threads::One);
                let pixel = libm::exp2(f64::from(octave));
                let (x, y) = ((at[0] / pixel) as usize, (at[1] / pixel) as usize);
                let peak = f64::from(found.level(level)[y * found.width() + x]);
                let added = sigma(octave, level as f64).powi(2) - IMAGE_SIGMA * IMAGE_SIGMA;
                let expected = 100.0 * width * width / (width * width + added);
                // Linear interpolation and the pixels of the image widen the blob a little.
                assert!((peak - expected).abs() < 0.5, "octave {octave} level {level}: {peak}, not {expected}");
            }
        }
    }

    #[test]
    fn another_image_is_another_space_and_threads_change_nothing() {
        let (a, b) = (blob(5.0, [70.0, 60.0]), blob(7.0, [60.0, 50.0]));
        let mut space = ScaleSpace::default();
        space.look_at(&b);
        let fresh = space.octave(1, 4, Threads::One).level(4).to_vec();
        space.look_at(&a);
        assert_ne!(space.octave(1, 5, Threads::One).level(4), fresh);
        space.look_at(&b);
        assert_eq!(space.octave(1, 4, Threads::Pool).level(4), fresh);
        assert_eq!(space.octave(1, 4, Threads::One).height(), 60);
    }

    #[test]
    fn strips_show_what_the_complete_image_does() {
        let value = |i: usize| ((i * 7919 + i / 90 * 31) % 251) as f32;
        let image = Image::new(90, 700, (0..90 * 700).map(value).collect()).unwrap();
        let (mut full, mut strips) = (ScaleSpace::default(), ScaleSpace::keeping(2000));
        full.look_at(&image);
        strips.look_at(&image);
        for octave in [1, -1, 0, 2, 3] {
            let level = LEVELS - 1;
            let expected = full.octave(octave, level, Threads::One);
            let (mut seen, mut count) = (0, 0);
            strips.sweep(octave, level, Threads::One, |found, Strip { rows, first }| {
                assert_eq!(rows.start, seen);
                let width = found.width();
                // Rows up to this distance beyond a strip are still read.
                let near = rows.start.saturating_sub(48)..(rows.end + 48).min(expected.height());
                for level in 0..=level {
                    let of = |octave: &Octave, first: usize| {
                        octave.level(level)[(near.start - first) * width..(near.end - first) * width].to_vec()
                    };
                    assert!(of(found, first) == of(expected, 0), "octave {octave}, level {level}, rows {rows:?}");
                }
                (seen, count) = (rows.end, count + 1);
            });
            assert_eq!(seen, expected.height());
            assert_eq!(count > 1, !strips.keeps(octave) && expected.height() > 200, "octave {octave}");
        }
    }

    #[test]
    fn the_smallest_image_has_its_octaves() {
        let one = Image::new(1, 1, vec![7.0]).unwrap();
        let mut space = ScaleSpace::default();
        space.look_at(&one);
        for octave in -1..4 {
            let found = space.octave(octave, 5, Threads::One);
            assert!(found.level(5).iter().all(|value| (value - 7.0).abs() < 1e-4), "{octave}");
        }
        assert_eq!((octaves(1, 1), octaves(32, 500), octaves(1600, 1200)), (1, 2, 7));
    }
}
