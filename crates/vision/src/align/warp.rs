//! How a window may deform between the views.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

/// How the window of the left image may be laid over the right one, beside moving.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Warp {
    /// Not at all: two parameters.
    #[default]
    Translation,
    /// As a plane is seen by both cameras, to first order: along the epipolar line, by an amount that
    /// changes from place to place; four parameters.
    Slanted,
    /// As the images show it: by moving alone, and slanted where the moving window ends with a residual that only a slant
    /// explains.
    AsSeen,
    /// Any way, to first order; six parameters. At the corners of boxes, with another surface behind, they
    /// are noisier than two.
    Affine,
}

/// What the columns of the Jacobian are made of: the parameters of x ↦ x + δ + Δ x, beside δ the entries of Δ.
pub(crate) trait Model<const P: usize> {
    /// Σ_k g_k ∂(Δx)_k / ∂(parameter), for each parameter, at x with gradient g.
    fn columns(&self, x: [f32; 2], gradient: [f32; 2]) -> [f32; P];
    /// Δ of these parameters.
    fn shape(&self, parameters: &[f64; P]) -> Matrix2<f64>;
    /// The parameters of this Δ; 0 for those of δ.
    fn parameters(&self, shape: &Matrix2<f64>) -> [f64; P];
}

/// δ alone.
pub(crate) struct Translation;
/// Δ = e sᵀ: along the direction e (of unit length) by s · x.
pub(super) struct Slanted(pub(super) Vector2<f64>);
/// Δ of four entries.
pub(super) struct Affine;

impl Model<2> for Translation {
    #[inline(always)]
    fn columns(&self, _: [f32; 2], gradient: [f32; 2]) -> [f32; 2] {
        gradient
    }

    fn shape(&self, _: &[f64; 2]) -> Matrix2<f64> {
        Matrix2::zeros()
    }

    fn parameters(&self, _: &Matrix2<f64>) -> [f64; 2] {
        [0.0; 2]
    }
}

impl Model<4> for Slanted {
    #[inline(always)]
    fn columns(&self, [x, y]: [f32; 2], [gx, gy]: [f32; 2]) -> [f32; 4] {
        let along = gx * self.0.x as f32 + gy * self.0.y as f32;
        [gx, gy, along * x, along * y]
    }

    fn shape(&self, p: &[f64; 4]) -> Matrix2<f64> {
        self.0 * Vector2::new(p[2], p[3]).transpose()
    }

    fn parameters(&self, shape: &Matrix2<f64>) -> [f64; 4] {
        let s = shape.transpose() * self.0;
        [0.0, 0.0, s.x, s.y]
    }
}

impl Model<6> for Affine {
    #[inline(always)]
    fn columns(&self, [x, y]: [f32; 2], [gx, gy]: [f32; 2]) -> [f32; 6] {
        [gx, gy, gx * x, gx * y, gy * x, gy * y]
    }

    fn shape(&self, p: &[f64; 6]) -> Matrix2<f64> {
        Matrix2::new(p[2], p[3], p[4], p[5])
    }

    fn parameters(&self, d: &Matrix2<f64>) -> [f64; 6] {
        [0.0, 0.0, d[(0, 0)], d[(0, 1)], d[(1, 0)], d[(1, 1)]]
    }
}
