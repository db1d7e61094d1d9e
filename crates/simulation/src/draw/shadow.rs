//! Which places a lamp reaches: depth maps seen from the lamps.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Transform};

use super::{
    eye::Eye,
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

    /// Share of the lamp's light that reaches a place, 0 to 1: bilinear over four pixels of the map.
    #[inline]
    pub(super) fn reaches(&self, view: &ShadowView, at: [f32; 3], normal: [f32; 3]) -> f32 {
        let p: [f32; 3] = std::array::from_fn(|i| at[i] + LIFT * normal[i]);
        let there: [f32; 3] = std::array::from_fn(|i| {
            let row = &view.turn[i];
            row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + view.step[i]
        });
        if there[2] < 0.05 {
            return 1.0;
        }
        let inverse = 1.0 / there[2];
        let middle = 0.5 * (SIDE as f32 - 1.0);
        let (u, v) = (there[0] * inverse * FOCAL as f32 + middle, there[1] * inverse * FOCAL as f32 + middle);
        let last = SIDE as f32 - 1.0;
        if !(u >= 0.0 && v >= 0.0 && u < last && v < last) {
            return 1.0;
        }
        let (i, j) = (u as usize, v as usize);
        let (fu, fv) = (u - i as f32, v - j as f32);
        let own = inverse * BIAS;
        let side = SIDE as usize;
        let lit = |k: usize| if self.depths[k] <= own { 1.0 } else { 0.0 };
        let k = j * side + i;
        let (a, b, c, d): (f32, f32, f32, f32) = (lit(k), lit(k + 1), lit(k + side), lit(k + side + 1));
        let (above, below) = (a + fu * (b - a), c + fu * (d - c));
        above + fv * (below - above)
    }
}
