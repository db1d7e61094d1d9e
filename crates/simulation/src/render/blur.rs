//! Blur by the lens, by small-angle scattering and by motion during the exposure.

use seafix_vision::Threads;

/// Number of rows in one unit of work.
const ROWS: usize = 64;

/// Buffers of a blur.
#[derive(Debug, Default)]
pub(super) struct BlurScratch {
    across: Vec<f32>,
    pads: Vec<Vec<f32>>,
    weights: Vec<f32>,
    none: Vec<()>,
}

/// Convolves an image with a Gaussian of `sigma` pixels; border pixels are replicated.
pub(super) fn gaussian(image: &mut [f32], width: usize, sigma: f64, threads: Threads, work: &mut BlurScratch) {
    if !(sigma > 0.0) {
        return;
    }
    let radius = (3.5 * sigma).ceil() as usize;
    let weight = |k: usize| {
        let x = (k as f64 - radius as f64) / sigma;
        libm::exp(-0.5 * x * x)
    };
    let sum: f64 = (0..=2 * radius).map(weight).sum();
    work.weights.clear();
    work.weights.extend((0..=2 * radius).map(|k| (weight(k) / sum) as f32));
    let height = image.len() / width;
    work.across.resize(image.len(), 0.0);
    let (weights, source) = (&work.weights[..], &*image);
    threads.pieces(&mut work.across, ROWS * width, &mut work.pads, |piece, rows, padded: &mut Vec<f32>| {
        padded.resize(width + 2 * radius, 0.0);
        for (k, out) in rows.chunks_exact_mut(width).enumerate() {
            let row = &source[(piece * ROWS + k) * width..][..width];
            padded[..radius].fill(row[0]);
            padded[radius..radius + width].copy_from_slice(row);
            padded[radius + width..].fill(row[width - 1]);
            weigh(out, padded, 1, weights);
        }
    });
    let across = &work.across[..];
    threads.pieces(image, ROWS * width, &mut work.none, |piece, rows, ()| {
        for (k, out) in rows.chunks_exact_mut(width).enumerate() {
            let y = piece * ROWS + k;
            if y >= radius && y + radius < height {
                weigh(out, &across[(y - radius) * width..], width, weights);
                continue;
            }
            out.fill(0.0);
            for (k, weight) in weights.iter().enumerate() {
                let from = (y + k).saturating_sub(radius).min(height - 1);
                add(out, &across[from * width..][..width], *weight);
            }
        }
    });
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn add(out: &mut [f32], from: &[f32], weight: f32) {
    for (o, f) in out.iter_mut().zip(from) {
        *o += weight * f;
    }
}

/// The weighted sum of slices that begin `stride` apart.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn weigh(out: &mut [f32], from: &[f32], stride: usize, weights: &[f32]) {
    const CHUNK: usize = 64;
    for (c, out) in out.chunks_mut(CHUNK).enumerate() {
        let mut sum = [0.0_f32; CHUNK];
        for (k, weight) in weights.iter().enumerate() {
            let from = &from[k * stride + c * CHUNK..][..out.len()];
            sum.iter_mut().zip(from).for_each(|(sum, f)| *sum += weight * f);
        }
        out.copy_from_slice(&sum[..out.len()]);
    }
}

/// Minimum depth for motion blur (m).
const NEAREST: f32 = 0.05;
/// Number of pixels blurred in one pass.
const CHUNK: usize = 64;

/// A row of an image with its upper and lower neighbours.
fn neighbours(image: &[f32], width: usize, row: usize) -> [&[f32]; 3] {
    [row - 1, row, row + 1].map(|row| &image[row * width..][..width])
}

/// The camera's motion during the exposure: displacement in its own frame (rotation φ, translation ρ), focal length and
/// principal point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Smear {
    pub(super) turn: [f32; 3],
    pub(super) step: [f32; 3],
    pub(super) focal: [f32; 2],
    pub(super) principal: [f32; 2],
}

impl Smear {
    /// The displacement of the image of a place at depth `z` (px).
    #[inline(always)]
    fn flow(&self, column: f32, row: f32, z: f32) -> [f32; 2] {
        let (x, y) = ((column - self.principal[0]) / self.focal[0], (row - self.principal[1]) / self.focal[1]);
        let ([a, b, c], [p, q, r]) = (self.turn, self.step);
        // The motion field of a static point, ẋ = −ρ/Z − φ × (x, y, 1), on the plane z = 1 (Longuet-Higgins and
        // Prazdny, 1980).
        let du = (-p + x * r) / z + a * x * y - b * (1.0 + x * x) + c * y;
        let dv = (-q + y * r) / z + a * (1.0 + y * y) - b * x * y - c * x;
        [du * self.focal[0], dv * self.focal[1]]
    }

