//! The determinant of the Hessian by box filters, over an octave of scales.

use multiversion::multiversion;
use nalgebra::{Matrix3, Vector3};

use super::integral::Integral;
use crate::keypoint::Keypoint;
use seafix_geometry::Pixel;

/// An octave: the image with 2ᵒ×2ᵒ pixels summed to one, under box filters of sides 9, 15, 21, ….
#[derive(Debug, Clone, Copy)]
pub(super) struct Octave<'a> {
    pub(super) integral: &'a Integral,
    /// The number o; 0 is the image itself.
    pub(super) number: usize,
    /// The unit of the integral image (grey levels).
    pub(super) unit: f32,
    /// The number of scales with maxima; one more below and above serves for comparison.
    pub(super) layers: usize,
    /// The minimum determinant (grey levels²).
    pub(super) min: f32,
}

/// A third of the side of a layer's filter: the width of its lobes.
pub(super) fn lobe(layer: usize) -> usize {
    3 + 2 * layer
}

/// The distance from the centre of a layer's filter to its border.
fn reach(layer: usize) -> usize {
    (3 * lobe(layer) - 1) / 2
}

/// The working memory of a search.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// Three rows of determinants for each layer.
    rows: Vec<f32>,
    /// The sums along the columns for xx, yy and xy.
    columns: [Vec<u32>; 3],
    /// The columns of possible maxima in a row.
    hits: Vec<usize>,
}

impl Octave<'_> {
    /// Appends the maxima in these rows.
    pub(super) fn search(&self, rows: std::ops::Range<usize>, scratch: &mut Scratch, found: &mut Vec<Keypoint>) {
        let [width, height] = self.integral.size();
        let all = self.layers + 2;
        let Scratch { rows: memory, columns, hits } = scratch;
        memory.resize(3 * all * width, 0.0);
        let slot = |layer: usize, y: usize| (layer * 3 + y % 3) * width;
        for y in rows.start.saturating_sub(1)..(rows.end + 1).min(height) {
            for layer in 0..all {
                let reach = reach(layer);
                if y >= reach && y + reach < height && 2 * reach < width {
                    self.determinants(layer, y, columns, &mut memory[slot(layer, y)..][..width]);
                }
            }
            let Some(centre) = y.checked_sub(1).filter(|y| rows.contains(y)) else { continue };
            for layer in 1..=self.layers {
                // One row more, so that all 26 neighbours exist.
                let margin = reach(layer + 1) + 1;
                if centre < margin || centre + margin >= height || 2 * margin >= width {
                    continue;
                }
                let near: [[&[f32]; 3]; 3] = std::array::from_fn(|dl| {
                    std::array::from_fn(|dy| &memory[slot(layer + dl - 1, centre + dy - 1)..][..width])
                });
                candidates(&near, self.min, margin, hits);
                found.extend(hits.iter().filter_map(|&x| self.peak(&near, layer, x, centre)));
            }
        }
    }

    /// Computes the determinants of a row at all pixels whose filter lies in the image.
    fn determinants(&self, layer: usize, y: usize, columns: &mut [Vec<u32>; 3], out: &mut [f32]) {
        let (lobe, reach) = (lobe(layer), reach(layer));
        let row = |y: usize| self.integral.row(y);
        let (top, bottom) = (y - reach, y + reach + 1);
        let [xx, yy, xy] = columns;
        for column in [&mut *xx, yy, xy] {
            column.resize(out.len() + 1, 0);
        }
        lobes([row(y + 1 - lobe), row(y + lobe)], xx);
        second([row(top), row(top + lobe), row(top + 2 * lobe), row(bottom)], yy);
        mixed([row(y - lobe), row(y), row(y + 1), row(y + lobe + 1)], xy);
        // The sum over a lobe of xx or yy, 2·lobe − 1 long, becomes its mean. The factor of xy makes the determinant of
        // a quadratic surface the same in every direction.
        let pixels = (lobe << self.number) as f32 * ((2 * lobe - 1) << self.number) as f32;
        let mean = self.unit / pixels;
        let balance = (lobe * lobe) as f32 / ((lobe + 1) * (lobe + 1)) as f32;
        let mixed_mean = self.unit * balance / ((lobe << self.number) as f32 * (lobe << self.number) as f32);
        let n = out.len() - 2 * reach;
        determinants(xx, yy, xy, lobe, [mean, mixed_mean], &mut out[reach..][..n]);
    }

    /// The subpixel maximum at a pixel, in position and scale.
    ///
    /// `None` if the pixel is no maximum, or if the quadratic through its neighbours has its vertex elsewhere.
    fn peak(&self, near: &[[&[f32]; 3]; 3], layer: usize, x: usize, y: usize) -> Option<Keypoint> {
        let at = |dl: usize, dy: usize, dx: usize| near[dl][dy][x + dx - 1];
        let response = at(1, 1, 1);
        // The first of equal values counts.
        let is_greatest = (0..27).all(|i| {
            let other = at(i / 9, i / 3 % 3, i % 3);
            i == 13 || if i < 13 { other < response } else { other <= response }
        });
        if !is_greatest {
            return None;
        }
        let [dx, dy, dl] = vertex(|dl, dy, dx| f64::from(at(dl, dy, dx)))?;
        let pitch = (1_usize << self.number) as f64;
        let place = |i: usize, d: f64| (i as f64 + d) * pitch + 0.5 * (pitch - 1.0);
        let side = (3.0 * lobe(layer) as f64 + 6.0 * dl) * pitch;
        let at = Pixel { u: place(x, dx), v: place(y, dy) };
        Some(Keypoint { at, response, scale: (1.2 / 9.0 * side) as f32 })
    }
}

