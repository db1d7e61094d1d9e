//! The frame on three points.

use nalgebra::Matrix3;

use crate::{
    frame::{Frame, Point},
    transform::Transform,
};

/// Three points that define no frame: they are collinear or two of them coincide.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the three points are collinear: the sine of the angle at the first is {sine:.2e}, at least {min:.0e} is needed"
)]
pub struct Collinear {
    /// The sine of the angle between P1→P2 and P1→P3.
    pub sine: f64,
    /// Minimum sine.
    pub min: f64,
}

/// Minimum sine of the angle at P1.
const MIN_SINE: f64 = 1e-9;

/// The frame `G` on three points (TRIAD; the rule of the paper's Fig. 2).
///
/// The origin is P1, x points along P1→P3, z along (P2−P1)×(P3−P1), y = z × x; the frame is right-handed and P2 has y <
/// 0. Applied to the surveyed base points it gives `world_from_object`, the transpose of Eq. (1); applied to identified
/// points it gives the auxiliary frame of Eq. (3) and (4).
///
/// # Errors
/// [`Collinear`] if the sine of the angle at P1 is below 1e-9; callers with noisy points set a larger limit of their
/// own.
///
/// ```
/// use seafix_geometry::{Object, Point, World, triad};
/// let world_from_object = triad::<World, Object>(
///     &Point::new(1.0, 0.0, 0.0),
///     &Point::new(1.0, -1.0, 0.0),
///     &Point::new(3.0, 0.0, 0.0),
/// ).unwrap();
/// let p2 = world_from_object.inverse() * Point::new(1.0, -1.0, 0.0);
/// assert_eq!(p2, Point::new(0.0, -1.0, 0.0));
/// ```
pub fn triad<F: Frame, G: Frame>(p1: &Point<F>, p2: &Point<F>, p3: &Point<F>) -> Result<Transform<F, G>, Collinear> {
    let (a, b) = (*p2 - *p1, *p3 - *p1);
    let normal = a.cross(&b);
    let sine = normal.norm() / (a.norm() * b.norm());
    // The negated comparison also rejects NaN (coincident points).
    if !(sine >= MIN_SINE) {
        return Err(Collinear { sine: if sine.is_nan() { 0.0 } else { sine }, min: MIN_SINE });
    }
    let x = b.normalize();
    let z = normal.normalize();
    let y = z.cross(&x);
    Ok(Transform::from_axes(&Matrix3::from_columns(&[x, y, z]), p1.coords))
}
