//! The response of a structure tensor in a strip of the image, streamed row by row.

use multiversion::multiversion;

use super::tensor::{Measure, Weights};
use crate::image::Image;

/// The working memory of one strip, and the strongest response so far.
#[derive(Debug)]
pub(super) struct Band<'a> {
    /// The products gx gx, gx gy, gy gy of one row of a strip, with the window's margin on either side.
    pub(super) products: &'a mut [Vec<f32>; 3],
    /// The three products, smoothed along x, of as many rows as the window is high.
    pub(super) ring: &'a mut [Planes],
    pub(super) strongest: &'a mut f32,
}

/// The width of a strip: the rows of a window stay in the first-level cache.
pub(super) const STRIP: usize = 128;

/// The products xx, xy, yy of the columns of a strip, aligned to a cache line.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(super) struct Planes([f32; 3 * STRIP]);

impl Planes {
    pub(super) const ZERO: Self = Self([0.0; 3 * STRIP]);
}

/// A rectangle of the image, at most a strip wide, within the operator's margin.
#[derive(Clone)]
pub(super) struct Part<'a> {
    pub(super) image: &'a Image,
    pub(super) weights: &'a Weights,
    pub(super) measure: Measure,
    /// The image row of the first row of `out`.
    pub(super) first: usize,
    pub(super) rows: std::ops::Range<usize>,
    /// The first row that is not yet in the ring.
    pub(super) next: usize,
    pub(super) columns: std::ops::Range<usize>,
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(super) fn strip(part: &Part<'_>, out: &mut [f32], band: Band<'_>) {
    strip_in_any_lanes(part, out, band);
}

/// Computes the response of one part, row by row.
///
/// Products of gradients are smoothed along x into the ring, and along y once the ring holds all rows of a window.
/// Smoothing covers complete strips; values beyond a narrower part are computed and never read.
#[inline(always)]
fn strip_in_any_lanes(part: &Part<'_>, out: &mut [f32], band: Band<'_>) {
    let Part { image, weights, measure, first, rows, next, columns } = part;
    let (reach, half) = (weights.reach(), weights.half.as_slice());
    let Band { products, ring, strongest } = band;
    let size = ring.len();
    let count = columns.len();
    let mut tensor = Planes::ZERO;
    let mut greatest = [0.0_f32; STRIP];
    for y in *next..rows.end + reach {
        let row = |y: usize| &image.row(y)[columns.start - reach - 1..columns.end + reach + 1];
        gradient_products([row(y - 1), row(y), row(y + 1)], products);
        for (smooth, product) in ring[y % size].0.as_chunks_mut::<STRIP>().0.iter_mut().zip(products.iter()) {
            let at = |i: usize| product[i..].first_chunk::<STRIP>().expect("the length of a strip and its window");
            smooth_symmetric(smooth, half, at(reach), |step| [at(reach - step), at(reach + step)]);
        }
        if y < rows.start + reach {
            continue;
        }
        let centre = y - reach;
        let at = |y: usize| &ring[y % size].0;
        smooth_symmetric(&mut tensor.0, half, at(centre), |step| [at(centre - step), at(centre + step)]);
        let response = respond(*measure, &tensor, weights.scale);
        out[(centre - first) * image.width() + columns.start..][..count].copy_from_slice(&response[..count]);
        for (greatest, r) in greatest.iter_mut().zip(response) {
            *greatest = if r > *greatest { r } else { *greatest };
        }
    }
    *strongest = greatest[..count].iter().copied().fold(*strongest, f32::max);
}

/// The response of each tensor after multiplication by `scale`.
#[inline(always)]
fn respond(measure: Measure, tensor: &Planes, scale: f32) -> [f32; STRIP] {
    let (planes, _) = tensor.0.as_chunks::<STRIP>();
    let mut response = [0.0; STRIP];
    match measure {
        Measure::Harris { k } => {
            for (x, r) in response.iter_mut().enumerate() {
                let [xx, xy, yy] = [planes[0][x] * scale, planes[1][x] * scale, planes[2][x] * scale];
                let trace = xx + yy;
                *r = (xx * yy - xy * xy) - k * (trace * trace);
            }
        }
        Measure::SmallestEigenvalue => {
            for (x, r) in response.iter_mut().enumerate() {
                let [xx, xy, yy] = [planes[0][x] * scale, planes[1][x] * scale, planes[2][x] * scale];
                let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
                *r = mean - (half * half + xy * xy).sqrt();
            }
        }
    }
    response
}

