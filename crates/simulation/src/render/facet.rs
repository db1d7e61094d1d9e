//! A triangle in a camera's frame, prepared for shading.

use nalgebra::{Matrix3, Vector3};
use smallvec::SmallVec;

use crate::scene::Triangle;

use super::{
    camera::Line,
    parts::{Lines, NOWHERE, Run},
    visibility::NONE,
};

/// Length of the vectors in which places are computed.
pub(super) const LANES: usize = 16;
/// Minimum cosine for the extension of a footprint on a surface seen edge-on.
const FLATTEST: f32 = 0.2;

/// A triangle in a camera's frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    /// Unit normal of the plane normal·p = offset.
    normal: [f32; 3],
    offset: f32,
    /// First corner. The barycentric weights of the other corners are `second`·(p − corner) and `third`·(p − corner).
    corner: [f32; 3],
    second: [f32; 3],
    third: [f32; 3],
    /// Texture coordinates at the first corner, and the differences to the second and the third.
    uv: [[f32; 2]; 3],
    /// Shading normal at the first corner, and the differences to the second and the third.
    normals: [[f32; 3]; 3],
    pub(super) skin: u32,
}

/// Surface points in one camera's frame, as a structure of arrays.
#[derive(Debug, Default, Clone)]
pub(super) struct Spots {
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    pub(super) z: Vec<f32>,
    /// Shading normal of unit length.
    pub(super) nx: Vec<f32>,
    pub(super) ny: Vec<f32>,
    pub(super) nz: Vec<f32>,
    /// Texture coordinates (m).
    pub(super) u: Vec<f32>,
    pub(super) v: Vec<f32>,
    /// Footprint of a pixel on the surface (m).
    pub(super) footprint: Vec<f32>,
    /// Range from the ray's entry into the water (m).
    pub(super) range: Vec<f32>,
}

fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

impl Facet {
    /// The triangle with its corners at `at` (camera frame); `turn` rotates the world into that frame.
    pub(super) fn new(triangle: &Triangle, at: &[Vector3<f64>; 3], turn: &Matrix3<f64>) -> Self {
        let (e, f) = (at[1] - at[0], at[2] - at[0]);
        let normal = e.cross(&f);
        let area = normal.norm_squared();
        // The dual basis of (e, f) in the plane.
        let (second, third) = (f.cross(&normal) / area, normal.cross(&e) / area);
        let unit = normal / area.sqrt();
        let normals = triangle.normals.map(|n| single(&(turn * n)));
        let step = |k: usize| std::array::from_fn(|i| normals[k][i] - normals[0][i]);
        let uv = triangle.uv;
        // Far from the origin single precision would lose the finest detail of a texture. The first corner is rounded
        // and the differences stay exact; the tile size, which could be subtracted, is unknown here.
        let uv_step = |k: usize| [(uv[k][0] - uv[0][0]) as f32, (uv[k][1] - uv[0][1]) as f32];
        Self {
            normal: single(&unit),
            offset: unit.dot(&at[0]) as f32,
            corner: single(&at[0]),
            second: single(&second),
            third: single(&third),
            uv: [[uv[0][0] as f32, uv[0][1] as f32], uv_step(1), uv_step(2)],
            normals: [normals[0], step(1), step(2)],
            skin: triangle.skin,
        }
    }

    /// Depth Z and range of a ray's intersection with the plane.
    pub(super) fn spot(&self, line: &Line) -> (f32, f32) {
        let t = (self.offset - dot(&self.normal, &line.from)) / dot(&self.normal, &line.along);
        (line.from[2] + t * line.along[2], t * dot(&line.along, &line.along).sqrt())
    }

    /// The sides of the facet in a pixel where lines bend; `None` if the facet is seen edge-on.
    ///
    /// The inside is a·u + b·v + c ≥ 0 at the offset (u, v) from the pixel's centre, (a, b) of unit length; `line`
    /// gives the ray of an offset.
    pub(super) fn sides(&self, line: impl Fn([f32; 2]) -> Line) -> SmallVec<[[f64; 3]; 4]> {
        // The barycentric weights at a ray's intersection are zero on the sides, and nearly linear within a pixel.
        let weights = |at| {
            let line = line(at);
            let t = (self.offset - dot(&self.normal, &line.from)) / dot(&self.normal, &line.along);
            let to: [f32; 3] = std::array::from_fn(|k| line.from[k] + t * line.along[k] - self.corner[k]);
            let (b, c) = (f64::from(dot(&self.second, &to)), f64::from(dot(&self.third, &to)));
            [1.0 - b - c, b, c]
        };
        let (left, right) = (weights([-0.5, 0.0]), weights([0.5, 0.0]));
        let (above, below) = (weights([0.0, -0.5]), weights([0.0, 0.5]));
        let side = |k: usize| {
            let (a, b) = (right[k] - left[k], below[k] - above[k]);
            let length = (a * a + b * b).sqrt();
            let c = 0.25 * (left[k] + right[k] + above[k] + below[k]);
            [a / length, b / length, c / length]
        };
        let sides = [side(0), side(1), side(2)];
        if sides.iter().flatten().all(|x| x.is_finite()) { sides.into_iter().collect() } else { SmallVec::new() }
    }

