//! Interpolation by cubic splines.

use crate::image::Image;

/// The number of the prefilter's taps on either side; the truncated part is 1e-4 of a pixel's value.
const REACH: usize = 7;

/// The cubic B-spline Σ c_ij β(x − i) β(y − j) through the pixels of one rectangle of an image.
///
/// The image is mirrored at its border. The prefilter is its impulse response √3 (√3 − 2)^|k|, truncated and scaled to
/// sum 1.
///
/// Source: Unser, *Splines: a perfect fit for signal and image processing*, 1999.
#[derive(Debug, Default)]
pub(super) struct Spline {
    /// The first column and row.
    corner: [isize; 2],
    width: usize,
    height: usize,
    coefficients: Vec<f32>,
    raw: Vec<f32>,
    across: Vec<f32>,
}

/// Copies the pixels of the rectangle of `width` × `height` at `corner`, mirrored at the border.
pub(super) fn copy(image: &Image, corner: [isize; 2], width: usize, height: usize, out: &mut Vec<f32>) {
    let ([x, y], w) = (corner, image.width() as isize);
    out.clear();
    out.reserve(width * height);
    for y in y..y + height as isize {
        let row = image.row(mirrored(y, image.height()));
        if x >= 0 && x + width as isize <= w {
            out.extend_from_slice(&row[x as usize..x as usize + width]);
        } else {
            out.extend((x..x + width as isize).map(|x| row[mirrored(x, image.width())]));
        }
    }
}

/// The index within `n` pixels of the mirrored position `i`.
fn mirrored(i: isize, n: usize) -> usize {
    let period = (2 * n as isize - 2).max(1);
    let i = i.rem_euclid(period);
    i.min(period - i).min(n as isize - 1) as usize
}

impl Spline {
    /// Computes the spline of the rectangle with these first and last columns and rows.
    pub(super) fn load(&mut self, image: &Image, first: [isize; 2], last: [isize; 2]) {
        let reach = REACH as isize;
        self.corner = first;
        self.width = ((last[0] - first[0]).max(0) as usize + 1).next_multiple_of(8);
        self.height = (last[1] - first[1]).max(0) as usize + 1;
        let (wide, high) = (self.width + 2 * REACH, self.height + 2 * REACH);
        copy(image, [first[0] - reach, first[1] - reach], wide, high, &mut self.raw);
        self.across.resize(self.width * high, 0.0);
        self.coefficients.resize(self.width * self.height, 0.0);
        prefilter(&self.raw, self.width, self.height, &mut self.across, &mut self.coefficients);
    }

    /// Clears the spline, so that it covers nothing.
    pub(super) fn forget(&mut self) {
        self.coefficients.clear();
    }

    /// Whether the spline covers the rectangle between these two corners.
    pub(super) fn covers(&self, first: [f64; 2], last: [f64; 2]) -> bool {
        let size = [self.width, self.height];
        !self.coefficients.is_empty()
            && (0..2).all(|i| {
                let start = self.corner[i] as f64;
                first[i] >= start + 1.0 && last[i] < start + size[i] as f64 - 2.0
            })
    }

    /// Computes the values on a grid with steps of one pixel from `at`, `columns` (a multiple of 8) by `rows`.
    ///
    /// Values outside the spline are meaningless.
    pub(super) fn grid(&self, at: [f64; 2], columns: usize, rows: usize, across: &mut Vec<f32>, out: &mut [f32]) {
        let [(x, tx), (y, ty)] = [0, 1].map(|i| split(at[i] - self.corner[i] as f64));
        across.resize(columns * (rows + 3), 0.0);
        let first = (y - 1) * self.width + x - 1;
        let (wx, wy) = (weights(tx), weights(ty));
        separable(&self.coefficients[first..], self.width, [wx, wy], columns, across, &mut out[..columns * rows]);
    }

    /// Computes the values on a grid that is stretched and sheared along its rows.
    ///
    /// Pixel i of row j lies at `at` + (`step` i + `drift` j, j). `columns` is a multiple of 8; values outside the
    /// spline are meaningless.
    pub(super) fn sheared(
        &self,
        at: [f64; 2],
        [step, drift]: [f64; 2],
        columns: usize,
        across: &mut Vec<f32>,
        out: &mut [f32],
    ) {
        let (y, ty) = split(at[1] - self.corner[1] as f64);
        let begin = at[0] - self.corner[0] as f64;
        across.resize(self.width.max(across.len()), 0.0);
        let rows = &self.coefficients[(y - 1) * self.width..];
        let line = [begin as f32, step as f32, drift as f32];
        shear(rows, weights(ty), line, columns, &mut across[..self.width], out);
    }

