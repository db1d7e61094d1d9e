//! Backscatter of the lamps' light into a camera, tabulated over view and range.

use nalgebra::Vector3;
use seafix_geometry::Pixel;

use super::{lamp::Lamp, lens::Lens, water::Water};

/// Distance of table nodes in the image (tangent of the angle).
const STEP: f64 = 0.08;
/// Number of ranges in the table.
const RANGES: usize = 48;
/// Last range of the table (m); farther water adds no visible light.
const REACH: f64 = 16.0;
/// Abscissae and weights of four-point Gauss quadrature on −1 to 1.
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// The backscatter B(u, v, r) in the pixels of one camera (Jaffe 1990; tabulated as in Song et al. 2020).
///
/// B = Σ lamps ∫₀ʳ I(θ)/r_l² · b · p(ψ) · exp(−c (r_l + s)) ds, for lamps that move with the camera. Interpolation is
/// bilinear between nodes of the image and linear between ranges, which lie densest near the camera.
#[derive(Debug, Clone)]
pub(crate) struct Backscatter {
    columns: usize,
    rows: usize,
    /// Number of nodes per pixel.
    nodes: f32,
    /// Values in the order (row, column, range).
    values: Vec<f32>,
    /// Scattered daylight over an infinite path.
    veil: f32,
    /// Whether nothing scatters.
    pub(crate) none: bool,
}

/// Range of node `k` (m).
fn range(k: usize) -> f64 {
    let t = k as f64 / (RANGES - 1) as f64;
    REACH * t * t
}

/// The integral along a ray up to each range of the table; `unit` is the unit direction.
pub(crate) fn backscatter(water: &Water, lamps: &[Lamp], from: &Vector3<f64>, unit: &Vector3<f64>) -> [f64; RANGES] {
    let (b, c) = (water.b(), water.c());
    let lamps: Vec<_> = lamps.iter().map(|l| (Vector3::from(l.at), l.axis(), l.exponent(), l.power)).collect();
    let source = |s: f64| {
        let at = from + unit * s;
        let mut sum = 0.0;
        for (place, axis, exponent, power) in &lamps {
            let offset = at - place;
            let ahead = offset.dot(axis);
            if ahead <= 0.0 {
                continue;
            }
            let r2 = offset.norm_squared().max(1e-6);
            let r = r2.sqrt();
            // Cosine of the scattering angle, from the lamp's ray into the direction of the camera.
            let angle = -offset.dot(unit) / r;
            sum += power * libm::pow(ahead / r, *exponent) / r2 * b * water.phase(angle) * libm::exp(-c * (r + s));
        }
        sum
    };
    let mut sums = [0.0; RANGES];
    for k in 1..RANGES {
        let (low, high) = (range(k - 1), range(k));
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        sums[k] = sums[k - 1] + half * GAUSS.iter().map(|(x, w)| w * source(middle + half * x)).sum::<f64>();
    }
    sums
}

impl Backscatter {
    /// Computes the table for a camera; the lamps are given in its frame.
    pub(crate) fn new(water: &Water, lamps: &[Lamp], lens: &Lens) -> Self {
        let [width, height] = lens.camera().size().map(|n| n as usize);
        let step = ((STEP * lens.camera().focal()[0]) as usize).max(4);
        let count = |n: usize| n.div_ceil(step) + 1;
        let (columns, rows) = (count(width), count(height));
        let veil = (water.ambient * water.albedo * water.phase(0.0)) as f32;
        let none = water.b() == 0.0;
        let mut values = Vec::new();
        if !none {
            values.reserve(columns * rows * RANGES);
            for row in 0..rows {
                for column in 0..columns {
                    let pixel = Pixel { u: (column * step) as f64, v: (row * step) as f64 };
                    // Nodes beyond the border may lie outside of the lens model; the nearest pixel replaces them.
                    let inside = Pixel { u: pixel.u.min(width as f64 - 1.0), v: pixel.v.min(height as f64 - 1.0) };
                    let ray = lens.ray(&pixel).or_else(|| lens.ray(&inside));
                    let sums =
                        ray.map_or([0.0; RANGES], |ray| backscatter(water, lamps, &ray.from, &ray.along.normalize()));
                    values.extend(sums.map(|x| x as f32));
                }
            }
        }
        Self { columns, rows, nodes: 1.0 / step as f32, values, veil, none }
    }

