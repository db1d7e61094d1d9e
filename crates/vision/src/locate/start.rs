//! A first guess of the edges that meet at a corner.

use nalgebra::{Complex, Matrix2, Vector2};

use super::model::Shape;
use crate::Image;

/// Two edges and what they part.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    /// Where they meet.
    pub(super) at: Vector2<f64>,
    /// The directions of their normals (rad).
    pub(super) normals: [f64; 2],
    /// What the plane's four parts look like.
    sectors: [Sector; 4],
}

/// The pixels on one side of each edge.
#[derive(Debug, Clone, Copy, Default)]
struct Sector {
    count: f64,
    sum: f64,
}

impl Start {
    /// The edges in the square of side 2·`half` + 1 around the pixel (x, y), which with one pixel more must
    /// lie in the image; `None` where there are not two.
    ///
    /// They meet where the gradients' lines do, Σ g gᵀ(x − p) = 0. Their directions are those of two edges
    /// that explain the moments mₖ = Σ |g|² z^k, z = exp(2i·arg g), of the gradients: z₁ and z₂ are the
    /// roots of z² − S z + P with m₁ = S m₀ − P m̄₁ and m₂ = S m₁ − P m₀ (Prony's method).
    pub(super) fn of(image: &Image, x: usize, y: usize, half: usize) -> Option<Self> {
        let mut tensor = Matrix2::zeros();
        let mut towards = Vector2::zeros();
        let (mut fourth_x, mut fourth_y) = (0.0_f32, 0.0_f32);
        let side = 2 * half + 1;
        for row in y - half..=y + half {
            let line = |y: usize| &image.row(y)[x - half - 1..][..side + 2];
            let (above, here, below) = (line(row - 1), line(row), line(row + 1));
            let dy = row as f32 - y as f32;
            let (mut xx, mut xy, mut yy, mut xd, mut yd) = (0.0_f32, 0.0_f32, 0.0_f32, 0.0_f32, 0.0_f32);
            for i in 0..side {
                let gx = (above[i + 2] - above[i]) + (below[i + 2] - below[i]) + 2.0 * (here[i + 2] - here[i]);
                let gy = (below[i] - above[i]) + (below[i + 2] - above[i + 2]) + 2.0 * (below[i + 1] - above[i + 1]);
                let dx = i as f32 - half as f32;
                let along = gx * dx + gy * dy;
                let (gxx, gxy, gyy) = (gx * gx, gx * gy, gy * gy);
                xx += gxx;
                xy += gxy;
                yy += gyy;
                xd += gx * along;
                yd += gy * along;
                let (re, im) = (gxx - gyy, 2.0 * gxy);
                let scale = 1.0 / (gxx + gyy + 1.0);
                fourth_x += (re * re - im * im) * scale;
                fourth_y += 2.0 * re * im * scale;
            }
            tensor += Matrix2::new(xx, xy, xy, yy).cast::<f64>();
            towards += Vector2::new(xd, yd).cast::<f64>();
        }
        let m0 = tensor.trace();
        let m1 = Complex::new(tensor[(0, 0)] - tensor[(1, 1)], 2.0 * tensor[(0, 1)]);
        let m2 = Complex::new(f64::from(fourth_x), f64::from(fourth_y));
        let determinant = m0 * m0 - m1.norm_sqr();
        if !(determinant > 0.02 * m0 * m0) {
            return None;
        }
        let sum = (m1 * m0 - m2 * m1.conj()) / determinant;
        let product = (m1 * m1 - m2 * m0) / determinant;
        let root = (sum * sum - product * 4.0).sqrt();
        let normals = [sum + root, sum - root].map(|z| 0.5 * libm::atan2(z.im, z.re));
        let at = tensor.try_inverse()? * towards;
        let mut start = Self { at, normals, sectors: [Sector::default(); 4] };
        start.part(image, x, y, half);
        Some(start)
    }

    /// Sums the pixels of each sector.
    fn part(&mut self, image: &Image, x: usize, y: usize, half: usize) {
        let [n1, n2] = self.normals.map(|angle| [libm::cos(angle) as f32, libm::sin(angle) as f32]);
        let at = self.at.cast::<f32>();
        for row in y - half..=y + half {
            let dy = row as f32 - y as f32 - at.y;
            for (i, value) in image.row(row)[x - half..=x + half].iter().enumerate() {
                let dx = i as f32 - half as f32 - at.x;
                let first = n1[0] * dx + n1[1] * dy > 0.0;
                let second = n2[0] * dx + n2[1] * dy > 0.0;
                let sector = &mut self.sectors[usize::from(first) + 2 * usize::from(second)];
                sector.count += 1.0;
                sector.sum += f64::from(*value);
            }
        }
    }

    /// How much of the brightness' variation a shape explains, with its bright part turned as it fits best:
    /// the sum of squares between the two parts, and the start of the fit: normals, a, b.
    pub(super) fn guess(&self, shape: Shape) -> (f64, [f64; 2], f64, f64) {
        let mut best = (0.0, self.normals, 0.0, 0.0);
        let wedges: &[usize] = if shape == Shape::Wedge { &[1, 2, 4, 8] } else { &[9] };
        for &mask in wedges {
            let [mut bright, mut dark] = [Sector::default(); 2];
            for (i, sector) in self.sectors.iter().enumerate() {
                let part = if mask >> i & 1 == 1 { &mut bright } else { &mut dark };
                part.count += sector.count;
                part.sum += sector.sum;
            }
            if bright.count.min(dark.count) < 3.0 {
                continue;
            }
            let (inside, outside) = (bright.sum / bright.count, dark.sum / dark.count);
            let difference = inside - outside;
            let explained = difference * difference * bright.count * dark.count / (bright.count + dark.count);
            if explained > best.0 {
                const PI: f64 = std::f64::consts::PI;
                // The sector's index says on which side of each edge it lies.
                let turn = |edge: usize| {
                    let behind = shape == Shape::Wedge && mask & (if edge == 0 { 0b1010 } else { 0b1100 }) == 0;
                    self.normals[edge] + if behind { PI } else { 0.0 }
                };
                let (a, b) = match shape {
                    Shape::Wedge => (outside, difference),
                    Shape::Crossing => (0.5 * (inside + outside), 0.5 * difference),
                };
                best = (explained, [turn(0), turn(1)], a, b);
            }
        }
        best
    }
}
