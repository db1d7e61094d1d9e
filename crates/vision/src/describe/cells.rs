//! Means of an image over a grid of square cells at subpixel positions.

use multiversion::multiversion;
use seafix_geometry::Pixel;

use crate::image::Image;

/// The means over `N`×`N` cells, `cells[column][row]`; the first `N` of a column's `LANES` values are valid.
pub(super) type Cells<const N: usize, const LANES: usize> = [[f32; LANES]; N];

/// A square grid of cells around a position.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    at: Pixel,
    step: f64,
}

impl Grid {
    /// A grid around `at` with cells `step` px wide; an invalid size counts as 0: cells without extent.
    pub(super) fn new(at: Pixel, step: f64) -> Self {
        Self { at, step: step.max(0.0) }
    }

    /// Computes the means over the cells of an upright grid, less the grey level at the centre.
    ///
    /// Pixels are squares of constant grey, and the border pixels continue beyond the border. The subtraction avoids
    /// rounding where the image is bright and gives zeros for a constant image. Pixels are summed directly, which for a
    /// thousand key points is cheaper than an integral image, and exact.
    pub(super) fn upright<const N: usize, const LANES: usize>(
        &self,
        image: &Image,
        sums: &mut Vec<f32>,
        cells: &mut Cells<N, LANES>,
    ) {
        let across: [_; N] = std::array::from_fn(|i| self.span(self.at.u, i, N, image.width()));
        let down: [_; N] = std::array::from_fn(|i| self.span(self.at.v, i, N, image.height()));
        let (pixels, width) = (image.pixels(), image.width());
        upright(pixels, width, self.grey(pixels, width), &across, &down, sums, cells);
    }

    /// Computes the means over a grid whose columns follow each other along (cos, sin) in the image.
    ///
    /// Each cell's mean is that of bilinear samples at most 2 px apart.
    pub(super) fn turned<const N: usize, const LANES: usize>(
        &self,
        pixels: &[f32],
        width: usize,
        [cos, sin]: [f64; 2],
        line: &mut Vec<f32>,
        cells: &mut Cells<N, LANES>,
    ) {
        let samples = (libm::ceil(self.step / 2.0) as usize).clamp(if self.step > 1.0 { 2 } else { 1 }, MAX_SAMPLES);
        line.resize((N * samples).next_multiple_of(BLOCK), 0.0);
        *cells = [[0.0; LANES]; N];
        let pitch = self.step / samples as f64;
        // Offsets from an integer pixel keep their accuracy in single precision.
        let full = [libm::floor(self.at.u), libm::floor(self.at.v)];
        let offset = |i: usize| (i as f64 - 0.5 * (N * samples - 1) as f64) * pitch;
        let grey = self.grey(pixels, width);
        let fraction = 1.0 / (samples * samples) as f32;
        for y in 0..N * samples {
            let start = [
                (self.at.u - full[0] + offset(0) * cos - offset(y) * sin) as f32,
                (self.at.v - full[1] + offset(0) * sin + offset(y) * cos) as f32,
            ];
            let pace = [(pitch * cos) as f32, (pitch * sin) as f32];
            sample(pixels, width, [full[0] as i32, full[1] as i32], start, pace, line);
            let row = y / samples;
            for (cell, samples) in cells.iter_mut().zip(line.chunks_exact(samples)) {
                cell[row] += samples.iter().fold(0.0, |sum, sample| sum + (sample - grey)) * fraction;
            }
        }
    }

    /// The grey level of the pixel nearest to the centre.
    fn grey(&self, pixels: &[f32], width: usize) -> f32 {
        // A cast saturates, and NaN gives 0.
        let nearest = |x: f64, pixels: usize| ((x + 0.5) as usize).min(pixels - 1);
        pixels[nearest(self.at.v, pixels.len() / width) * width + nearest(self.at.u, width)]
    }

