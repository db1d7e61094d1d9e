//! Which places a lamp reaches: depth maps seen from the lamps.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Transform};

use super::{
    eye::Eye,
    light::Spots,
    outline::{Origin, Outline, outline},
};
use crate::optics::{Lamp, Lens, Port, Water};

/// Side of a map (px) and its focal length: 100° across.
const SIDE: u32 = 768;
const FOCAL: f64 = 322.0;
/// Places are lifted by this along their normal before they are looked up (m), against the map's steps.
const LIFT: f32 = 0.012;
/// And by this share of their depth.
const BIAS: f32 = 1.004;

/// The depth map of one lamp.
#[derive(Debug, Default)]
pub(super) struct ShadowMap {
    /// Greatest 1/Z of each pixel, 0 where nothing is.
    depths: Vec<f32>,
    outlines: Vec<Outline>,
}

/// From a camera's frame into that of a lamp's map.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShadowView {
    turn: [[f32; 3]; 3],
    step: [f32; 3],
}

/// A camera in the place of a lamp.
pub(super) fn shadow_eye() -> Eye {
    let middle = 0.5 * (f64::from(SIDE) - 1.0);
    let camera = seafix_geometry::Pinhole::new([SIDE; 2], [FOCAL; 2], [middle; 2], &[]).expect("constants");
    let clear = Water { attenuation: 0.0, ..Water::default() };
    Eye::new(Lens::new(camera, Port::default()), Vec::new(), &clear)
}

/// The turn and step from the frame that a lamp is given in, into its map's frame: z along its axis.
fn into_map(lamp: &Lamp) -> (Matrix3<f64>, Vector3<f64>) {
    let z = lamp.axis();
    let x = Vector3::y().cross(&z);
    let x = if x.norm() > 1e-3 { x.normalize() } else { Vector3::x() };
    let turn = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    (turn, -(turn * Vector3::from(lamp.at)))
}

impl ShadowView {
    /// For places in the frame of an eye, which `left_from_eye` leads into the frame of the lamp.
    pub(super) fn new(lamp: &Lamp, left_from_eye: &Transform<Camera, Camera>) -> Self {
        let (turn, step) = into_map(lamp);
        let step = turn * left_from_eye.translation() + step;
        let turn = turn * left_from_eye.rotation_matrix();
        Self {
            turn: std::array::from_fn(|i| std::array::from_fn(|j| turn[(i, j)] as f32)),
            step: std::array::from_fn(|i| step[i] as f32),
        }
    }
}

impl ShadowMap {
    /// Draws the bodies, given in the frame that the lamp is given in.
    pub(super) fn draw(&mut self, bodies: &[[Vector3<f64>; 3]], lamp: &Lamp, eye: &Eye) {
        let (turn, step) = into_map(lamp);
        self.outlines.clear();
        for corners in bodies {
            let there = corners.map(|p| turn * p + step);
            outline(there, [false; 3], Origin { facet: 0, body: 0, layer: 0 }, eye, None, &mut self.outlines);
        }
        let side = SIDE as usize;
        self.depths.clear();
        self.depths.resize(side * side, 0.0);
        for outline in &self.outlines {
            for row in outline.touched(side) {
                let v = row as f64;
                let (first, end) = outline.span(v, 0.0, side, false);
                let (base, slope) = (outline.inverse_depth(first as f64, v) as f32, outline.slope()[0] as f32);
                for (x, depth) in self.depths[row * side + first..row * side + end.max(first)].iter_mut().enumerate() {
                    *depth = depth.max(base + slope * x as i32 as f32);
                }
            }
        }
    }

    /// Share of the lamp's light that reaches place `i`, 0 to 1: bilinear over four pixels of the map.
    #[inline(always)]
    pub(super) fn reaches(&self, places: &MapPlaces, i: usize) -> f32 {
        let (u, v, own) = (places.u[i], places.v[i], places.inverse[i]);
        const LAST: f32 = SIDE as f32 - 1.0;
        if !(u >= 0.0 && v >= 0.0 && u < LAST && v < LAST) {
            return 1.0;
        }
        let (column, row) = (u as i32, v as i32);
        let (fu, fv) = (u - column as f32, v - row as f32);
        let side = SIDE as usize;
        let four = &self.depths[row as usize * side + column as usize..][..side + 2];
        let lit = |depth: f32| if depth <= own { 1.0_f32 } else { 0.0 };
        let (a, b, c, d) = (lit(four[0]), lit(four[1]), lit(four[side]), lit(four[side + 1]));
        let (above, below) = (a + fu * (b - a), c + fu * (d - c));
        above + fv * (below - above)
    }
}

/// Places of a row in a lamp's map, and their 1/Z there.
#[derive(Debug, Default)]
pub(super) struct MapPlaces {
    u: Vec<f32>,
    v: Vec<f32>,
    inverse: Vec<f32>,
}

/// Looks up where spots lie in a map.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(super) fn map_places(spots: &Spots, view: &ShadowView, out: &mut MapPlaces) {
    let n = spots.x.len();
    for list in [&mut out.u, &mut out.v, &mut out.inverse] {
        list.resize(n, 0.0);
    }
    let (x, y, z) = (&spots.x[..n], &spots.y[..n], &spots.z[..n]);
    let (nx, ny, nz) = (&spots.nx[..n], &spots.ny[..n], &spots.nz[..n]);
    let (u, v, inverse) = (&mut out.u[..n], &mut out.v[..n], &mut out.inverse[..n]);
    let middle = 0.5 * (SIDE as f32 - 1.0);
    for i in 0..n {
        let p = [x[i] + LIFT * nx[i], y[i] + LIFT * ny[i], z[i] + LIFT * nz[i]];
        let row = |k: usize| {
            let turn = &view.turn[k];
            turn[0] * p[0] + turn[1] * p[1] + turn[2] * p[2] + view.step[k]
        };
        let depth = row(2);
        // Behind the lamp: a place outside the map, which counts as lit; its cosine is none anyway.
        let scale = if depth > 0.05 { 1.0 / depth } else { -1e9 };
        u[i] = if depth > 0.05 { row(0) * scale * FOCAL as f32 + middle } else { -1.0 };
        v[i] = row(1) * scale * FOCAL as f32 + middle;
        inverse[i] = scale * BIAS;
    }
}
