//! Shadow maps: depth maps seen from the lamps.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Transform};

use super::{
    camera::RenderCamera,
    facet::Spots,
    outline::{Origin, Outline, outline},
};
use crate::optics::{Lamp, Lens, Port, Water};

/// Side of a map (px).
const SIDE: u32 = 1024;
/// Focal length of a map (px), for a field of view of 100°.
const FOCAL: f64 = 430.0;
/// Relative depth bias of the shadow test, which absorbs the rounding of the map.
const BIAS: f32 = 1.002;
/// Maximum relative step of a surface's 1/Z between pixels of the map.
const STEEPEST: f32 = 0.02;
/// Side of a block of map pixels that are summarised together (px).
const BLOCK: usize = 8;
/// Number of map pixels before a block with which its places compare.
const BEFORE: usize = 1;
/// Number of map pixels after a block with which its places compare.
const AFTER: usize = 2;
/// Number of blocks along a side of a map.
const BLOCKS: usize = SIDE as usize / BLOCK;

/// The depth map of one lamp.
#[derive(Debug, Default)]
pub(super) struct ShadowMap {
    /// Maximum 1/Z of each pixel; 0 for an empty pixel.
    depths: Vec<f32>,
    /// Minimum and maximum over all pixels that places in a block compare with.
    blocks: Vec<[f32; 2]>,
    /// Minimum and maximum of each column in a row of blocks.
    columns: Vec<[f32; 2]>,
    outlines: Vec<Outline>,
}

/// The transform from a camera's frame to that of a lamp's map.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShadowView {
    turn: [[f32; 3]; 3],
    step: [f32; 3],
}

/// A camera at the position of a lamp.
pub(super) fn shadow_camera() -> RenderCamera {
    let middle = 0.5 * (f64::from(SIDE) - 1.0);
    let camera = seafix_geometry::Pinhole::new([SIDE; 2], [FOCAL; 2], [middle; 2], &[]).expect("constants");
    let clear = Water { attenuation: 0.0, ..Water::default() };
    RenderCamera::new(Lens::new(camera, Port::default()), Vec::new(), &clear)
}

/// Rotation and translation from the frame of the lamps to the map's frame, whose z is the lamp's axis.
fn into_map(lamp: &Lamp) -> (Matrix3<f64>, Vector3<f64>) {
    let z = lamp.axis();
    let x = Vector3::y().cross(&z);
    let x = if x.norm() > 1e-3 { x.normalize() } else { Vector3::x() };
    let turn = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    (turn, -(turn * Vector3::from(lamp.at)))
}

impl ShadowView {
    /// The transform for places in a camera's frame; `left_from_view` maps that frame to the lamps'.
    pub(super) fn new(lamp: &Lamp, left_from_view: &Transform<Camera, Camera>) -> Self {
        let (turn, step) = into_map(lamp);
        let step = turn * left_from_view.translation() + step;
        let turn = turn * left_from_view.rotation_matrix();
        Self {
            turn: std::array::from_fn(|i| std::array::from_fn(|j| turn[(i, j)] as f32)),
            step: std::array::from_fn(|i| step[i] as f32),
        }
    }
}

