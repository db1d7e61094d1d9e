//! A camera for rendering: the ray of every pixel, lamps, backscatter, and the readout of rows.

use std::sync::OnceLock;

use nalgebra::{Matrix3, Vector3, Vector6};
use seafix_geometry::{Camera, Pixel, Transform};

use crate::optics::{Backscatter, Lamp, Lens, Water};

/// Number of iterations for the row in which a rolling shutter sees a point.
const ROLLING_STEPS: usize = 4;

/// A camera with its constant tables.
#[derive(Debug, Clone)]
pub(crate) struct RenderCamera {
    pub(crate) lens: Lens,
    /// The lamps in the camera's frame.
    pub(crate) lamps: Vec<Lamp>,
    backscatter: OnceLock<Backscatter>,
    water: Water,
    /// Rays of every pixel (direction x, y with z = 1; origin); empty for an ideal pinhole.
    rays: Vec<[f32; 5]>,
    /// Direction x of every column of an ideal pinhole; empty for other cameras.
    columns: Vec<f32>,
    /// Direction y of every row of an ideal pinhole; empty for other cameras.
    rows: Vec<f32>,
    /// Tangent of the maximum angle between optical axis and a ray.
    pub(crate) reach: f64,
}

/// The camera's motion during the readout, for a rolling shutter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rolling {
    /// The camera's displacement in its own frame (rotation, translation) from the first row to the last.
    pub(crate) step: Vector6<f64>,
    pub(crate) rows: f64,
}

impl Rolling {
    /// The pose of the camera at the readout of row `v`, in its frame at the middle of the readout.
    pub(crate) fn at(&self, v: f64) -> Transform<Camera, Camera> {
        Transform::exp(&(self.step * ((v + 0.5) / self.rows - 0.5)))
    }
}

/// A ray in single precision: origin, and direction with z = 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub(super) from: [f32; 3],
    pub(super) along: [f32; 3],
}

impl RenderCamera {
    pub(crate) fn new(lens: Lens, lamps: Vec<Lamp>, water: &Water) -> Self {
        let [width, height] = lens.camera().size();
        let mut rays = Vec::new();
        if !lens.is_straight() {
            rays.reserve((width * height) as usize);
            for v in 0..height {
                for u in 0..width {
                    let ray = lens.ray(&Pixel { u: f64::from(u), v: f64::from(v) });
                    // A pixel outside of the lens model gets a ray that meets nothing.
                    let (from, along) =
                        ray.map_or((Vector3::zeros(), Vector3::repeat(f64::NAN)), |r| (r.from, r.along));
                    rays.push([along.x, along.y, from.x, from.y, from.z].map(|x| x as f32));
                }
            }
        }
        let ([fx, fy], [cx, cy]) = (lens.camera().focal(), lens.camera().principal());
        let directions = |n: u32, f: f64, c: f64| (0..n).map(|k| ((f64::from(k) - c) / f) as f32).collect();
        let (columns, rows) = (directions(width, fx, cx), directions(height, fy, cy));
        let border = |n: u32| [0.0, 0.5, 1.0].map(|t| t * f64::from(n - 1));
        let reach = border(width)
            .into_iter()
            .flat_map(|u| border(height).map(|v| Pixel { u, v }))
            .filter_map(|pixel| Some(lens.ray(&pixel)?.along.xy().norm()))
            .fold(0.0, f64::max);
        Self { lens, lamps, backscatter: OnceLock::new(), water: water.clone(), rays, columns, rows, reach }
    }

    /// The backscatter table, computed at the first call.
    pub(super) fn backscatter(&self) -> &Backscatter {
        self.backscatter.get_or_init(|| Backscatter::new(&self.water, &self.lamps, &self.lens))
    }

    /// The projection of a point of the camera's frame at the middle of the readout.
    pub(crate) fn project(&self, point: &Vector3<f64>, rolling: Option<&Rolling>) -> Option<Pixel> {
        let mut pixel = self.lens.project(point)?;
        if let Some(rolling) = rolling {
            for _ in 0..ROLLING_STEPS {
                let there = rolling.at(pixel.v).inverse() * seafix_geometry::Point::from(*point);
                pixel = self.lens.project(&there.coords)?;
            }
        }
        Some(pixel)
    }

    /// Directions (x, y, 1) of the pixels in a row of an ideal pinhole: x of each, y of all.
    pub(super) fn straight(&self, row: usize) -> (&[f32], f32) {
        (&self.columns, self.rows[row])
    }

    /// The ray of an image point within half a pixel of the pixel (column, row).
    #[inline]
    pub(super) fn line(&self, column: usize, row: usize, du: f32, dv: f32) -> Line {
        let camera = self.lens.camera();
        if self.rays.is_empty() {
            let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
            let x = ((column as f64 + f64::from(du) - cx) / fx) as f32;
            let y = ((row as f64 + f64::from(dv) - cy) / fy) as f32;
            return Line { from: [0.0; 3], along: [x, y, 1.0] };
        }
        let [width, height] = camera.size().map(|n| n as usize);
        let here = &self.rays[row * width + column];
        let mut ray = *here;
        if du != 0.0 || dv != 0.0 {
            // The ray is interpolated towards the next pixel, or extrapolated from the previous one at the border.
            let place = row * width + column;
            let (i, tu) = if column + 1 < width { (place + 1, du) } else { (place - 1, -du) };
            let (j, tv) = if row + 1 < height { (place + width, dv) } else { (place - width, -dv) };
            for k in 0..5 {
                ray[k] += tu * (self.rays[i][k] - here[k]) + tv * (self.rays[j][k] - here[k]);
            }
        }
        Line { from: [ray[2], ray[3], ray[4]], along: [ray[0], ray[1], 1.0] }
    }
}

/// The pose of the camera for one row: a rotation and a translation of its rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowPose {
    turn: [[f32; 3]; 3],
    step: [f32; 3],
}

impl RowPose {
    pub(super) fn new(pose: &Transform<Camera, Camera>) -> Self {
        let turn: Matrix3<f64> = pose.rotation_matrix();
        let step = pose.translation();
        Self {
            turn: std::array::from_fn(|i| std::array::from_fn(|j| turn[(i, j)] as f32)),
            step: std::array::from_fn(|i| step[i] as f32),
        }
    }

    #[inline]
    pub(super) fn apply(&self, line: &Line) -> Line {
        let turned = |v: &[f32; 3]| -> [f32; 3] {
            std::array::from_fn(|i| self.turn[i][0] * v[0] + self.turn[i][1] * v[1] + self.turn[i][2] * v[2])
        };
        let from = turned(&line.from);
        Line { from: std::array::from_fn(|i| from[i] + self.step[i]), along: turned(&line.along) }
    }
}