    /// Blurs every pixel along its displacement; `depths` holds Z (m) of the pixels. Without motion the image stays
    /// unchanged.
    pub(super) fn apply(
        &self,
        image: &mut Vec<f32>,
        depths: &[f32],
        width: usize,
        threads: Threads,
        work: &mut BlurScratch,
    ) {
        if self.turn == [0.0; 3] && self.step == [0.0; 3] {
            return;
        }
        let height = image.len() / width;
        work.across.resize(image.len(), 0.0);
        let source = &image[..];
        let sample = |u: f32, v: f32| {
            let (u, v) = (u.clamp(0.0, width as f32 - 1.0), v.clamp(0.0, height as f32 - 1.0));
            let (i, j) = ((u as usize).min(width.saturating_sub(2)), (v as usize).min(height.saturating_sub(2)));
            let (fu, fv) = (u - i as f32, v - j as f32);
            let at = |i: usize, j: usize| source[j.min(height - 1) * width + i.min(width - 1)];
            let (above, below) =
                (at(i, j) + fu * (at(i + 1, j) - at(i, j)), at(i, j + 1) + fu * (at(i + 1, j + 1) - at(i, j + 1)));
            above + fv * (below - above)
        };
        let spread = |column: usize, row: usize| {
            let [du, dv] = self.flow(column as f32, row as f32, depths[row * width + column].max(NEAREST));
            let half = (du * du + dv * dv).sqrt().min(64.0).ceil() as i32;
            let step = 1.0 / (2 * half + 1) as f32;
            let taps = (-half..=half).map(|k| k as f32 * step);
            taps.map(|t| sample(column as f32 + t * du, row as f32 + t * dv)).sum::<f32>() * step
        };
        threads.pieces(&mut work.across, ROWS * width, &mut work.none, |piece, rows, ()| {
            for (k, out) in rows.chunks_exact_mut(width).enumerate() {
                let row = piece * ROWS + k;
                let inner = row > 0 && row + 1 < height && width > 2;
                let three = |list| inner.then(|| neighbours(list, width, row));
                let mut from = 0;
                if let Some(near) = three(source) {
                    out[0] = spread(0, row);
                    from = 1;
                    while from + 1 < width {
                        let to = (from + CHUNK).min(width - 1);
                        if !short(self, from, row, &depths[row * width..], &near, &mut out[..to]) {
                            (from..to).for_each(|column| out[column] = spread(column, row));
                        }
                        from = to;
                    }
                }
                (from..width).for_each(|column| out[column] = spread(column, row));
            }
        });
        std::mem::swap(image, &mut work.across);
    }
}