    /// The value at a position that the spline covers.
    pub(super) fn at(&self, place: [f32; 2]) -> f32 {
        let (x, y) = (place[0] as usize, place[1] as usize);
        let (wx, wy) = (weights(place[0] - x as f32), weights(place[1] - y as f32));
        let first = (y - 1) * self.width + x - 1;
        let row = |i: usize| {
            let c = &self.coefficients[first + i * self.width..][..4];
            wx[0] * c[0] + wx[1] * c[1] + (wx[2] * c[2] + wx[3] * c[3])
        };
        wy[0] * row(0) + wy[1] * row(1) + (wy[2] * row(2) + wy[3] * row(3))
    }

    /// The first column and row of the rectangle.
    pub(super) fn corner(&self) -> [isize; 2] {
        self.corner
    }
}

/// The integer and the fractional part of a coordinate inside the rectangle.
fn split(at: f64) -> (usize, f32) {
    let full = at.floor();
    (full as usize, (at - full) as f32)
}

/// The four values β(t + 1), β(t), β(t − 1), β(t − 2).
#[inline(always)]
fn weights(t: f32) -> [f32; 4] {
    let u = 1.0 - t;
    let (a, d) = (u * u * u / 6.0, t * t * t / 6.0);
    let b = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t);
    [a, b, 1.0 - a - b - d, d]
}

/// The response √3 (√3 − 2)^k for k = 0 … 7, scaled to sum 1 over both sides.
const fn response() -> [f32; REACH + 1] {
    let (mut taps, mut k) = ([0.0; REACH + 1], 1);
    let mut exact = [1.0; REACH + 1];
    let mut sum = 1.0;
    while k <= REACH {
        exact[k] = exact[k - 1] * (1.732_050_807_568_877_2 - 2.0);
        sum += 2.0 * exact[k];
        k += 1;
    }
    k = 0;
    while k <= REACH {
        taps[k] = (exact[k] / sum) as f32;
        k += 1;
    }
    taps
}

/// Converts pixels to coefficients, along the rows and then along the columns.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn prefilter(raw: &[f32], width: usize, height: usize, across: &mut [f32], out: &mut [f32]) {
    const TAPS: [f32; REACH + 1] = response();
    for (row, to) in raw.chunks_exact(width + 2 * REACH).zip(across.chunks_exact_mut(width)) {
        for (x, to) in to.chunks_exact_mut(8).enumerate() {
            let from: &[f32] = &row[8 * x..8 * x + 8 + 2 * REACH];
            let mut sum: [f32; 8] = std::array::from_fn(|i| TAPS[0] * from[REACH + i]);
            for (k, tap) in TAPS.iter().enumerate().skip(1) {
                let (a, b) = (&from[REACH - k..][..8], &from[REACH + k..][..8]);
                for i in 0..8 {
                    sum[i] += tap * (a[i] + b[i]);
                }
            }
            to.copy_from_slice(&sum);
        }
    }
    for (y, to) in out.chunks_exact_mut(width).enumerate().take(height) {
        let rows: [&[f32]; 2 * REACH + 1] = std::array::from_fn(|k| &across[(y + k) * width..][..width]);
        for (x, to) in to.chunks_exact_mut(8).enumerate() {
            let from = |k: usize| &rows[k][8 * x..8 * x + 8];
            let centre = from(REACH);
            let mut sum: [f32; 8] = std::array::from_fn(|i| TAPS[0] * centre[i]);
            for (k, tap) in TAPS.iter().enumerate().skip(1) {
                let (a, b) = (from(REACH - k), from(REACH + k));
                for i in 0..8 {
                    sum[i] += tap * (a[i] + b[i]);
                }
            }
            to.copy_from_slice(&sum);
        }
    }
}

/// Computes a grid with one fraction for all positions, along the rows and then along the columns.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn separable(
    coefficients: &[f32],
    width: usize,
    weights: [[f32; 4]; 2],
    columns: usize,
    across: &mut [f32],
    out: &mut [f32],
) {
    let [wx, wy] = weights;
    for (y, to) in across.chunks_exact_mut(columns).enumerate() {
        let from = &coefficients[y * width..][..columns + 3];
        let (a, b, c, d) = (&from[..columns], &from[1..=columns], &from[2..columns + 2], &from[3..]);
        for i in 0..columns {
            to[i] = wx[0] * a[i] + wx[1] * b[i] + (wx[2] * c[i] + wx[3] * d[i]);
        }
    }
    for (y, to) in out.chunks_exact_mut(columns).enumerate() {
        let row = |k: usize| &across[(y + k) * columns..][..columns];
        let (a, b, c, d) = (row(0), row(1), row(2), row(3));
        for i in 0..columns {
            to[i] = wy[0] * a[i] + wy[1] * b[i] + (wy[2] * c[i] + wy[3] * d[i]);
        }
    }
}