    /// The pixels of cell `i` of `count` along an axis of the image.
    fn span(&self, centre: f64, i: usize, count: usize, pixels: usize) -> Span {
        // The centre of the first pixel is 0, its outer edge −1/2; edges count from there.
        let edge = |i: usize| centre + 0.5 + (i as f64 - 0.5 * count as f64) * self.step;
        let (from, to) = (edge(i), edge(i + 1));
        let (first, last) = ((from as usize).min(pixels - 1), (to as usize).min(pixels - 1));
        let body = (1.0 / self.step) as f32;
        if first == last {
            return Span { first, last, head: 1.0, body, tail: 0.0 };
        }
        // Beyond the border `from` or `to` lies outside its pixel, whose weight grows accordingly.
        let head = ((first + 1) as f64 - from) / self.step;
        let tail = (to - last as f64) / self.step;
        Span { first, last, head: head as f32, body, tail: tail as f32 }
    }
}

/// The pixels of a cell along one axis: the weights of the first, of each between, and of the last.
#[derive(Debug, Clone, Copy)]
struct Span {
    first: usize,
    last: usize,
    head: f32,
    body: f32,
    tail: f32,
}

/// The number of values that are processed side by side.
const BLOCK: usize = 16;

/// The maximum number of samples along a cell's side.
const MAX_SAMPLES: usize = 64;

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn upright<const N: usize, const LANES: usize>(
    pixels: &[f32],
    width: usize,
    grey: f32,
    across: &[Span; N],
    down: &[Span; N],
    sums: &mut Vec<f32>,
    cells: &mut Cells<N, LANES>,
) {
    // Complete blocks of columns, shifted left if they would exceed the border.
    let wide = (across[N - 1].last + 1 - across[0].first).next_multiple_of(BLOCK).min(width);
    let left = across[0].first.min(width - wide);
    let row = |y: usize| &pixels[y * width + left..][..wide];
    sums.resize(wide * LANES + wide, 0.0);
    let (sums, sum) = sums.split_at_mut(wide * LANES);
    for (j, span) in down.iter().enumerate() {
        let ends = row(span.first).iter().zip(row(span.last));
        for (sum, (first, last)) in sum.iter_mut().zip(ends) {
            *sum = span.head * (first - grey) + span.tail * (last - grey);
        }
        for y in span.first + 1..span.last {
            for (sum, pixel) in sum.iter_mut().zip(row(y)) {
                *sum += span.body * (pixel - grey);
            }
        }
        for (column, &sum) in sums.chunks_exact_mut(LANES).zip(sum.iter()) {
            column[j] = sum;
        }
    }
    for (cells, span) in cells.iter_mut().zip(across) {
        let column = |x: usize| &sums[(x - left) * LANES..][..LANES];
        let ends = column(span.first).iter().zip(column(span.last));
        for (cell, (first, last)) in cells.iter_mut().zip(ends) {
            *cell = span.head * first + span.tail * last;
        }
        for x in span.first + 1..span.last {
            for (cell, sum) in cells.iter_mut().zip(column(x)) {
                *cell += span.body * sum;
            }
        }
    }
}