/// The vertex of the quadratic through 27 values, relative to the middle one along x, y and the third dimension.
///
/// It is Newton's step with derivatives by central differences. `None` if it is longer than 1.
///
/// Source: Brown and Lowe, *Invariant features from interest point groups*, BMVC 2002.
fn vertex(at: impl Fn(usize, usize, usize) -> f64) -> Option<[f64; 3]> {
    let along = |i: usize, step: isize| {
        let mut place = [1_usize; 3];
        place[i] = place[i].wrapping_add_signed(step);
        at(place[2], place[1], place[0])
    };
    let across = |i: usize, j: usize, [a, b]: [isize; 2]| {
        let mut place = [1_usize; 3];
        place[i] = place[i].wrapping_add_signed(a);
        place[j] = place[j].wrapping_add_signed(b);
        at(place[2], place[1], place[0])
    };
    let gradient = Vector3::from_fn(|i, _| 0.5 * (along(i, 1) - along(i, -1)));
    let hessian = Matrix3::from_fn(|i, j| {
        if i == j {
            along(i, 1) + along(i, -1) - 2.0 * at(1, 1, 1)
        } else {
            0.25 * (across(i, j, [1, 1]) + across(i, j, [-1, -1]) - across(i, j, [1, -1]) - across(i, j, [-1, 1]))
        }
    });
    let step = -(hessian.try_inverse()? * gradient);
    step.iter().all(|d| d.abs() <= 1.0).then(|| step.into())
}

/// Computes the difference of two rows: the sums along the columns of the lobes of xx.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn lobes([top, bottom]: [&[u32]; 2], out: &mut [u32]) {
    for ((out, top), bottom) in out.iter_mut().zip(top).zip(bottom) {
        *out = bottom.wrapping_sub(*top);
    }
}

