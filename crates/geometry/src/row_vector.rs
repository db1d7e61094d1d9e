//! The paper's convention: points are row vectors, `p_B = p_A · H_{A,B}`.
//!
//! The rows of the rotation part are the unit vectors of A seen in B, the translation is the last row, and products
//! read from left to right. `H_{A,B}` is the transpose of the column convention's `b_from_a`. Equations (1)–(6) of
//! Bobkov, Kudryashov and Inzartsev (2021) are implemented as printed, with the misprint of (6) corrected; they serve
//! as a reference for tests.

use std::{marker::PhantomData, ops::Mul};

use nalgebra::{Matrix4, RowVector4};

use crate::{
    frame::{Body, Frame, Object, Point, World},
    transform::Transform,
    triad::{Collinear, triad},
};

/// The matrix `H_{A,B}`: it maps row vectors of `A` to row vectors of `B`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct H<A, B> {
    /// The 4×4 matrix, translation in the last row.
    pub matrix: Matrix4<f64>,
    frames: PhantomData<(A, B)>,
}

impl<A: Frame, B: Frame> H<A, B> {
    /// The inverse motion, `H_{B,A}`.
    #[must_use]
    pub fn inverse(&self) -> H<B, A> {
        H::from(self.transform().inverse())
    }

    /// The same motion in the column convention.
    pub fn transform(&self) -> Transform<B, A> {
        Transform::from_matrix(&self.matrix.transpose()).expect("an H is made from rigid motions only")
    }

    /// The product `p · H`.
    pub fn apply(&self, p: &Point<A>) -> Point<B> {
        let row = RowVector4::new(p.coords.x, p.coords.y, p.coords.z, 1.0) * self.matrix;
        Point::new(row[0], row[1], row[2])
    }
}

impl<A: Frame, B: Frame> From<Transform<B, A>> for H<A, B> {
    fn from(b_from_a: Transform<B, A>) -> Self {
        Self { matrix: b_from_a.matrix().transpose(), frames: PhantomData }
    }
}

impl<A: Frame, B: Frame, C: Frame> Mul<H<B, C>> for H<A, B> {
    type Output = H<A, C>;

    /// The composition `H_{A,C} = H_{A,B} · H_{B,C}`.
    fn mul(self, next: H<B, C>) -> H<A, C> {
        H { matrix: self.matrix * next.matrix, frames: PhantomData }
    }
}

/// The auxiliary frame on three identified points, of Eq. (3) and (4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Auxiliary;
impl Frame for Auxiliary {}

/// The vehicle's frame at the start of its track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyAtStart;
impl Frame for BodyAtStart {}

/// The vehicle's frame at its last fix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyAtFix;
impl Frame for BodyAtFix {}

/// Eq. (1): `H_{ob,WCS}` from the surveyed coordinates of the base points P1, P2, P3.
///
/// # Errors
/// [`Collinear`] if the three points are collinear.
pub fn eq1(p1: &Point<World>, p2: &Point<World>, p3: &Point<World>) -> Result<H<Object, World>, Collinear> {
    Ok(H::from(triad(p1, p2, p3)?))
}

/// Eq. (2): `H_{AUVi,ob} = (H_{AUV0,AUVi})⁻¹ · H_{AUV0,WCS} · (H_{ob,WCS})⁻¹`, by way of the world.
pub fn eq2(
    start_to_now: &H<BodyAtStart, Body>,
    start_to_world: &H<BodyAtStart, World>,
    object_to_world: &H<Object, World>,
) -> H<Body, Object> {
    start_to_now.inverse() * *start_to_world * object_to_world.inverse()
}

/// Eq. (3): `H_{ad,AUVi}` from the measured positions of three identified points.
///
/// # Errors
/// [`Collinear`] if the three points are collinear.
pub fn eq3(c: &[Point<Body>; 3]) -> Result<H<Auxiliary, Body>, Collinear> {
    Ok(H::from(triad(&c[0], &c[1], &c[2])?))
}

/// Eq. (4): `H_{ad,ob}` from the model positions of the same three points.
///
/// # Errors
/// [`Collinear`] if the three points are collinear.
pub fn eq4(p: &[Point<Object>; 3]) -> Result<H<Auxiliary, Object>, Collinear> {
    Ok(H::from(triad(&p[0], &p[1], &p[2])?))
}

/// Eq. (5): `H_{AUVi,ob} = (H_{ad,AUVi})⁻¹ · H_{ad,ob}`, the direct fix.
pub fn eq5(auxiliary_to_body: &H<Auxiliary, Body>, auxiliary_to_object: &H<Auxiliary, Object>) -> H<Body, Object> {
    auxiliary_to_body.inverse() * *auxiliary_to_object
}

/// Eq. (6) with its misprint corrected: `H_{AUVj,ob} = (H_{AUVi,AUVj})⁻¹ · H_{AUVi,ob}`.
///
/// The last fix is propagated by odometry, `H_{AUVi,AUVj} = H_{i,i+1} ⋯ H_{j−1,j}`.
pub fn eq6(fix_to_now: &H<BodyAtFix, Body>, fix_to_object: &H<BodyAtFix, Object>) -> H<Body, Object> {
    fix_to_now.inverse() * *fix_to_object
}