/// Computes gx gx, gx gy, gy gy of a row, without its first and last column.
#[inline(always)]
fn gradient_products([above, here, below]: [&[f32]; 3], [xx, xy, yy]: &mut [Vec<f32>; 3]) {
    let n = here.len() - 2;
    // Sobel's operator sums eight one-pixel differences.
    const EIGHTH: f32 = 0.125;
    let [a0, a1, a2] = [&above[..n], &above[1..=n], &above[2..n + 2]];
    let [h0, h2] = [&here[..n], &here[2..n + 2]];
    let [b0, b1, b2] = [&below[..n], &below[1..=n], &below[2..n + 2]];
    let (xx, xy, yy) = (&mut xx[..n], &mut xy[..n], &mut yy[..n]);
    for x in 0..n {
        let gx = (((a2[x] - a0[x]) + (b2[x] - b0[x])) + 2.0 * (h2[x] - h0[x])) * EIGHTH;
        let gy = (((b0[x] - a0[x]) + (b2[x] - a2[x])) + 2.0 * (b1[x] - a1[x])) * EIGHTH;
        xx[x] = gx * gx;
        xy[x] = gx * gy;
        yy[x] = gy * gy;
    }
}

/// Computes out = half[0] · centre + Σ half[step] · (a + b), with the pair a, b at each step from the centre.
///
/// It is both sides of a symmetric kernel at once, summed in the order of the steps.
#[inline(always)]
fn smooth_symmetric<'a, const N: usize>(
    out: &mut [f32; N],
    half: &[f32],
    centre: &[f32; N],
    pair: impl Fn(usize) -> [&'a [f32; N]; 2],
) {
    // Several steps at a time need fewer passes over `out`.
    let (groups, rest) = half[1..].as_chunks::<3>();
    if groups.is_empty() {
        for i in 0..N {
            out[i] = half[0] * centre[i];
        }
    }
    for (index, &[u, v, w]) in groups.iter().enumerate() {
        let step = 1 + 3 * index;
        let [[a, b], [c, d], [e, f]] = [pair(step), pair(step + 1), pair(step + 2)];
        if index == 0 {
            for i in 0..N {
                out[i] = ((half[0] * centre[i] + u * (a[i] + b[i])) + v * (c[i] + d[i])) + w * (e[i] + f[i]);
            }
        } else {
            for i in 0..N {
                out[i] = ((out[i] + u * (a[i] + b[i])) + v * (c[i] + d[i])) + w * (e[i] + f[i]);
            }
        }
    }
    for (index, &u) in rest.iter().enumerate() {
        let [a, b] = pair(1 + 3 * groups.len() + index);
        for i in 0..N {
            out[i] += u * (a[i] + b[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tensor::Window;
    use super::*;
    use crate::image::random_image;

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let image = random_image(150, 40);
        for (measure, window) in
            [Measure::Harris { k: 0.04 }, Measure::SmallestEigenvalue].into_iter().zip([Window::Gaussian, Window::Box])
        {
            let weights = Weights::new(window, 1.5);
            let run = |strip: fn(&Part<'_>, &mut [f32], Band<'_>)| {
                let mut out = vec![0.0; 150 * 40];
                let mut products = [0; 3].map(|_| vec![0.0; STRIP + 2 * weights.reach()]);
                let mut ring = vec![Planes::ZERO; 2 * weights.reach() + 1];
                let band = Band { products: &mut products, ring: &mut ring, strongest: &mut 0.0 };
                let (rows, next) = (9..31, 9 - weights.reach());
                let part = Part { image: &image, weights: &weights, measure, first: 0, rows, next, columns: 11..130 };
                strip(&part, &mut out, band);
                out.iter().map(|r| r.to_bits()).collect::<Vec<_>>()
            };
            assert_eq!(run(strip), run(strip_in_any_lanes));
        }
    }
}
