//! The relief of the seabed: gentle waves on a triangle grid.

use nalgebra::Vector3;

use crate::{
    scene::mesh::Triangle,
    stream::{Purpose, Stream},
};

/// Side of a grid cell (m); its rising diagonal divides it into two triangles.
const CELL: f64 = 0.25;

/// One wave of the relief: amplitude (m), wave vector (rad/m), phase.
#[derive(Debug, Clone, Copy)]
struct Wave {
    amplitude: f64,
    north: f64,
    east: f64,
    phase: f64,
}

/// The seabed. Its surface consists of the triangles, so rays and pixels see the same surface.
#[derive(Debug, Clone)]
pub(crate) struct Seabed {
    depth: f64,
    waves: Vec<Wave>,
    mounds: Vec<Mound>,
}

/// Silt around a place: `height` (m) up to `radius` (m), falling to 0 at twice the radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mound {
    pub(crate) centre: [f64; 2],
    pub(crate) radius: f64,
    pub(crate) height: f64,
}

impl Mound {
    /// Height and slopes at a place, by a smoothstep between the two radii.
    fn rise(&self, north: f64, east: f64) -> (f64, [f64; 2]) {
        let (x, y) = (north - self.centre[0], east - self.centre[1]);
        let away = (x * x + y * y).sqrt();
        let t = (2.0 - away / self.radius).clamp(0.0, 1.0);
        let slope = -self.height * 6.0 * t * (1.0 - t) / self.radius / away.max(1e-9);
        (self.height * t * t * (3.0 - 2.0 * t), [slope * x, slope * y])
    }
}

/// A rectangle of the seabed's grid, for one image.
#[derive(Debug, Clone)]
pub(crate) struct Patch {
    first: [i64; 2],
    count: [usize; 2],
    down: Vec<f64>,
    brightness: Vec<f32>,
}

impl Seabed {
    /// The seabed at this mean depth (m).
    pub(crate) fn new(depth: f64, seed: u64) -> Self {
        Self::with_relief(depth, 1.0, seed)
    }

    /// The seabed with waves scaled by `relief`: 0 is flat.
    pub(crate) fn with_relief(depth: f64, relief: f64, seed: u64) -> Self {
        let mut stream = Stream::new(seed, 0, 0, Purpose::Relief);
        let waves = [9.0, 6.1, 4.3, 3.1].map(|length| {
            let (sine, cosine) = libm::sincos(stream.between(0.0, std::f64::consts::TAU));
            let k = std::f64::consts::TAU / length;
            Wave {
                amplitude: 0.003 * length * relief,
                north: k * cosine,
                east: k * sine,
                phase: stream.between(0.0, std::f64::consts::TAU),
            }
        });
        Self { depth, waves: waves.to_vec(), mounds: Vec::new() }
    }

    /// The seabed with silt upon it.
    pub(crate) fn silted(mut self, mounds: Vec<Mound>) -> Self {
        self.mounds = mounds;
        self
    }

    /// The mean depth (m).
    pub(crate) fn depth(&self) -> f64 {
        self.depth
    }

    /// Maximum height above the mean seabed (m).
    pub(crate) fn crest(&self) -> f64 {
        self.waves.iter().map(|w| w.amplitude).sum::<f64>() + self.mounds.iter().map(|m| m.height).fold(0.0, f64::max)
    }

    /// Depth and slopes at a grid vertex.
    fn vertex(&self, i: i64, j: i64) -> (f64, [f64; 2]) {
        let (north, east) = (i as f64 * CELL, j as f64 * CELL);
        let (mut down, mut slope) = (self.depth, [0.0; 2]);
        for w in &self.waves {
            let (sine, cosine) = libm::sincos(w.north * north + w.east * east + w.phase);
            down += w.amplitude * sine;
            slope[0] += w.amplitude * w.north * cosine;
            slope[1] += w.amplitude * w.east * cosine;
        }
        // Overlapping mounds do not add up; the highest counts.
        let rises = self.mounds.iter().map(|m| m.rise(north, east));
        if let Some((rise, [x, y])) = rises.max_by(|a, b| a.0.total_cmp(&b.0)) {
            down -= rise;
            (slope[0], slope[1]) = (slope[0] - x, slope[1] - y);
        }
        (down, slope)
    }

    /// Depth of the surface at a place (m), and the slopes of its triangle.
    fn surface(&self, north: f64, east: f64) -> (f64, [f64; 2]) {
        let (x, y) = (north / CELL, east / CELL);
        let (i, j) = (x.floor(), y.floor());
        let (fx, fy) = (x - i, y - j);
        let (i, j) = (i as i64, j as i64);
        let (origin, far) = (self.vertex(i, j).0, self.vertex(i + 1, j + 1).0);
        let [rise_x, rise_y] = if fx >= fy {
            let side = self.vertex(i + 1, j).0;
            [side - origin, far - side]
        } else {
            let side = self.vertex(i, j + 1).0;
            [far - side, side - origin]
        };
        (origin + fx * rise_x + fy * rise_y, [rise_x / CELL, rise_y / CELL])
    }

