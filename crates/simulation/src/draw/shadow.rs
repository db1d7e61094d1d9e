//! Which places a lamp reaches: depth maps seen from the lamps.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Transform};

use super::{
    eye::Eye,
    facet::Spots,
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
}

/// Places that are looked up at once.
const CHUNK: usize = 64;

/// Multiplies the light of a lamp at places by the share that reaches each, 0 to 1: bilinear over four pixels of
/// its map.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(super) fn cast(map: &ShadowMap, view: &ShadowView, spots: &Spots, light: &mut [f32]) {
    const MIDDLE: f32 = 0.5 * (SIDE as f32 - 1.0);
    const LAST: f32 = SIDE as f32 - 1.0;
    const WIDE: usize = SIDE as usize;
    let lists = [&spots.x, &spots.y, &spots.z, &spots.nx, &spots.ny, &spots.nz];
    let mut at = [[0.0_f32; CHUNK]; 6];
    for (k, light) in light.chunks_mut(CHUNK).enumerate() {
        let n = light.len();
        for (at, list) in at.iter_mut().zip(lists) {
            at[..n].copy_from_slice(&list[k * CHUNK..][..n]);
        }
        let [x, y, z, nx, ny, nz] = &at;
        let (mut place, mut own) = ([0_u32; CHUNK], [0.0_f32; CHUNK]);
        let (mut across, mut down) = ([0.0_f32; CHUNK], [0.0_f32; CHUNK]);
        for i in 0..CHUNK {
            let p = [x[i] + LIFT * nx[i], y[i] + LIFT * ny[i], z[i] + LIFT * nz[i]];
            let row = |k: usize| {
                let turn = &view.turn[k];
                turn[0] * p[0] + turn[1] * p[1] + turn[2] * p[2] + view.step[k]
            };
            let depth = row(2);
            let scale = 1.0 / depth.max(0.05);
            let (u, v) = (row(0) * scale * FOCAL as f32 + MIDDLE, row(1) * scale * FOCAL as f32 + MIDDLE);
            // Outside the map counts as lit; behind the lamp its beam has nothing anyway.
            let inside = (depth > 0.05) & (u >= 0.0) & (v >= 0.0) & (u < LAST) & (v < LAST);
            let (u, v) = (if inside { u } else { 0.0 }, if inside { v } else { 0.0 });
            let (column, row) = (u as i32, v as i32);
            (across[i], down[i]) = (u - column as f32, v - row as f32);
            place[i] = (row * SIDE as i32 + column) as u32;
            own[i] = if inside { scale * BIAS } else { f32::INFINITY };
        }
        let mut four = [[0.0_f32; CHUNK]; 4];
        for i in 0..n {
            let near = &map.depths[place[i] as usize..][..WIDE + 2];
            (four[0][i], four[1][i], four[2][i], four[3][i]) = (near[0], near[1], near[WIDE], near[WIDE + 1]);
        }
        let mut share = [0.0_f32; CHUNK];
        for i in 0..CHUNK {
            let lit = |depth: f32| if depth <= own[i] { 1.0_f32 } else { 0.0 };
            let [a, b, c, d] = [lit(four[0][i]), lit(four[1][i]), lit(four[2][i]), lit(four[3][i])];
            let (above, below) = (a + across[i] * (b - a), c + across[i] * (d - c));
            share[i] = above + down[i] * (below - above);
        }
        light.iter_mut().zip(&share).for_each(|(light, share)| *light *= share);
    }
}