impl ShadowMap {
    /// Renders the bodies, given in the frame of the lamps.
    pub(super) fn draw(&mut self, bodies: &[[Vector3<f64>; 3]], lamp: &Lamp, camera_model: &RenderCamera) {
        let (turn, step) = into_map(lamp);
        self.outlines.clear();
        for corners in bodies {
            let there = corners.map(|p| turn * p + step);
            outline(there, [false; 3], Origin { facet: 0, body: 0, layer: 0 }, camera_model, None, &mut self.outlines);
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
        self.sum_up();
    }

    /// Minimum and maximum depth about each block.
    fn sum_up(&mut self) {
        const WIDE: usize = SIDE as usize;
        let about = |k: usize| (k * BLOCK).saturating_sub(BEFORE)..((k + 1) * BLOCK + AFTER).min(WIDE);
        let Self { depths, blocks, columns, .. } = self;
        blocks.clear();
        for k in 0..BLOCKS {
            columns.clear();
            columns.resize(WIDE, [f32::INFINITY, 0.0]);
            for row in depths[about(k).start * WIDE..about(k).end * WIDE].chunks_exact(WIDE) {
                columns.iter_mut().zip(row).for_each(|(sum, here)| join(sum, [*here; 2]));
            }
            blocks.extend((0..BLOCKS).map(|k| {
                let mut sum = [f32::INFINITY, 0.0];
                columns[about(k)].iter().for_each(|here| join(&mut sum, *here));
                sum
            }));
        }
    }
}

/// Extends a range to include another.
#[inline(always)]
fn join(sum: &mut [f32; 2], here: [f32; 2]) {
    *sum = [if here[0] < sum[0] { here[0] } else { sum[0] }, if here[1] > sum[1] { here[1] } else { sum[1] }];
}

/// Number of places tested in one pass.
const CHUNK: usize = 64;

/// A place in a map: its pixel, its 1/Z, and the steps of its surface's 1/Z per pixel.
#[derive(Clone, Copy)]
struct MapPosition {
    u: f32,
    v: f32,
    own: f32,
    step: [f32; 2],
}

/// Multiplies a lamp's light at places by the unoccluded fraction, from 0 to 1.
///
/// Percentage-closer filtering over 3 × 3 pixels of the map, as if the lamp were some centimetres wide. Each pixel is
/// compared with the plane of the place's own surface (receiver plane depth bias; Isidoro, *Shadow mapping: GPU-based
/// tips and techniques*, 2006). A block of the map that is entirely behind or before the place decides at once.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(super) fn cast(map: &ShadowMap, view: &ShadowView, spots: &Spots, light: &mut [f32]) {
    const MIDDLE: f32 = 0.5 * (SIDE as f32 - 1.0);
    const FIRST: f32 = BEFORE as f32;
    const LAST: f32 = SIDE as f32 - 1.0 - AFTER as f32;
    const PER_FOCAL: f32 = 1.0 / FOCAL as f32;
    let lists = [&spots.x, &spots.y, &spots.z, &spots.nx, &spots.ny, &spots.nz];
    let mut at = [[0.0_f32; CHUNK]; 6];
    let (mut u, mut v, mut own) = ([0.0_f32; CHUNK], [0.0_f32; CHUNK], [0.0_f32; CHUNK]);
    let (mut step_u, mut step_v, mut slack) = ([0.0_f32; CHUNK], [0.0_f32; CHUNK], [0.0_f32; CHUNK]);
    let mut block = [0_u32; CHUNK];
    for (k, light) in light.chunks_mut(CHUNK).enumerate() {
        let n = light.len();
        for (at, list) in at.iter_mut().zip(lists) {
            at[..n].copy_from_slice(&list[k * CHUNK..][..n]);
        }
        let [xs, ys, zs, nxs, nys, nzs] = &at;
        // Written out, because closures would be called here instead of inlined.
        let ([a, b, c], [su, sv, sz]) = (&view.turn, &view.step);
        for i in 0..CHUNK {
            let (x, y, z) = (xs[i], ys[i], zs[i]);
            let p = [
                a[0] * x + a[1] * y + a[2] * z + su,
                b[0] * x + b[1] * y + b[2] * z + sv,
                c[0] * x + c[1] * y + c[2] * z + sz,
            ];
            let (x, y, z) = (nxs[i], nys[i], nzs[i]);
            let normal =
                [a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z, c[0] * x + c[1] * y + c[2] * z];
            let depth = p[2];
            let scale = 1.0 / depth.max(0.05);
            let (here_u, here_v) = (p[0] * scale * FOCAL as f32 + MIDDLE, p[1] * scale * FOCAL as f32 + MIDDLE);
            // A place outside of the map counts as lit; behind the lamp the beam has no light anyway.
            let inside = (depth > 0.05) & (here_u >= FIRST) & (here_v >= FIRST) & (here_u < LAST) & (here_v < LAST);
            (u[i], v[i]) = (if inside { here_u } else { FIRST }, if inside { here_v } else { FIRST });
            own[i] = if inside { scale * BIAS } else { f32::INFINITY };
            // The plane n·p = d: 1/Z = n·(x, y, 1)/d on the ray (x, y, 1). It faces the lamp where d < 0.
            let d = normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2];
            let per = PER_FOCAL / d.min(-1e-6);
            let max = STEEPEST * scale;
            step_u[i] = (normal[0] * per).max(-max).min(max);
            step_v[i] = (normal[1] * per).max(-max).min(max);
            // No compared pixel is farther than two pixels from the place.
            slack[i] = 2.0 * (step_u[i].abs() + step_v[i].abs());
            block[i] = (v[i] as i32 / BLOCK as i32 * BLOCKS as i32 + u[i] as i32 / BLOCK as i32) as u32;
        }
        for i in 0..n {
            let [min, greatest] = map.blocks[block[i] as usize];
            if greatest <= own[i] - slack[i] {
                continue;
            }
            let place = MapPosition { u: u[i], v: v[i], own: own[i], step: [step_u[i], step_v[i]] };
            light[i] *= if min > own[i] + slack[i] { 0.0 } else { fraction(&map.depths, &place) };
        }
    }
}

/// The fraction of the 3 × 3 pixels about a place that are no nearer to the lamp than its surface.
#[inline(always)]
fn fraction(depths: &[f32], place: &MapPosition) -> f32 {
    const WIDE: usize = SIDE as usize;
    let (column, row) = (place.u as i32, place.v as i32);
    let (across, down) = (place.u - column as f32, place.v - row as f32);
    let first = (row as usize - BEFORE) * WIDE + column as usize - BEFORE;
    let (along, rows) = ([1.0 - across, 1.0, 1.0, across], [1.0 - down, 1.0, 1.0, down]);
    let mut sum = 0.0;
    for j in 0..4 {
        let own = place.own + place.step[1] * (j as i32 as f32 - 1.0 - down) - place.step[0] * (1.0 + across);
        let depths = &depths[first + j * WIDE..][..4];
        let mut lit = 0.0;
        for i in 0..4 {
            lit += if depths[i] <= own + place.step[0] * i as i32 as f32 { along[i] } else { 0.0 };
        }
        sum += rows[j] * lit;
    }
    sum * (1.0 / 9.0)
}
