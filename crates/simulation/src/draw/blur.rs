//! What spreads light over pixels: the lens, scattering at small angles, motion during the exposure.

use seafix_vision::Threads;

/// Rows that one piece of work has.
const ROWS: usize = 64;

/// Memory of a blur.
#[derive(Debug, Default)]
pub(super) struct BlurScratch {
    across: Vec<f32>,
    pads: Vec<Vec<f32>>,
    weights: Vec<f32>,
    none: Vec<()>,
}

/// Convolves an image with a Gaussian of `sigma` pixels; at the border the nearest pixel continues.
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
            out.fill(0.0);
            for (k, weight) in weights.iter().enumerate() {
                add(out, &padded[k..k + width], *weight);
            }
        }
    });
    let across = &work.across[..];
    threads.pieces(image, ROWS * width, &mut work.none, |piece, rows, ()| {
        for (k, out) in rows.chunks_exact_mut(width).enumerate() {
            let y = piece * ROWS + k;
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

/// The motion of a camera during the exposure: its step in its own frame (rotation φ, translation ρ), and
/// focal length and principal point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Smear {
    pub(super) turn: [f32; 3],
    pub(super) step: [f32; 3],
    pub(super) focal: [f32; 2],
    pub(super) principal: [f32; 2],
}

impl Smear {
    /// How far the image of a place at depth `z` moves (px).
    #[inline]
    fn flow(&self, column: usize, row: usize, z: f32) -> [f32; 2] {
        let (x, y) =
            ((column as f32 - self.principal[0]) / self.focal[0], (row as f32 - self.principal[1]) / self.focal[1]);
        let ([a, b, c], [p, q, r]) = (self.turn, self.step);
        // ẋ of a resting point: −ρ/Z − φ × (x, y, 1), on the plane z = 1. (Longuet-Higgins and Prazdny, 1980.)
        let du = (-p + x * r) / z + a * x * y - b * (1.0 + x * x) + c * y;
        let dv = (-q + y * r) / z + a * (1.0 + y * y) - b * x * y - c * x;
        [du * self.focal[0], dv * self.focal[1]]
    }

    /// Spreads every pixel along its way; `depths` are Z (m) of the pixels. Nothing moves, nothing changes.
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
        threads.pieces(&mut work.across, ROWS * width, &mut work.none, |piece, rows, ()| {
            for (k, out) in rows.chunks_exact_mut(width).enumerate() {
                let row = piece * ROWS + k;
                for (column, out) in out.iter_mut().enumerate() {
                    let [du, dv] = self.flow(column, row, depths[row * width + column].max(0.05));
                    let length = (du * du + dv * dv).sqrt().min(64.0);
                    let half = length.ceil() as i32;
                    let step = 1.0 / (2 * half + 1) as f32;
                    let mut sum = 0.0;
                    for k in -half..=half {
                        let t = k as f32 * step;
                        sum += sample(column as f32 + t * du, row as f32 + t * dv);
                    }
                    *out = sum * step;
                }
            }
        });
        std::mem::swap(image, &mut work.across);
    }
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
        // 0.16 m at 2 m: 8 px; a line becomes a band of that width.
        smear(0.16).apply(&mut image, &depths, width, Threads::One, &mut BlurScratch::default());
        let row = &image[20 * width..21 * width];
        let (sum, mean) = (row.iter().sum::<f32>(), row.iter().enumerate().map(|(x, v)| x as f32 * v).sum::<f32>());
        assert!((sum - 90.0).abs() < 1e-3 && (mean / sum - 40.0).abs() < 1e-3);
        let second = row.iter().enumerate().map(|(x, v)| (x as f32 - 40.0).powi(2) * v).sum::<f32>() / sum;
        assert!((second - 64.0 / 12.0).abs() < 0.3, "{second}");
    }
}
