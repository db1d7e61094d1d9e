//! Covariances of poses and points.

use std::marker::PhantomData;

use nalgebra::{Matrix3, Matrix3x6, Matrix6};

use crate::{
    frame::{Frame, Point},
    so3::skew,
    transform::Transform,
};

/// The covariance of a pose estimate `a_from_b`.
///
/// It is the covariance of ξ = (φ, ρ) in `T_true = T_estimate · Exp(ξ)`: rotation (rad) first, translation (m) second,
/// both along the axes of frame `B`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covariance6<A, B> {
    /// The 6×6 matrix, symmetric and positive semidefinite.
    pub matrix: Matrix6<f64>,
    frames: PhantomData<(A, B)>,
}

impl<A: Frame, B: Frame> Covariance6<A, B> {
    /// A covariance with this matrix, symmetrised.
    pub fn new(matrix: Matrix6<f64>) -> Self {
        Self { matrix: (matrix + matrix.transpose()) * 0.5, frames: PhantomData }
    }

    /// Independent errors with the standard deviations `attitude` (rad) and `position` (m) for each axis of `B`.
    pub fn isotropic(attitude: f64, position: f64) -> Self {
        let (a, p) = (attitude * attitude, position * position);
        Self::new(Matrix6::from_diagonal(&[a, a, a, p, p, p].into()))
    }

    /// The covariance of the inverse pose `b_from_a`, by the adjoint of the estimate.
    #[must_use]
    pub fn inverse(&self, a_from_b: &Transform<A, B>) -> Covariance6<B, A> {
        // T = T̂ Exp(ξ) implies T⁻¹ = T̂⁻¹ Exp(−Ad(T̂) ξ).
        let ad = a_from_b.adjoint();
        Covariance6::new(ad * self.matrix * ad.transpose())
    }

    /// The covariance (m², axes of `B`) that the pose error causes at the point `at` of `B`.
    ///
    /// The transformed point is p_b = Exp(−ξ) · at, hence J = \[ \[at\]×, −I \].
    pub fn of_point(&self, at: &Point<B>) -> Matrix3<f64> {
        let mut j = Matrix3x6::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&at.coords));
        j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
        j * self.matrix * j.transpose()
    }

    /// The expected RMS length of the position error (m): √tr Σ_ρρ.
    pub fn position_rms(&self) -> f64 {
        self.matrix.fixed_view::<3, 3>(3, 3).trace().sqrt()
    }

    /// The expected RMS angle of the attitude error (rad): √tr Σ_φφ.
    pub fn attitude_rms(&self) -> f64 {
        self.matrix.fixed_view::<3, 3>(0, 0).trace().sqrt()
    }

    /// The standard deviation of the position along one axis (m): √(tr Σ_ρρ/3), the RMS over the three axes.
    ///
    /// It is the σ of an isotropic covariance with the same [`position_rms`](Self::position_rms).
    pub fn position_sigma(&self) -> f64 {
        self.position_rms() / 3f64.sqrt()
    }

    /// The standard deviation of the attitude about one axis (rad): √(tr Σ_φφ/3), the RMS over the three axes.
    pub fn attitude_sigma(&self) -> f64 {
        self.attitude_rms() / 3f64.sqrt()
    }
}

/// A point with the covariance of its coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainPoint<F> {
    /// The measured position.
    pub at: Point<F>,
    /// The covariance of `at` (m²), axes of `F`.
    pub covariance: Matrix3<f64>,
}

impl<F: Frame> UncertainPoint<F> {
    /// A point with the same standard deviation (m) along every axis.
    pub fn isotropic(at: Point<F>, sigma: f64) -> Self {
        Self { at, covariance: Matrix3::identity() * (sigma * sigma) }
    }
}