    /// Depth of the surface at a place (m).
    pub(crate) fn down(&self, north: f64, east: f64) -> f64 {
        self.surface(north, east).0
    }

    /// The t > 0 at which `from + t·along` meets the seabed from above.
    pub(crate) fn hit(&self, from: &Vector3<f64>, along: &Vector3<f64>) -> Option<f64> {
        if along.z <= 0.15 * along.norm() {
            return None; // nearly level or upwards: the waves' slopes stay below 0.08, so no seabed is within sight
        }
        let mut t = (self.depth - from.z) / along.z;
        // Newton's iteration on the triangles. It is exact on the right triangle, which gentle slopes make it reach at
        // once.
        for _ in 0..20 {
            let at = from + along * t;
            let (down, [north, east]) = self.surface(at.x, at.y);
            let step = (down - at.z) / (along.z - north * along.x - east * along.y);
            t += step;
            if step.abs() * along.norm() < 1e-13 {
                break;
            }
        }
        (t > 0.0).then_some(t)
    }

    /// Adds the triangles over the rectangle from `low` to `high` (north, east), shaded as a smooth surface.
    pub(crate) fn sheet(&self, low: [f64; 2], high: [f64; 2], skin: u32, out: &mut Vec<Triangle>) {
        let [i0, j0] = low.map(|x| (x / CELL).floor() as i64);
        let [i1, j1] = high.map(|x| (x / CELL).ceil() as i64);
        let corner = |i: i64, j: i64| {
            let (down, [north, east]) = self.vertex(i, j);
            let at = Vector3::new(i as f64 * CELL, j as f64 * CELL, down);
            (at, Vector3::new(north, east, -1.0).normalize())
        };
        let mut add = |corners: [(Vector3<f64>, Vector3<f64>); 3]| {
            let (at, normals) = (corners.map(|c| c.0), corners.map(|c| c.1));
            let uv = at.map(|p| [p.x, p.y]);
            out.push(Triangle { at, normals, uv, skin, edges: [false; 3], layer: 0 });
        };
        for i in i0..i1 {
            let mut before = (corner(i, j0), corner(i + 1, j0));
            for j in j0..j1 {
                let after = (corner(i, j + 1), corner(i + 1, j + 1));
                // The same diagonal as in `surface`; seen from above (z is down) the corners are anticlockwise.
                add([before.0, after.1, before.1]);
                add([before.0, after.0, after.1]);
                before = after;
            }
        }
    }

    /// The grid over the rectangle from `low` to `high` (north, east); `tone` gives the brightness from place and
    /// normal.
    pub(crate) fn patch(&self, low: [f64; 2], high: [f64; 2], tone: impl Fn([f64; 2], &Vector3<f64>) -> f32) -> Patch {
        let first = low.map(|x| (x / CELL).floor() as i64);
        let last = high.map(|x| (x / CELL).ceil() as i64);
        let count = [(last[0] - first[0]).max(1) as usize + 1, (last[1] - first[1]).max(1) as usize + 1];
        let (mut down, mut brightness) = (Vec::new(), Vec::new());
        for i in 0..count[0] {
            for j in 0..count[1] {
                let vertex = [first[0] + i as i64, first[1] + j as i64];
                let (z, [north, east]) = self.vertex(vertex[0], vertex[1]);
                down.push(z);
                let normal = Vector3::new(north, east, -1.0).normalize();
                brightness.push(tone(vertex.map(|n| n as f64 * CELL), &normal));
            }
        }
        Patch { first, count, down, brightness }
    }
}

