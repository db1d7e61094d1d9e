//! The local relation of the two images around a pair of pixels.

use nalgebra::{Matrix2, Vector2};
use seafix_geometry::{Pixel, Point, StereoPixels, StereoRig, UncertainPixels};

/// The first-order relation of the two images around one pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Local {
    /// The derivative of the right pixel by the left one, on a surface parallel to the left image.
    pub(super) shape: Matrix2<f64>,
    /// The direction of motion of the right pixel with depth, in pixels of the left image; of unit length.
    pub(super) epipolar: Vector2<f64>,
}

/// The shift of the window's border (px) below which a deformation is ignored.
const NEGLIGIBLE: f64 = 0.02;

impl Local {
    /// The relation around `pair`, for windows of half-side `half` (px).
    ///
    /// The shape is the identity for rectified images, or if the pair determines no point.
    pub(super) fn new(rig: &StereoRig, pair: &StereoPixels, half: f64) -> Self {
        let plain = Self { shape: Matrix2::identity(), epipolar: Vector2::x() };
        if rig.is_rectified() { plain } else { Self::unrectified(rig, pair, half).unwrap_or(plain) }
    }

    fn unrectified(rig: &StereoRig, pair: &StereoPixels, half: f64) -> Option<Self> {
        let depth = rig.triangulate(&UncertainPixels::independent(*pair, 1.0)).ok()?.point.coords.z;
        let seen = |u: f64, v: f64, depth: f64| {
            let ray = rig.left().normalize(&Pixel { u: pair.left.u + u, v: pair.left.v + v })?;
            let point = Point::from(ray.push(1.0) * depth);
            let right = rig.right().project(&(*rig.right_from_left() * point))?;
            Some(Vector2::new(right.u, right.v))
        };
        let along = |u: f64, v: f64| Some((seen(u, v, depth)? - seen(-u, -v, depth)?) / (2.0 * half));
        let shape = Matrix2::from_columns(&[along(half, 0.0)?, along(0.0, half)?]);
        let deeper = seen(0.0, 0.0, 1.01 * depth)? - seen(0.0, 0.0, depth)?;
        let epipolar = (shape.try_inverse()? * deeper).try_normalize(1e-12)?;
        let negligible = (shape - Matrix2::identity()).abs().max() * half < NEGLIGIBLE;
        Some(Self { shape: if negligible { Matrix2::identity() } else { shape }, epipolar })
    }
}
