//! The four residuals of an identified edge.

use nalgebra::{Matrix2x3, Matrix3, Matrix4, Vector2, Vector3};
use seafix_geometry::{Camera, NormalOffset, Pinhole, Pixel, Point, RightCamera, StereoRig};

use super::pixel_terms::PIXEL_FLOOR;
use crate::{
    observations::EdgeObservation,
    space_line::{LineOffset, MIN_SLOPE, SpaceLine},
};

/// An edge with prepared measurements.
pub(crate) struct EdgeRows<'a> {
    kind: Kind<'a>,
    /// The covariance of the four measured offsets.
    pub(crate) noise: Matrix4<f64>,
}

enum Kind<'a> {
    /// Two offsets in each image (px).
    Pixels(Box<[ImageOffset<'a>; 4]>),
    /// Two offsets at each end (m).
    Space(Box<SpaceLine>),
}

/// A normal offset with the plane of the rays through its place and normal, {p : nᵀp + c = 0}, left camera frame.
struct ImageOffset<'a> {
    measured: NormalOffset,
    plane: (Vector3<f64>, f64),
    camera: CameraOf<'a>,
}

enum CameraOf<'a> {
    Left(&'a Pinhole),
    Right(&'a StereoRig),
}

impl<'a> EdgeRows<'a> {
    /// The prepared edge: by its pixels if both they and a rig are given, else by its offsets in space.
    ///
    /// `None` if the noise is not finite and positive, or a pixel has no ray.
    pub(crate) fn of(edge: &EdgeObservation, rig: Option<&'a StereoRig>) -> Option<Self> {
        let line = &edge.measured;
        let Some((segments, rig)) = line.segments.zip(rig) else {
            return SpaceLine::of(line).map(|line| Self { noise: line.noise, kind: Kind::Space(Box::new(line)) });
        };
        let [l0, l1] = segments.left.map(|offset| ImageOffset::left(offset, rig));
        let [r0, r1] = segments.right.map(|offset| ImageOffset::right(offset, rig));
        let all = [l0?, l1?, r0?, r1?];
        let noise = segments.covariance() + Matrix4::identity() * (PIXEL_FLOOR * PIXEL_FLOOR);
        let valid = noise.iter().all(|variance| variance.is_finite());
        valid.then(|| Self { kind: Kind::Pixels(Box::new(all)), noise })
    }

    /// The residuals of a model edge with these ends, camera frame; `None` if a camera cannot see the edge there.
    pub(crate) fn rows(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<[LineOffset; 4]> {
        let along = to - from;
        match &self.kind {
            Kind::Pixels(all) => {
                let [a, b, c, d] = all.each_ref().map(|offset| offset.row(from, &along));
                Some([a?, b?, c?, d?])
            }
            Kind::Space(line) => line.rows(from, to),
        }
    }
}

impl<'a> ImageOffset<'a> {
    fn left(measured: NormalOffset, rig: &'a StereoRig) -> Option<Self> {
        let normal = rays(rig.left(), &measured)?;
        Some(Self { measured, plane: (normal, 0.0), camera: CameraOf::Left(rig.left()) })
    }

    fn right(measured: NormalOffset, rig: &'a StereoRig) -> Option<Self> {
        let normal = rays(rig.right(), &measured)?;
        let pose = rig.right_from_left();
        let plane = (pose.rotation_matrix().tr_mul(&normal), normal.dot(&pose.translation()));
        Some(Self { measured, plane, camera: CameraOf::Right(rig) })
    }

    fn row(&self, from: &Vector3<f64>, along: &Vector3<f64>) -> Option<LineOffset> {
        let (normal, offset) = &self.plane;
        let slope = normal.dot(along);
        if !(slope.abs() > MIN_SLOPE * normal.norm() * along.norm() * STEEP) {
            return None;
        }
        let t = -(normal.dot(from) + offset) / slope;
        let at = from + along * t;
        let (pixel, j) = self.project(&at)?;
        let n = self.measured.normal;
        let tangent = Vector2::new(-n.y, n.x);
        let motion = j * along;
        let slope = tangent.dot(&motion);
        if !(slope.abs() > MIN_SLOPE * motion.norm()) {
            return None;
        }
        // The place slides along the edge so that it stays on the normal.
        let across = n - tangent * (n.dot(&motion) / slope);
        let off = Vector2::new(self.measured.at.u - pixel.u, self.measured.at.v - pixel.v);
        Some(LineOffset { at, gradient: j.tr_mul(&across), residual: across.dot(&off), along: t })
    }

    fn project(&self, at: &Vector3<f64>) -> Option<(Pixel, Matrix2x3<f64>)> {
        match self.camera {
            CameraOf::Left(camera) => camera.project_with_jacobian::<Camera>(&Point::from(*at)),
            CameraOf::Right(rig) => {
                let place: Point<RightCamera> = *rig.right_from_left() * Point::<Camera>::from(*at);
                let (pixel, j) = rig.right().project_with_jacobian(&place)?;
                let turn: Matrix3<f64> = rig.right_from_left().rotation_matrix();
                Some((pixel, j * turn))
            }
        }
    }
}

/// Fraction of [`MIN_SLOPE`] at which an edge counts as parallel to a plane of rays, since edges are seen at slant.
const STEEP: f64 = 0.1;

/// The normal of the plane of the rays through a place and along its image normal, camera frame.
fn rays(camera: &Pinhole, offset: &NormalOffset) -> Option<Vector3<f64>> {
    let ray = |step: f64| {
        let (u, v) = (offset.at.u + step * offset.normal.x, offset.at.v + step * offset.normal.y);
        camera.normalize(&Pixel { u, v }).map(|at| Vector3::new(at.x, at.y, 1.0))
    };
    // Central about the place: the curvature of a distorted image cancels to first order.
    let (before, after) = (ray(-0.5)?, ray(0.5)?);
    Some(before.cross(&after).normalize())
}