/// Computes bilinear samples along a line with spacing `pace`, from `start` relative to an integer pixel.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn sample(pixels: &[f32], width: usize, full: [i32; 2], start: [f32; 2], pace: [f32; 2], line: &mut [f32]) {
    let last = [width as i32 - 1, (pixels.len() / width) as i32 - 1];
    for (block, samples) in line.chunks_exact_mut(BLOCK).enumerate() {
        let mut weight = [[0.0_f32; BLOCK]; 2];
        let mut near = [[0_i32; BLOCK]; 2];
        let mut far = [[0_i32; BLOCK]; 2];
        for axis in 0..2 {
            for i in 0..BLOCK {
                let place = start[axis] + (block * BLOCK + i) as i32 as f32 * pace[axis];
                // The floor: a cast rounds towards zero.
                let cut = place as i32;
                let floor = cut.saturating_sub(i32::from(cut as f32 > place));
                weight[axis][i] = place - floor as f32;
                let pixel = full[axis].saturating_add(floor);
                near[axis][i] = pixel.clamp(0, last[axis]);
                far[axis][i] = pixel.saturating_add(1).clamp(0, last[axis]);
            }
        }
        let mut from = [[0_u32; BLOCK]; 4];
        for i in 0..BLOCK {
            let (above, below) = (near[1][i] as u32 * width as u32, far[1][i] as u32 * width as u32);
            from[0][i] = above + near[0][i] as u32;
            from[1][i] = above + far[0][i] as u32;
            from[2][i] = below + near[0][i] as u32;
            from[3][i] = below + far[0][i] as u32;
        }
        let mut grey = [[0.0_f32; BLOCK]; 4];
        for (grey, from) in grey.iter_mut().zip(&from) {
            for i in 0..BLOCK {
                grey[i] = pixels[from[i] as usize];
            }
        }
        for i in 0..BLOCK {
            let upper = grey[0][i] + weight[0][i] * (grey[1][i] - grey[0][i]);
            let lower = grey[2][i] + weight[0][i] * (grey[3][i] - grey[2][i]);
            samples[i] = upper + weight[1][i] * (lower - upper);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn upright<const N: usize>(image: &Image, u: f64, v: f64, step: f64) -> Cells<N, N> {
        let mut cells = [[0.0; N]; N];
        Grid::new(Pixel { u, v }, step).upright(image, &mut Vec::new(), &mut cells);
        cells
    }

    fn turned<const N: usize>(image: &Image, u: f64, v: f64, step: f64, along: [f64; 2]) -> Cells<N, N> {
        let mut cells = [[0.0; N]; N];
        Grid::new(Pixel { u, v }, step).turned(image.pixels(), image.width(), along, &mut Vec::new(), &mut cells);
        cells
    }

    #[test]
    fn cells_have_their_means_even_beyond_the_border() {
        let image = Image::new(3, 2, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        // Half of the first, all of the second and half of the third column.
        assert_eq!(upright::<1>(&image, 1.0, 0.5, 2.0), [[3.5 - 5.0]]);
        assert_eq!(upright::<2>(&image, 0.5, 0.5, 1.0), [[1.0 - 5.0, 4.0 - 5.0], [2.0 - 5.0, 5.0 - 5.0]]);
        // The first column continues from −2 to 0.
        assert_eq!(upright::<1>(&image, -1.5, 0.5, 2.0), [[2.5 - 4.0]]);
        // Only the last pixel exists beyond the corner.
        assert_eq!(upright::<1>(&image, 40.0, 30.0, 3.0), [[0.0]]);
        // A cell of a quarter of a pixel lies inside one.
        assert_eq!(upright::<1>(&image, 1.1, 0.1, 0.25), [[0.0]]);
    }

    #[test]
    fn a_ramp_has_the_values_of_the_cells_centres_in_any_direction() {
        let ramp = Image::new(64, 48, (0..64 * 48).map(|i| (2 * (i % 64) - i / 64) as f32).collect()).unwrap();
        let (u, v) = (30.3, 20.8);
        let grey = 2.0 * 30.0 - 21.0;
        for along in [[1.0, 0.0], [0.6, 0.8], [-0.8, 0.6], [0.0, -1.0]] {
            for step in [0.7, 1.0, 1.6, 3.1] {
                let cells = turned::<4>(&ramp, u, v, step, along);
                for (i, j) in (0..16).map(|k| (k / 4, k % 4)) {
                    let (x, y) = ((i as f64 - 1.5) * step, (j as f64 - 1.5) * step);
                    let at = [u + x * along[0] - y * along[1], v + x * along[1] + y * along[0]];
                    let error = f64::from(cells[i][j]) - (2.0 * at[0] - at[1] - grey);
                    assert!(error.abs() < 1e-4, "{along:?} {step} {i} {j}: {error}");
                    if along == [1.0, 0.0] && step != 0.7 {
                        let upright = upright::<4>(&ramp, u, v, step)[i][j];
                        // Pixels are constant, so a cell of a few pixels sees their steps.
                        assert!((f64::from(upright) - f64::from(cells[i][j])).abs() < 1.0, "{step}: {upright}");
                    }
                }
            }
        }
    }

    #[test]
    fn any_number_is_a_place_and_a_size() {
        let image = Image::new(2, 1, vec![1.0, 2.0]).unwrap();
        for wild in [f64::NAN, f64::INFINITY, -1e300, 1e300, 1e-300] {
            upright::<3>(&image, wild, 0.0, 1.0);
            upright::<3>(&image, 0.0, 0.0, wild);
            turned::<3>(&image, wild, 0.0, 1.0, [0.6, 0.8]);
            turned::<3>(&image, 0.0, wild, wild, [0.6, 0.8]);
        }
    }
}
