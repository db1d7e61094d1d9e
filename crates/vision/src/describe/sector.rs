//! The dominant orientation around a key point, by a sliding sector.

use multiversion::multiversion;
use seafix_geometry::Pixel;

use super::cells::{Cells, Grid};
use crate::image::Image;

/// SURF's orientation: the dominant gradient direction around a key point.
///
/// Haar wavelets of 4 s give gradients at the 113 points of a grid of pitch s within 6 s, weighted by a Gaussian of 2.5
/// s. A sector of 60° rotates in steps of 5°, and the gradients in it are summed; the longest sum is the orientation.
///
/// Source: Bay, Tuytelaars and Van Gool, *SURF: speeded up robust features*, ECCV 2006.
#[derive(Debug)]
pub(super) struct Sectors {
    /// The Gaussian weight of each point; 0 for the padding of the last block.
    weights: [f32; PLACES],
    /// The directions of the sectors.
    centres: [[f32; 2]; SECTORS],
}

/// The number of points within the circle.
const WITHIN: usize = 113;
/// The number of points with padding to blocks of 16.
const PLACES: usize = WITHIN.next_multiple_of(16);
/// The number of points along the diameter.
const ACROSS: usize = 13;
/// The number of cells along the side of the square that all wavelets cover.
const SIDE: usize = ACROSS + 3;
/// The number of sectors in a turn, a multiple of four, so that a quarter turn is an integer number of steps.
const SECTORS: usize = 72;

/// The column and the row of each point.
const DISC: [[usize; 2]; WITHIN] = {
    let mut disc = [[0; 2]; WITHIN];
    let (mut found, mut i) = (0, 0);
    while i < ACROSS * ACROSS {
        let (x, y) = (i / ACROSS, i % ACROSS);
        let (dx, dy) = (x.abs_diff(ACROSS / 2), y.abs_diff(ACROSS / 2));
        if dx * dx + dy * dy <= (ACROSS / 2) * (ACROSS / 2) {
            disc[found] = [x, y];
            found += 1;
        }
        i += 1;
    }
    assert!(found == WITHIN);
    disc
};

impl Default for Sectors {
    fn default() -> Self {
        let weight = |x: usize| {
            let step = x as f64 - (ACROSS / 2) as f64;
            libm::exp(-0.5 * step * step / (2.5 * 2.5))
        };
        let weights = std::array::from_fn(|i| DISC.get(i).map_or(0.0, |&[x, y]| (weight(x) * weight(y)) as f32));
        let quarter = SECTORS / 4;
        let centres = std::array::from_fn(|i| {
            let angle = (i % quarter) as f64 * (2.0 * std::f64::consts::PI / SECTORS as f64);
            let (sin, cos) = libm::sincos(angle);
            let (cos, sin) = (cos as f32, sin as f32);
            [[cos, sin], [-sin, cos], [-cos, -sin], [sin, -cos]][i / quarter]
        });
        Self { weights, centres }
    }
}

impl Sectors {
    /// The orientation (cos, sin) at a position; (1, 0) in a flat region.
    pub(super) fn orientation(&self, image: &Image, at: Pixel, step: f64, sums: &mut Vec<f32>) -> [f64; 2] {
        let mut cells = [[0.0; SIDE]; SIDE];
        Grid::new(at, step).upright(image, sums, &mut cells);
        let [x, y] = longest(&cells, &self.weights, &self.centres).map(f64::from);
        let length = (x * x + y * y).sqrt();
        // The condition is false for NaN too.
        if length > 0.0 && length < f64::INFINITY { [x / length, y / length] } else { [1.0, 0.0] }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn longest(cells: &Cells<SIDE, SIDE>, weights: &[f32; PLACES], centres: &[[f32; 2]; SECTORS]) -> [f32; 2] {
    // The gradients at all points of the square, [column][row].
    let mut gradients = [[[0.0_f32; ACROSS]; 2]; ACROSS];
    for (x, gradients) in gradients.iter_mut().enumerate() {
        let [a, b, c, d] = [&cells[x], &cells[x + 1], &cells[x + 2], &cells[x + 3]];
        let mut right = [0.0; SIDE];
        let mut all = [0.0; SIDE];
        for y in 0..SIDE {
            right[y] = (c[y] + d[y]) - (a[y] + b[y]);
            all[y] = (c[y] + d[y]) + (a[y] + b[y]);
        }
        for y in 0..ACROSS {
            gradients[0][y] = (right[y] + right[y + 1]) + (right[y + 2] + right[y + 3]);
            gradients[1][y] = (all[y + 2] + all[y + 3]) - (all[y] + all[y + 1]);
        }
    }
    let mut gx = [0.0; PLACES];
    let mut gy = [0.0; PLACES];
    for (i, [x, y]) in DISC.into_iter().enumerate() {
        gx[i] = gradients[x][0][y];
        gy[i] = gradients[x][1][y];
    }
    // A gradient g lies in the sector around c if g·c > |g| cos 30°.
    let mut min = [0.0; PLACES];
    for i in 0..PLACES {
        gx[i] *= weights[i];
        gy[i] *= weights[i];
        min[i] = COS_30 * (gx[i] * gx[i] + gy[i] * gy[i]).sqrt();
    }
    let mut best = [0.0_f32; 3];
    for &[cos, sin] in centres {
        let (mut sum_x, mut sum_y) = ([0.0_f32; 16], [0.0_f32; 16]);
        for block in 0..PLACES / 16 {
            for (lane, (sum_x, sum_y)) in sum_x.iter_mut().zip(&mut sum_y).enumerate() {
                let i = 16 * block + lane;
                let inside = gx[i] * cos + gy[i] * sin > min[i];
                *sum_x += if inside { gx[i] } else { 0.0 };
                *sum_y += if inside { gy[i] } else { 0.0 };
            }
        }
        let (mut x, mut y) = (0.0, 0.0);
        for (sum_x, sum_y) in sum_x.iter().zip(&sum_y) {
            x += sum_x;
            y += sum_y;
        }
        let squared = x * x + y * y;
        if squared > best[0] {
            best = [squared, x, y];
        }
    }
    [best[1], best[2]]
}

/// The cosine of half the sector, 30°.
const COS_30: f32 = 0.866_025_4;

#[cfg(test)]
mod tests {
    use super::*;

    fn orientation(f: impl Fn(f64, f64) -> f64) -> [f64; 2] {
        let pixels = (0..60 * 60).map(|i| f(f64::from(i % 60), f64::from(i / 60)) as f32).collect();
        let image = Image::new(60, 60, pixels).unwrap();
        Sectors::default().orientation(&image, Pixel { u: 30.2, v: 28.9 }, 1.7, &mut Vec::new())
    }

    #[test]
    fn a_ramp_is_oriented_along_its_gradient() {
        for [x, y] in [[1.0, 0.0], [0.0, 1.0], [-0.6, 0.8], [0.28, -0.96]] {
            let [cos, sin] = orientation(|u, v| 100.0 + x * u + y * v);
            assert!((cos - x).abs() + (sin - y).abs() < 1e-4, "{cos} {sin}, not {x} {y}");
        }
        assert_eq!(orientation(|_, _| 7.0), [1.0, 0.0]);
    }

    #[test]
    fn of_two_directions_the_stronger_wins() {
        // A ramp to the right on the left of the key point, and one twice as steep downwards on its right.
        let [cos, sin] = orientation(|u, v| if u < 30.0 { u } else { 30.0 + 2.0 * (v - 30.0) });
        assert!(sin > 0.98, "{cos} {sin}");
    }
}