/// Blurs the pixels from column `from` to the end of `out`, if all of them move by a pixel or less.
///
/// At most one chunk without border pixels is accepted. Three samples at thirds of the path then lie among the pixel
/// and its neighbours. The result is `false`, and nothing changes, if a pixel moves farther.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn short(smear: &Smear, from: usize, row: usize, depths: &[f32], near: &[&[f32]; 3], out: &mut [f32]) -> bool {
    let n = out.len() - from;
    let mut z = [1.0_f32; CHUNK];
    z[..n].copy_from_slice(&depths[from..from + n]);
    let (mut across, mut down, mut longest) = ([0.0_f32; CHUNK], [0.0_f32; CHUNK], 0.0_f32);
    for i in 0..CHUNK {
        let [du, dv] = smear.flow((from + i) as u32 as f32, row as u32 as f32, z[i].max(NEAREST));
        (across[i], down[i]) = (du * (1.0 / 3.0), dv * (1.0 / 3.0));
    }
    for i in 0..n {
        longest = longest.max(across[i] * across[i] + down[i] * down[i]);
    }
    if !(longest <= 1.0 / 9.0) {
        return false;
    }
    // Three rows of three: [row][column] from the pixel.
    let mut nine = [[[0.0_f32; CHUNK]; 3]; 3];
    for (rows, image) in nine.iter_mut().zip(near) {
        for (k, list) in rows.iter_mut().enumerate() {
            list[..n].copy_from_slice(&image[from - 1 + k..][..n]);
        }
    }
    let mut sum = [0.0_f32; CHUNK];
    for i in 0..CHUNK {
        let (tu, tv) = (across[i].abs(), down[i].abs());
        let (right, below) = (across[i] >= 0.0, down[i] >= 0.0);
        // Each row is interpolated horizontally, then the rows vertically.
        let ahead = |row: &[[f32; CHUNK]; 3]| row[1][i] + tu * (if right { row[2][i] } else { row[0][i] } - row[1][i]);
        let back = |row: &[[f32; CHUNK]; 3]| row[1][i] + tu * (if right { row[0][i] } else { row[2][i] } - row[1][i]);
        let first = |a: f32, b: f32| if below { b } else { a };
        let (here, there) = (ahead(&nine[1]), back(&nine[1]));
        let forth = here + tv * (first(ahead(&nine[0]), ahead(&nine[2])) - here);
        let before = there + tv * (first(back(&nine[2]), back(&nine[0])) - there);
        sum[i] = (before + nine[1][1][i] + forth) * (1.0 / 3.0);
    }
    out[from..].copy_from_slice(&sum[..n]);
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_keeps_the_sum_and_has_its_width() {
        let (width, height) = (61, 150);
        let mut image = vec![0.0; width * height];
        image[70 * width + 30] = 1000.0;
        gaussian(&mut image, width, 1.7, Threads::One, &mut BlurScratch::default());
        let sum: f32 = image.iter().sum();
        let second =
            |f: &dyn Fn(usize) -> f32| image.iter().enumerate().map(|(k, v)| v * f(k) * f(k)).sum::<f32>() / sum;
        assert!((sum - 1000.0).abs() < 0.01);
        for spread in [second(&|k| (k % width) as f32 - 30.0), second(&|k| (k / width) as f32 - 70.0)] {
            assert!((spread.sqrt() - 1.7).abs() < 0.02, "{spread}");
        }
    }

    #[test]
    fn a_short_path_is_spread_as_a_long_one() {
        // Bilinear interpolation keeps a plane and smooths a pyramid by its curvature.
        let (width, height) = (150, 9);
        let plane: Vec<f32> =
            (0..width * height).map(|k| 3.0 * (k % width) as f32 - 2.0 * (k / width) as f32).collect();
        for step in [[0.01, 0.0, 0.0], [-0.004, 0.01, 0.0], [0.0, -0.012, 0.003]] {
            let smear = Smear { turn: [0.001, 0.0, -0.002], step, focal: [100.0; 2], principal: [74.5, 4.0] };
            let depths = vec![2.0; width * height];
            let mut image = plane.clone();
            smear.apply(&mut image, &depths, width, Threads::One, &mut BlurScratch::default());
            for row in 1..height - 1 {
                for column in 1..width - 1 {
                    let k = row * width + column;
                    assert!((image[k] - plane[k]).abs() < 1e-4, "{row} {column}: {} {}", image[k], plane[k]);
                }
            }
        }
        // One bright pixel, moved by 0.6 px to the right: a third of it each at −0.2, 0 and 0.2 px.
        let smear = Smear { turn: [0.0; 3], step: [-0.012, 0.0, 0.0], focal: [100.0; 2], principal: [74.5, 4.0] };
        let mut image = vec![0.0; width * height];
        image[4 * width + 70] = 3.0;
        smear.apply(&mut image, &vec![2.0; width * height], width, Threads::One, &mut BlurScratch::default());
        let row = &image[4 * width + 69..4 * width + 72];
        assert!(row.iter().zip([0.2, 2.6, 0.2]).all(|(found, exact)| (found - exact).abs() < 1e-5), "{row:?}");
    }

    #[test]
    fn a_sideways_step_smears_by_focal_over_depth() {
        let (width, height) = (80, 40);
        let smear =
            |step: f32| Smear { turn: [0.0; 3], step: [step, 0.0, 0.0], focal: [100.0; 2], principal: [39.5, 19.5] };
        let mut image = vec![0.0; width * height];
        image.iter_mut().enumerate().filter(|(k, _)| k % width == 40).for_each(|(_, p)| *p = 90.0);
        let depths = vec![2.0; width * height];
        let still = image.clone();
        smear(0.0).apply(&mut image, &depths, width, Threads::One, &mut BlurScratch::default());
        assert_eq!(image, still);
        // 0.16 m at 2 m give 8 px; a line becomes a band of that width.
        smear(0.16).apply(&mut image, &depths, width, Threads::One, &mut BlurScratch::default());
        let row = &image[20 * width..21 * width];
        let (sum, mean) = (row.iter().sum::<f32>(), row.iter().enumerate().map(|(x, v)| x as f32 * v).sum::<f32>());
        assert!((sum - 90.0).abs() < 1e-3 && (mean / sum - 40.0).abs() < 1e-3);
        let second = row.iter().enumerate().map(|(x, v)| (x as f32 - 40.0).powi(2) * v).sum::<f32>() / sum;
        assert!((second - 64.0 / 12.0).abs() < 0.3, "{second}");
    }
}