impl Patch {
    /// The triangles of the patch.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [Vector3<f64>; 3]> + '_ {
        let [rows, columns] = self.count;
        let corner = move |i: usize, j: usize| {
            Vector3::new(
                (self.first[0] + i as i64) as f64 * CELL,
                (self.first[1] + j as i64) as f64 * CELL,
                self.down[i * columns + j],
            )
        };
        (0..rows - 1).flat_map(move |i| {
            (0..columns - 1).flat_map(move |j| {
                let (a, b, c, d) = (corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1));
                [[a, b, c], [a, c, d]]
            })
        })
    }

    /// The brightness at many places (north, east), with the bits of [`brightness`](Self::brightness).
    pub(crate) fn brightnesses(&self, north: &[f64], east: &[f64], out: &mut Vec<f32>) {
        out.clear();
        out.resize(north.len(), 0.0);
        brightnesses(self, north, east, out);
    }

    /// The brightness at a place, interpolated smoothly over the triangles.
    pub(crate) fn brightness(&self, north: f64, east: f64) -> f32 {
        let at = |x: f64, first: i64, count: usize| {
            let x = (x / CELL - first as f64).clamp(0.0, (count - 1) as f64);
            let cell = (x as usize).min(count - 2);
            (cell, (x - cell as f64) as f32)
        };
        let (i, fx) = at(north, self.first[0], self.count[0]);
        let (j, fy) = at(east, self.first[1], self.count[1]);
        let row = |i: usize| {
            let start = i * self.count[1] + j;
            self.brightness[start] + fy * (self.brightness[start + 1] - self.brightness[start])
        };
        row(i) + fx * (row(i + 1) - row(i))
    }
}

/// Number of places looked up in one pass.
const CHUNK: usize = 32;

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn brightnesses(patch: &Patch, north: &[f64], east: &[f64], out: &mut [f32]) {
    let ([first_north, first_east], [rows, columns]) = (patch.first.map(|n| n as f64), patch.count.map(|n| n as i32));
    let (max_north, max_east) = (f64::from(rows - 1), f64::from(columns - 1));
    let (mut x, mut y) = ([0.0; CHUNK], [0.0; CHUNK]);
    for ((north, east), out) in north.chunks(CHUNK).zip(east.chunks(CHUNK)).zip(out.chunks_mut(CHUNK)) {
        let n = out.len();
        x[..n].copy_from_slice(north);
        y[..n].copy_from_slice(east);
        let (mut fx, mut fy, mut place) = ([0.0_f32; CHUNK], [0.0_f32; CHUNK], [0_i32; CHUNK]);
        for i in 0..CHUNK {
            let u = (x[i] / CELL - first_north).clamp(0.0, max_north);
            let v = (y[i] / CELL - first_east).clamp(0.0, max_east);
            let (row, column) = ((u as i32).min(rows - 2), (v as i32).min(columns - 2));
            (fx[i], fy[i]) = ((u - f64::from(row)) as f32, (v - f64::from(column)) as f32);
            place[i] = row * columns + column;
        }
        // A separate look-up loop leaves whole vectors to the loops around it.
        let mut four = [[0.0_f32; CHUNK]; 4];
        for i in 0..n {
            let above = &patch.brightness[place[i] as usize..][..columns as usize + 2];
            let wide = columns as usize;
            (four[0][i], four[1][i], four[2][i], four[3][i]) = (above[0], above[1], above[wide], above[wide + 1]);
        }
        for (i, out) in out.iter_mut().enumerate() {
            let above = four[0][i] + fy[i] * (four[1][i] - four[0][i]);
            let below = four[2][i] + fy[i] * (four[3][i] - four[2][i]);
            *out = above + fx[i] * (below - above);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_places_are_as_bright_as_each() {
        let patch = Seabed::new(40.0, 3).patch([-1.0, -2.0], [1.0, 3.0], |[x, y], normal| (x * y + normal.x) as f32);
        let of = |step: f64| (0..500).map(|k| f64::from(k) * step - 3.0).collect::<Vec<_>>();
        let (north, east, mut all) = (of(0.013), of(0.0171), Vec::new());
        patch.brightnesses(&north, &east, &mut all);
        for k in 0..500 {
            assert_eq!(all[k].to_bits(), patch.brightness(north[k], east[k]).to_bits(), "{k}");
        }
    }

    #[test]
    fn a_ray_ends_on_the_surface() {
        let seabed = Seabed::new(40.0, 3);
        let from = Vector3::new(1.0, -2.0, 36.0);
        for k in 0..200 {
            let k = f64::from(k);
            let along = Vector3::new(0.6 * libm::cos(k), 0.7 * libm::sin(2.3 * k), 1.0);
            let at = from + along * seabed.hit(&from, &along).unwrap();
            assert!((at.z - seabed.down(at.x, at.y)).abs() < 1e-12);
            assert!((at.z - 40.0).abs() <= seabed.crest());
        }
        assert_eq!(seabed.hit(&from, &Vector3::new(1.0, 0.0, -0.1)), None);
    }

    #[test]
    fn the_surface_passes_through_the_triangles_of_a_patch() {
        let seabed = Seabed::new(40.0, 3);
        for [a, b, c] in seabed.patch([-1.0, -1.0], [1.0, 1.0], |_, _| 1.0).triangles() {
            let centre = (a + b + c) / 3.0;
            assert!((seabed.down(centre.x, centre.y) - centre.z).abs() < 1e-12);
        }
    }
}
