//! Models of a window's deformation between the views.

use nalgebra::{Matrix2, Vector2};
use seafix_component::Settings;
use serde::{Deserialize, Serialize};

/// Deformation of the left window in the right image, beside its translation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Warp {
    /// No deformation; two parameters.
    #[default]
    Translation,
    /// The first-order deformation of a plane: along the epipolar line, linear in position; four parameters.
    Slanted,
    /// Translation, or slanted if the residual of the translation shows a significant slant.
    AsSeen,
    /// Any first-order deformation; six parameters.
    ///
    /// At the corners of boxes in front of another surface they are noisier than two.
    Affine,
}

/// A deformation model x ↦ x + δ + Δ x, whose parameters are δ and those of Δ.
pub(crate) trait Model<const P: usize> {
    /// The derivative Σ_k g_k ∂(Δx)_k / ∂(parameter) for each parameter, at x with gradient g.
    fn columns(&self, x: [f32; 2], gradient: [f32; 2]) -> [f32; P];
    /// The Δ of these parameters.
    fn shape(&self, parameters: &[f64; P]) -> Matrix2<f64>;
    /// The parameters of Δ, with zero for those of δ.
    fn parameters(&self, shape: &Matrix2<f64>) -> [f64; P];
}

/// The model of δ alone.
pub(crate) struct Translation;
/// The model Δ = e sᵀ: along the direction e (of unit length) by s · x.
pub(super) struct Slanted(pub(super) Vector2<f64>);
/// The model of all four entries of Δ.
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