    /// Interpolates the table along one row of the image into `row`.
    pub(crate) fn along_row(&self, v: f32, row: &mut Vec<f32>) {
        row.clear();
        if self.none {
            return;
        }
        let y = (v * self.nodes).max(0.0);
        let j = (y as usize).min(self.rows - 2);
        let f = y - j as f32;
        let length = self.columns * RANGES;
        let (above, below) = (&self.values[j * length..][..length], &self.values[(j + 1) * length..][..length]);
        row.extend(above.iter().zip(below).map(|(a, b)| a + f * (b - a)));
    }

    /// The backscatter up to the ranges `r` (m) at columns `u` of the row that [`along_row`](Self::along_row) has
    /// prepared; `through` is exp(−c r).
    pub(crate) fn at(&self, row: &[f32], u: &[f32], r: &[f32], through: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.resize(u.len(), 0.0);
        if !self.none {
            textured(self, row, u, r, through, out);
        }
    }
}

/// Number of places looked up in one pass.
const CHUNK: usize = 64;

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn textured(backscatter_table: &Backscatter, row: &[f32], u: &[f32], r: &[f32], through: &[f32], out: &mut [f32]) {
    let last = backscatter_table.columns as i32 - 2;
    let (mut x, mut s) = ([0.0_f32; CHUNK], [0.0_f32; CHUNK]);
    let chunks = u.chunks(CHUNK).zip(r.chunks(CHUNK)).zip(through.chunks(CHUNK)).zip(out.chunks_mut(CHUNK));
    for (((u, r), through), out) in chunks {
        let n = out.len();
        x[..n].copy_from_slice(u);
        s[..n].copy_from_slice(r);
        let (mut place, mut across, mut along) = ([0_u32; CHUNK], [0.0_f32; CHUNK], [0.0_f32; CHUNK]);
        for i in 0..CHUNK {
            let x = (x[i] * backscatter_table.nodes).max(0.0);
            let column = (x as i32).min(last);
            across[i] = x - column as f32;
            let t = (s[i] * (1.0 / REACH as f32)).min(1.0).sqrt() * (RANGES - 1) as f32;
            let k = (t as i32).min(RANGES as i32 - 2);
            // Linear in the range itself, between its two nodes.
            let low = k as f32 * k as f32;
            along[i] = ((t * t - low) / (2 * k + 1) as f32).min(1.0);
            place[i] = (column * RANGES as i32 + k) as u32;
        }
        let mut four = [[0.0_f32; CHUNK]; 4];
        for i in 0..n {
            let near = &row[place[i] as usize..][..RANGES + 2];
            (four[0][i], four[1][i], four[2][i], four[3][i]) = (near[0], near[1], near[RANGES], near[RANGES + 1]);
        }
        let mut light = [0.0_f32; CHUNK];
        for i in 0..CHUNK {
            let near = four[0][i] + along[i] * (four[1][i] - four[0][i]);
            let next = four[2][i] + along[i] * (four[3][i] - four[2][i]);
            light[i] = near + across[i] * (next - near);
        }
        for i in 0..n {
            out[i] = light[i] + backscatter_table.veil * (1.0 - through[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::port::Port;
    use seafix_geometry::Pinhole;

    fn lens() -> Lens {
        Lens::new(Pinhole::new([256, 192], [125.0; 2], [127.5, 95.5], &[]).unwrap(), Port::default())
    }

    /// The integral by many small steps.
    fn direct(water: &Water, lamps: &[Lamp], pixel: &Pixel, reach: f64) -> f64 {
        let ray = lens().ray(pixel).unwrap();
        let unit = ray.along.normalize();
        let n = 40_000;
        let step = reach / f64::from(n);
        (0..n)
            .map(|k| {
                let s = (f64::from(k) + 0.5) * step;
                let at = unit * s;
                lamps
                    .iter()
                    .map(|lamp| {
                        let offset = at - Vector3::from(lamp.at);
                        let r = offset.norm();
                        let back = -offset.dot(&unit) / r;
                        lamp.intensity(offset.dot(&lamp.axis()) / r) / (r * r)
                            * water.b()
                            * water.phase(back)
                            * libm::exp(-water.c() * (r + s))
                            * step
                    })
                    .sum::<f64>()
            })
            .sum()
    }

    #[test]
    fn the_table_is_the_integral_to_a_percent() {
        let water = Water { attenuation: 0.6, ..Water::default() };
        let lamps = Lamp::pair(0.25);
        let backscatter_table = Backscatter::new(&water, &lamps, &lens());
        let mut row = Vec::new();
        for (u, v) in [(0.0, 0.0), (127.5, 95.5), (31.0, 150.0), (250.0, 20.0), (77.0, 103.0)] {
            for r in [0.7, 1.3, 2.0, 3.3, 5.0] {
                let exact = direct(&water, &lamps, &Pixel { u, v }, r);
                let through = libm::exp(-0.6 * r) as f32;
                backscatter_table.along_row(v as f32, &mut row);
                let mut found = Vec::new();
                backscatter_table.at(&row, &[u as f32], &[r as f32], &[through], &mut found);
                let table = f64::from(found[0]);
                assert!((table / exact - 1.0).abs() < 0.01, "{u} {v} {r}: {table} for {exact}");
            }
        }
    }

    #[test]
    fn a_lamp_behind_the_camera_gives_the_coaxial_integral() {
        // ∫ b p(π) e^{−c(D+2s)}/(D+s)² ds for a lamp at distance D behind the camera, on its axis.
        let water = Water { attenuation: 0.5, ..Water::default() };
        let near = Lamp { at: [0.0, 0.0, -20.0], aim: [0.0; 3], power: 400.0 * libm::exp(10.0), beam_deg: 110.0 };
        let sums = backscatter(&water, &[near], &Vector3::zeros(), &Vector3::z());
        let k = 20;
        let r = range(k);
        let n = 100_000;
        let exact: f64 = (0..n)
            .map(|i| {
                let s = (f64::from(i) + 0.5) * r / f64::from(n);
                400.0 / (20.0 + s).powi(2) * water.b() * water.phase(-1.0) * libm::exp(-2.0 * 0.5 * s) * r
                    / f64::from(n)
            })
            .sum();
        assert!((sums[k] / exact - 1.0).abs() < 1e-6, "{} for {exact}", sums[k]);
    }

    #[test]
    fn light_grows_with_range_to_a_limit_and_vanishes_with_scattering() {
        // Regression: a residual of 1e-6 in clear water fails this test.
        let lamps = Lamp::pair(0.25);
        let water = Water { attenuation: 1.0, ..Water::default() };
        let sums = backscatter(&water, &lamps, &Vector3::zeros(), &Vector3::z());
        assert!(sums.windows(2).all(|w| w[1] >= w[0]));
        assert!(sums[RANGES - 1] / sums[RANGES - 10] < 1.001);
        for none in [Water { attenuation: 0.0, ..Water::default() }, Water { albedo: 0.0, ..Water::default() }] {
            let mut found = Vec::new();
            Backscatter::new(&none, &lamps, &lens()).at(&[], &[3.0], &[2.0], &[1.0], &mut found);
            assert_eq!(found, [0.0]);
        }
    }
}