/// Weighs three stacked lobes by 1, −2, 1: the sum of all less three times the middle.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn second([a, b, c, d]: [&[u32]; 4], out: &mut [u32]) {
    for ((((out, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *out = d.wrapping_sub(*a).wrapping_sub(c.wrapping_sub(*b).wrapping_mul(3));
    }
}

/// Computes the lower less the upper of two stacked lobes, one pixel apart.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn mixed([a, b, c, d]: [&[u32]; 4], out: &mut [u32]) {
    for ((((out, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *out = d.wrapping_sub(*c).wrapping_sub(b.wrapping_sub(*a));
    }
}

/// Computes the determinants from the sums along the columns.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn determinants(xx: &[u32], yy: &[u32], xy: &[u32], lobe: usize, [mean, mixed]: [f32; 2], out: &mut [f32]) {
    let n = out.len();
    let reach = (3 * lobe - 1) / 2;
    let [xx0, xx1, xx2, xx3] = [&xx[..n], &xx[lobe..][..n], &xx[2 * lobe..][..n], &xx[3 * lobe..][..n]];
    let [yy0, yy1] = [&yy[reach + 1 - lobe..][..n], &yy[reach + lobe..][..n]];
    let [xy0, xy1] = [&xy[reach - lobe..][..n], &xy[reach..][..n]];
    let [xy2, xy3] = [&xy[reach + 1..][..n], &xy[reach + lobe + 1..][..n]];
    for i in 0..n {
        let xx = xx3[i].wrapping_sub(xx0[i]).wrapping_sub(xx2[i].wrapping_sub(xx1[i]).wrapping_mul(3));
        let yy = yy1[i].wrapping_sub(yy0[i]);
        let xy = xy3[i].wrapping_sub(xy2[i]).wrapping_sub(xy1[i].wrapping_sub(xy0[i]));
        let [xx, yy] = [mean * xx as i32 as f32, mean * yy as i32 as f32];
        let xy = mixed * xy as i32 as f32;
        out[i] = xx * yy - xy * xy;
    }
}

/// Finds the columns of at least `min` that no direct neighbour exceeds, except within a margin at either end.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn candidates(near: &[[&[f32]; 3]; 3], min: f32, margin: usize, hits: &mut Vec<usize>) {
    hits.clear();
    let n = near[1][1].len() - 2 * margin;
    let here = &near[1][1][margin..][..n];
    let [left, right] = [&near[1][1][margin - 1..][..n], &near[1][1][margin + 1..][..n]];
    let [above, below] = [&near[1][0][margin..][..n], &near[1][2][margin..][..n]];
    let [finer, coarser] = [&near[0][1][margin..][..n], &near[2][1][margin..][..n]];
    let mut may = [0_u32; BLOCK];
    for block in (0..n).step_by(BLOCK) {
        let end = (block + BLOCK).min(n);
        let mut any = 0;
        for i in block..end {
            let greatest = (here[i] > min)
                & (here[i] > left[i])
                & (here[i] >= right[i])
                & (here[i] > above[i])
                & (here[i] >= below[i])
                & (here[i] > finer[i])
                & (here[i] >= coarser[i]);
            may[i - block] = u32::from(greatest);
            any |= u32::from(greatest);
        }
        if any != 0 {
            for i in block..end {
                if may[i - block] != 0 {
                    hits.push(margin + i);
                }
            }
        }
    }
}

/// The number of columns that are tested together.
const BLOCK: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    /// The determinant at the centre of a 64×64 image by the filter of a layer.
    fn determinant(layer: usize, number: usize, f: impl Fn(i32, i32) -> i32) -> f32 {
        let image = Image::new(64, 64, (0..64 * 64).map(|i| f(i % 64, i / 64) as f32).collect()).unwrap();
        let mut integral = Integral::default();
        let unit = integral.fill(&image, 2000.0);
        for _ in 0..number {
            let mut half = Integral::default();
            half.fill_half(&integral);
            integral = half;
        }
        let octave = Octave { integral: &integral, number, unit, layers: 1, min: 0.0 };
        let size = 64 >> number;
        let mut out = vec![0.0; size];
        octave.determinants(layer, size / 2, &mut Default::default(), &mut out);
        out[size / 2]
    }

    #[test]
    fn a_quadratic_surface_has_its_determinant_in_every_direction() {
        for layer in 0..4 {
            for number in 0..2 {
                // Second differences of means, a lobe's width apart, are the second derivative × width².
                let width = (lobe(layer) << number) as f32;
                if 3.0 * width > 62.0 {
                    continue;
                }
                let bowl = determinant(layer, number, |x, y| x * x + y * y) / width.powi(4);
                assert!((bowl - 4.0).abs() < 1e-3, "{layer} {number}: {bowl}");
                let saddle = determinant(layer, number, |x, y| x * x - y * y) / width.powi(4);
                assert!((saddle + 4.0).abs() < 1e-3, "{layer} {number}: {saddle}");
                let turned = determinant(layer, number, |x, y| 2 * x * y) / width.powi(4);
                assert!((turned + 4.0).abs() < 1e-3, "{layer} {number}: {turned}");
                let ramp = determinant(layer, number, |x, y| 3 * x - 2 * y);
                assert_eq!(ramp, 0.0);
            }
        }
    }

    #[test]
    fn a_quadratic_has_its_vertex_where_it_is() {
        let value = |dx: f64, dy: f64, dl: f64| {
            move |l: usize, y: usize, x: usize| {
                let (x, y, l) = (x as f64 - 1.0 - dx, y as f64 - 1.0 - dy, l as f64 - 1.0 - dl);
                5.0 - 2.0 * x * x - y * y - 3.0 * l * l + x * y - 0.5 * y * l
            }
        };
        let found = vertex(value(0.3, -0.2, 0.45)).unwrap();
        assert!(found.iter().zip([0.3, -0.2, 0.45]).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert_eq!(vertex(value(0.3, 1.2, 0.0)), None, "the vertex is more than one sample away");
        assert_eq!(vertex(|_, _, _| 1.0), None, "nothing curves");
    }
}