/// Computes a sheared grid: down the four rows of coefficients, then at each position along the row.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn shear(
    coefficients: &[f32],
    wy: [f32; 4],
    [begin, step, drift]: [f32; 3],
    columns: usize,
    across: &mut [f32],
    out: &mut [f32],
) {
    const LANES: usize = 8;
    let width = across.len();
    let max = (width - 3) as f32;
    for (j, out) in out.chunks_exact_mut(columns).enumerate() {
        let row = |k: usize| &coefficients[(j + k) * width..][..width];
        let (a, b, c, d) = (row(0), row(1), row(2), row(3));
        for i in 0..width {
            across[i] = wy[0] * a[i] + wy[1] * b[i] + (wy[2] * c[i] + wy[3] * d[i]);
        }
        let begin = begin + drift * j as f32;
        for (block, out) in out.chunks_exact_mut(LANES).enumerate() {
            let (mut full, mut part) = ([0_i32; LANES], [0.0_f32; LANES]);
            for i in 0..LANES {
                let x = (begin + step * (block * LANES + i) as f32).clamp(1.0, max);
                full[i] = x as i32;
                part[i] = x - full[i] as f32;
            }
            let mut w = [[0.0_f32; LANES]; 4];
            for i in 0..LANES {
                let all = weights(part[i]);
                for k in 0..4 {
                    w[k][i] = all[k];
                }
            }
            for i in 0..LANES {
                let c = &across[full[i] as usize - 1..][..4];
                out[i] = w[0][i] * c[0] + w[1][i] * c[1] + (w[2][i] * c[2] + w[3][i] * c[3]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_passes_through_the_pixels_up_to_the_border() {
        let value = |x: f64, y: f64| 100.0 + 40.0 * libm::sin(0.8 * x + 0.3 * y) + 30.0 * libm::cos(0.7 * y);
        let image = Image::new(30, 20, (0..600).map(|i| value((i % 30) as f64, (i / 30) as f64) as f32).collect());
        let image = image.unwrap();
        let mut spline = Spline::default();
        spline.load(&image, [-1, -1], [31, 21]);
        let (mut out, mut across) = (vec![0.0; 8 * 20], Vec::new());
        for x in [0, 11, 22] {
            spline.grid([x as f64, 0.0], 8, 20, &mut across, &mut out);
            for (row, y) in out.chunks(8).zip(0..) {
                for (found, pixel) in row.iter().zip(&image.row(y)[x..]) {
                    assert!((found - pixel).abs() < 0.05, "({x}, {y}): {found}, not {pixel}");
                }
            }
        }
        // Values between pixels equal those of single samples.
        spline.grid([11.3, 8.6], 8, 3, &mut across, &mut out[..24]);
        assert!((f64::from(out[9]) - value(12.3, 9.6)).abs() < 0.15);
        assert!((out[9] - spline.at([12.3 + 1.0, 9.6 + 1.0])).abs() < 1e-3);
    }

    #[test]
    fn a_sheared_grid_is_made_sample_by_sample() {
        let image = Image::new(30, 20, (0..600).map(|i| ((i * 7919) % 251) as f32).collect()).unwrap();
        let mut spline = Spline::default();
        spline.load(&image, [-1, -1], [31, 21]);
        let (mut out, mut across) = (vec![0.0; 16 * 5], Vec::new());
        for (step, drift) in [(1.1, 0.2), (0.8, -0.3), (-0.9, 0.1)] {
            let begin = if step > 0.0 { 5.3 } else { 20.4 };
            spline.sheared([begin, 6.7], [step, drift], 16, &mut across, &mut out);
            for (j, i) in (0..5).flat_map(|j| (0..12).map(move |i| (j, i))) {
                let place = [begin + step * f64::from(i) + drift * f64::from(j), 6.7 + f64::from(j)];
                let expected = spline.at(place.map(|x| (x + 1.0) as f32));
                let found = out[(16 * j + i) as usize];
                assert!((found - expected).abs() < 0.02, "{step} {drift}, ({i}, {j}): {found}, not {expected}");
            }
        }
    }

    #[test]
    fn a_mirror_image_continues_the_image() {
        assert_eq!([-2, -1, 0, 2, 3, 4, 5].map(|i| mirrored(i, 4)), [2, 1, 0, 2, 3, 2, 1]);
        assert_eq!([-5, 0, 7].map(|i| mirrored(i, 1)), [0, 0, 0]);
    }
}
