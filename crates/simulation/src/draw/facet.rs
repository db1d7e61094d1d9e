//! A triangle before one camera: what shading needs of it.

use nalgebra::{Matrix3, Vector3};

use crate::field::Triangle;

use super::eye::Line;

/// A triangle in a camera's frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    /// Its plane: normal·p = offset; the normal has unit length.
    normal: [f32; 3],
    offset: f32,
    /// A corner, and what weights the second and third corner have at p − corner.
    corner: [f32; 3],
    second: [f32; 3],
    third: [f32; 3],
    /// Texture coordinates and normals at the corner, and their steps to the second and the third.
    uv: [[f32; 2]; 3],
    normals: [[f32; 3]; 3],
    pub(super) skin: u32,
}

/// A place on a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub(super) at: [f32; 3],
    /// The shading normal, unit length.
    pub(super) normal: [f32; 3],
    pub(super) uv: [f32; 2],
    /// The distance from where its ray enters the water (m).
    pub(super) range: f32,
    /// The cosine between its ray and the plane's normal.
    pub(super) slope: f32,
}

fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

impl Facet {
    /// The triangle with its corners at `at` (camera frame); `turn` leads from the world into it.
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
        // Far from the origin single precision would lose the texture's finest detail: whole tiles do not matter,
        // but they are not known here, so the first corner is rounded and the steps stay exact.
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

    /// Where a ray meets its plane.
    #[inline]
    pub(super) fn spot(&self, line: &Line) -> Spot {
        let climb = dot(&self.normal, &line.along);
        let t = (self.offset - dot(&self.normal, &line.from)) / climb;
        let length = dot(&line.along, &line.along).sqrt();
        let at: [f32; 3] = std::array::from_fn(|i| line.from[i] + t * line.along[i]);
        let from: [f32; 3] = std::array::from_fn(|i| at[i] - self.corner[i]);
        let (b, c) = (dot(&self.second, &from), dot(&self.third, &from));
        let uv = std::array::from_fn(|i| self.uv[0][i] + b * self.uv[1][i] + c * self.uv[2][i]);
        let [n, dn, en] = &self.normals;
        let normal: [f32; 3] = std::array::from_fn(|i| n[i] + b * dn[i] + c * en[i]);
        let scale = 1.0 / dot(&normal, &normal).sqrt();
        Spot { at, normal: normal.map(|x| x * scale), uv, range: t * length, slope: climb.abs() / length }
    }
}
