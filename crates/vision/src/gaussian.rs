//! The sampled Gaussian and Gaussian smoothing, bit-identical on every platform.

use multiversion::multiversion;

use crate::workspace::Threads;

/// One half of a sampled Gaussian of standard deviation `sigma` (px), cut off at 3 `sigma`.
///
/// The weight of the centre comes first, then one weight for each step outwards. The complete kernel sums to one.
pub(crate) fn half_kernel(sigma: f64) -> Vec<f32> {
    let mut kernel = Vec::new();
    half_kernel_into(sigma, 3.0, &mut kernel);
    kernel
}

/// Replaces `kernel` by one half of a sampled Gaussian that is cut off at `cut` times `sigma`.
pub(crate) fn half_kernel_into(sigma: f64, cut: f64, kernel: &mut Vec<f32>) {
    let radius = libm::ceil(cut * sigma.max(0.0)) as usize;
    let weight = |i: usize| {
        let step = i as f64 / sigma;
        if i == 0 { 1.0 } else { libm::exp(-0.5 * step * step) }
    };
    let sum = 1.0 + 2.0 * (1..=radius).map(weight).sum::<f64>();
    kernel.clear();
    kernel.extend((0..=radius).map(|i| (weight(i) / sum) as f32));
}

/// The number of rows that one thread smooths at a time.
const BAND: usize = 32;
/// The number of pixels whose sums are kept in registers at a time.
const BLOCK: usize = 64;

/// Replaces `out` by `source` (rows of `width` pixels), smoothed along both axes with a symmetric kernel.
///
/// `kernel` is one half of it. The nearest pixel is repeated beyond the border. `rows` is scratch.
pub(crate) fn smooth_into(
    source: &[f32],
    width: usize,
    kernel: &[f32],
    threads: Threads,
    rows: &mut Vec<Vec<f32>>,
    out: &mut Vec<f32>,
) {
    out.resize(source.len(), 0.0);
    let reach = kernel.len() - 1;
    threads.pieces(out, BAND * width, rows, |band, out, padded| {
        padded.resize(width + 2 * reach, 0.0);
        for (row, out) in out.chunks_exact_mut(width).enumerate() {
            smooth_row(source, width, band * BAND + row, kernel, padded, out);
        }
    });
}

/// Smooths row `y`: down the columns into `padded`, then along the row.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn smooth_row(source: &[f32], width: usize, y: usize, kernel: &[f32], padded: &mut [f32], out: &mut [f32]) {
    let reach = kernel.len() - 1;
    let last = source.len() / width - 1;
    let sides = |step: usize| {
        let (above, below) = (y.saturating_sub(step), (y + step).min(last));
        (&source[above * width..][..width], &source[below * width..][..width])
    };
    let column = &mut padded[reach..][..width];
    blocks(
        width,
        |x, narrow| {
            if narrow { weigh::<1>(kernel, sides, x, column) } else { weigh::<BLOCK>(kernel, sides, x, column) }
        },
    );
    let (first, end) = (padded[reach], padded[reach + width - 1]);
    padded[..reach].fill(first);
    padded[reach + width..].fill(end);
    let padded = &*padded;
    let sides = |step: usize| (&padded[reach - step..][..width], &padded[reach + step..][..width]);
    blocks(
        width,
        |x, narrow| {
            if narrow { weigh::<1>(kernel, sides, x, out) } else { weigh::<BLOCK>(kernel, sides, x, out) }
        },
    );
}

/// Calls `work(x, false)` for blocks that cover `width` from `x` on, and `work(x, true)` for single pixels.
///
/// The last block may overlap the one before. Single pixels occur if the row is narrower than a block.
#[inline(always)]
fn blocks(width: usize, mut work: impl FnMut(usize, bool)) {
    if width < BLOCK {
        (0..width).for_each(|x| work(x, true));
    } else {
        (0..width.div_ceil(BLOCK)).for_each(|block| work((block * BLOCK).min(width - BLOCK), false));
    }
}

/// The symmetric sum Σ k_i (p_{−i} + p_i) for the `N` pixels from `x` on.
#[inline(always)]
fn weigh<'a, const N: usize>(
    kernel: &[f32],
    sides: impl Fn(usize) -> (&'a [f32], &'a [f32]),
    x: usize,
    out: &mut [f32],
) {
    let mut sums = [0.0; N];
    let (centre, _) = sides(0);
    for (sum, &centre) in sums.iter_mut().zip(&centre[x..x + N]) {
        *sum = kernel[0] * centre;
    }
    for (step, &weight) in kernel.iter().enumerate().skip(1) {
        let (a, b) = sides(step);
        let (a, b) = (&a[x..x + N], &b[x..x + N]);
        for i in 0..N {
            sums[i] += weight * (a[i] + b[i]);
        }
    }
    out[x..x + N].copy_from_slice(&sums);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_sums_to_one_and_falls() {
        for sigma in [0.0, 0.3, 1.0, 2.5] {
            let half = half_kernel(sigma);
            let sum = half[0] + 2.0 * half[1..].iter().sum::<f32>();
            assert!((sum - 1.0).abs() < 1e-6, "{sigma}: {sum}");
            assert!(half.windows(2).all(|w| w[0] > w[1]));
        }
    }

    #[test]
    fn smoothing_spreads_a_point_into_the_kernel() {
        for (width, height) in [(200, 90), (41, 37), (64, 1), (1, 65)] {
            let (x, y) = (width / 2, height / 2);
            let mut source = vec![0.0; width * height];
            source[y * width + x] = 1.0;
            let kernel = half_kernel(1.2);
            let smooth = |threads| {
                let mut out = vec![f32::NAN; 3];
                smooth_into(&source, width, &kernel, threads, &mut Vec::new(), &mut out);
                out
            };
            let out = smooth(Threads::One);
            assert_eq!(smooth(Threads::Pool), out);
            let weight = |a: usize, b: usize, n: usize| {
                // An axis of one pixel is not smoothed.
                if n == 1 { 1.0 } else { kernel.get(a.abs_diff(b)).copied().unwrap_or(0.0) }
            };
            for (i, value) in out.iter().enumerate() {
                let expected = weight(i % width, x, width) * weight(i / width, y, height);
                assert!((value - expected).abs() < 1e-7, "{width}×{height} at {i}: {value}, not {expected}");
            }
        }
    }

    #[test]
    fn a_constant_stays_and_a_ramp_stays_within() {
        let ramp: Vec<f32> = (0..150 * 20).map(|i| (i % 150) as f32).collect();
        let mut out = Vec::new();
        smooth_into(&ramp, 150, &half_kernel(2.0), Threads::One, &mut Vec::new(), &mut out);
        assert!((6..144).all(|x| (out[10 * 150 + x] - x as f32).abs() < 1e-4));
        smooth_into(&[7.0; 600], 30, &half_kernel(9.0), Threads::One, &mut Vec::new(), &mut out);
        assert!(out.iter().all(|value| (value - 7.0).abs() < 1e-5));
    }
}