    /// The intersections of rays with the plane; with `BENT`, each ray has its own direction and origin.
    #[expect(clippy::too_many_arguments, reason = "separate slices, which the compiler knows not to overlap")]
    #[inline(always)]
    fn spots<const BENT: bool>(
        &self,
        per_focal: f32,
        [ax, ay, az, fx, fy, fz]: [&[f32]; 6],
        x: &mut [f32],
        y: &mut [f32],
        z: &mut [f32],
        nx: &mut [f32],
        ny: &mut [f32],
        nz: &mut [f32],
        u: &mut [f32],
        v: &mut [f32],
        footprint: &mut [f32],
        range: &mut [f32],
    ) {
        let n = x.len();
        let (ax, ay) = (&ax[..n], &ay[..n]);
        let [az, fx, fy, fz] = [az, fx, fy, fz].map(|list| if BENT { &list[..n] } else { list });
        let (y, z, nx, ny, nz) = (&mut y[..n], &mut z[..n], &mut nx[..n], &mut ny[..n], &mut nz[..n]);
        let (u, v, footprint, range) = (&mut u[..n], &mut v[..n], &mut footprint[..n], &mut range[..n]);
        let [uv, du, dv] = &self.uv;
        let [m, dm, em] = &self.normals;
        for i in 0..n {
            let along = [ax[i], ay[i], if BENT { az[i] } else { 1.0 }];
            let from = if BENT { [fx[i], fy[i], fz[i]] } else { [0.0; 3] };
            let climb = dot(&self.normal, &along);
            let start = if BENT { dot(&self.normal, &from) } else { 0.0 };
            let t = (self.offset - start) / climb;
            let length = dot(&along, &along).sqrt();
            let at = [from[0] + t * along[0], from[1] + t * along[1], from[2] + t * along[2]];
            let to = [at[0] - self.corner[0], at[1] - self.corner[1], at[2] - self.corner[2]];
            let (b, c) = (dot(&self.second, &to), dot(&self.third, &to));
            (x[i], y[i], z[i]) = (at[0], at[1], at[2]);
            u[i] = uv[0] + b * du[0] + c * dv[0];
            v[i] = uv[1] + b * du[1] + c * dv[1];
            let normal = [m[0] + b * dm[0] + c * em[0], m[1] + b * dm[1] + c * em[1], m[2] + b * dm[2] + c * em[2]];
            let scale = 1.0 / dot(&normal, &normal).sqrt();
            (nx[i], ny[i], nz[i]) = (normal[0] * scale, normal[1] * scale, normal[2] * scale);
            let reach = t * length;
            range[i] = reach;
            footprint[i] = reach * per_focal / (climb.abs() / length).max(FLATTEST);
        }
    }
}

/// The surface points of all parts. Runs are computed in whole vectors; the next run overwrites the excess.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
pub(super) fn spots(runs: &[Run], count: usize, facets: &[Facet], lines: &Lines, per_focal: f32, out: &mut Spots) {
    let Spots { x, y, z, nx, ny, nz, u, v, footprint, range } = out;
    for list in [&mut *x, y, z, nx, ny, nz, u, v, footprint, range] {
        list.resize(count + LANES, 0.0);
    }
    let [fx, fy, fz] = &lines.from;
    for run in runs {
        if run.facet == NONE {
            for (list, value) in [
                (&mut *x, 0.0),
                (y, 0.0),
                (z, NOWHERE),
                (nx, 0.0),
                (ny, 0.0),
                (nz, -1.0),
                (u, 0.0),
                (v, 0.0),
                (footprint, NOWHERE),
                (range, NOWHERE),
            ] {
                list[run.from..run.to].fill(value);
            }
            continue;
        }
        let facet = &facets[run.facet as usize];
        let span = run.from..run.from + (run.to - run.from).next_multiple_of(LANES);
        macro_rules! cut {
            ($($list:ident)*) => { ($(&mut $list[span.clone()]),*) };
        }
        let (x, y, z, nx, ny, nz, u, v, footprint, range) = cut!(x y z nx ny nz u v footprint range);
        if lines.bent() {
            let rays = [&lines.x, &lines.y, &lines.z, fx, fy, fz].map(|list| &list[span.clone()]);
            facet.spots::<true>(per_focal, rays, x, y, z, nx, ny, nz, u, v, footprint, range);
        } else {
            let none: &[f32] = &[];
            let rays = [&lines.x[span.clone()], &lines.y[span.clone()], none, none, none, none];
            facet.spots::<false>(per_focal, rays, x, y, z, nx, ny, nz, u, v, footprint, range);
        }
    }
    for list in [x, y, z, nx, ny, nz, u, v, footprint, range] {
        list.truncate(count);
    }
}
