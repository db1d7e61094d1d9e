//! Landmarks: image patches with an inverse depth.

use nalgebra::{Matrix2, Matrix3, Matrix4, Matrix4x3, Matrix4x6, Vector2, Vector3, Vector4};
use seafix_geometry::{Camera, Pixel, Point, StereoPixels, StereoRig, Transform, UncertainPixels, so3::skew};

/// A landmark: a scene point by its direction in the left camera of its first key frame, and its inverse depth there.
///
/// Its position in that camera's frame is (x, y, 1) / w; the parameters stay well conditioned for distant points, w →
/// 0.
#[derive(Debug, Clone)]
pub(super) struct Landmark {
    /// The key frame that saw it first.
    pub(super) anchor: usize,
    /// Its pixel in the left image of that key frame: the centre of its patch.
    pub(super) place: Pixel,
    /// The parameters (x, y, w).
    pub(super) at: Vector3<f64>,
    /// The covariance of (x, y, w), given the poses.
    pub(super) covariance: Matrix3<f64>,
    /// Its observations by key frames, in order of time; the first one is its anchor's.
    pub(super) views: Vec<LandmarkObservation>,
    /// Number of consecutive pairs in which it should have been visible and was not found.
    pub(super) misses: u32,
    /// The slant of its surface: the derivative of w by x and y in its neighbourhood.
    pub(super) slant: Vector2<f64>,
}

/// The observation of a landmark by a key frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct LandmarkObservation {
    /// The key frame.
    pub(super) frame: usize,
    /// The four pixel coordinates: left u, v and right u, v.
    pub(super) pixels: Vector4<f64>,
    /// The inverse of their covariance (1/px²).
    pub(super) information: Matrix4<f64>,
}

/// The projection of a landmark into both images, with its derivatives.
pub(super) struct Projection {
    /// The four pixel coordinates.
    pub(super) pixels: Vector4<f64>,
    /// The position in the left camera's frame, times w.
    scaled: Vector3<f64>,
    /// The derivative of the pixels by `scaled`, at constant w.
    by_scaled: Matrix4x3<f64>,
    /// The derivative of the pixels by w, through the right camera's offset.
    by_offset: Vector4<f64>,
    w: f64,
}

/// The coordinates of two pixels as one vector.
pub(super) fn coordinates(pixels: &StereoPixels) -> Vector4<f64> {
    Vector4::new(pixels.left.u, pixels.left.v, pixels.right.u, pixels.right.v)
}

/// The projection of the landmark `at` of an anchor at `here_from_anchor`; `None` if a camera cannot see it.
pub(super) fn project(
    rig: &StereoRig,
    here_from_anchor: &Transform<Camera, Camera>,
    at: &Vector3<f64>,
) -> Option<Projection> {
    let (direction, w) = (Vector3::new(at.x, at.y, 1.0), at.z);
    let scaled = here_from_anchor.rotation() * direction + here_from_anchor.translation() * w;
    let (left, by_left) = rig.left().project_with_jacobian(&Point::<Camera>::from(scaled))?;
    let across = rig.right_from_left();
    let shifted = across.rotation() * scaled + across.translation() * w;
    let (right, by_right) = rig.right().project_with_jacobian(&Point::<Camera>::from(shifted))?;
    let mut by_scaled = Matrix4x3::zeros();
    by_scaled.fixed_rows_mut::<2>(0).copy_from(&by_left);
    by_scaled.fixed_rows_mut::<2>(2).copy_from(&(by_right * across.rotation_matrix()));
    let mut by_offset = Vector4::zeros();
    by_offset.fixed_rows_mut::<2>(2).copy_from(&(by_right * across.translation()));
    let pixels = Vector4::new(left.u, left.v, right.u, right.v);
    Some(Projection { pixels, scaled, by_scaled, by_offset, w })
}

impl Projection {
    /// The derivative of the pixels by (x, y, w).
    pub(super) fn by_landmark(&self, here_from_anchor: &Transform<Camera, Camera>) -> Matrix4x3<f64> {
        let mut axes = here_from_anchor.rotation_matrix();
        axes.set_column(2, &here_from_anchor.translation());
        let mut by = self.by_scaled * axes;
        by.set_column(2, &(by.column(2) + self.by_offset));
        by
    }

    /// The derivative of the pixels by ξ of `world_from_here · Exp(ξ)`.
    pub(super) fn by_pose(&self) -> Matrix4x6<f64> {
        let mut by = Matrix4x6::zeros();
        by.fixed_columns_mut::<3>(0).copy_from(&(self.by_scaled * skew(&self.scaled)));
        by.fixed_columns_mut::<3>(3).copy_from(&(self.by_scaled * -self.w));
        by
    }

    /// The derivative of the pixels by ξ of `world_from_anchor · Exp(ξ)`.
    pub(super) fn by_anchor(&self, here_from_anchor: &Transform<Camera, Camera>, at: &Vector3<f64>) -> Matrix4x6<f64> {
        let turned = self.by_scaled * here_from_anchor.rotation_matrix();
        let mut by = Matrix4x6::zeros();
        by.fixed_columns_mut::<3>(0).copy_from(&(turned * -skew(&Vector3::new(at.x, at.y, 1.0))));
        by.fixed_columns_mut::<3>(3).copy_from(&(turned * self.w));
        by
    }

    /// The derivatives of the left and right pixel by a pixel of the anchor's left image.
    ///
    /// The surface has the inverse-depth slant `slant`; `by_pixel` is the derivative of (x, y) by the anchor's pixel.
    pub(super) fn shapes(
        &self,
        here_from_anchor: &Transform<Camera, Camera>,
        slant: &Vector2<f64>,
        by_pixel: &Matrix2<f64>,
    ) -> [Matrix2<f64>; 2] {
        let by = self.by_landmark(here_from_anchor);
        let along = by.fixed_columns::<2>(0) + by.column(2) * slant.transpose();
        [along.fixed_rows::<2>(0) * by_pixel, along.fixed_rows::<2>(2) * by_pixel]
    }
}

impl Landmark {
    /// A new landmark from the measured pixels of a key frame.
    ///
    /// The left pixel defines the landmark and has no alignment error; the right pixel has one. The calibration error
    /// (`calibration` px) is added to every coordinate.
    pub(super) fn begin(anchor: usize, pixels: &UncertainPixels, calibration: f64, rig: &StereoRig) -> Option<Self> {
        let information = information(&aligned(pixels, calibration), calibration)?;
        let direction = rig.left().normalize(&pixels.at.left)?;
        let seen = coordinates(&pixels.at);
        let here = Transform::identity();
        // Maximum-likelihood parameters, starting from the triangulated point.
        let point = rig.triangulate(&UncertainPixels::independent(pixels.at, 0.1)).ok()?.point;
        let mut at = Vector3::new(direction.x, direction.y, 1.0 / point.coords.z);
        for _ in 0..5 {
            let seen_now = project(rig, &here, &at)?;
            let by = seen_now.by_landmark(&here);
            let weighted = information * by;
            at += (by.transpose() * weighted).cholesky()?.solve(&(weighted.transpose() * (seen - seen_now.pixels)));
        }
        let by = project(rig, &here, &at)?.by_landmark(&here);
        let covariance = (by.transpose() * information * by).cholesky()?.inverse();
        let view = LandmarkObservation { frame: anchor, pixels: seen, information };
        let place = pixels.at.left;
        (at.z > 0.0).then_some(Self {
            anchor,
            place,
            at,
            covariance,
            views: vec![view],
            misses: 0,
            slant: Vector2::zeros(),
        })
    }

    /// The derivative of (x, y) by the pixel of its own left image.
    pub(super) fn by_pixel(&self, rig: &StereoRig) -> Option<Matrix2<f64>> {
        let here = Point::<Camera>::new(self.at.x, self.at.y, 1.0);
        let (_, by) = rig.left().project_with_jacobian(&here)?;
        by.fixed_columns::<2>(0).try_inverse()
    }
}

/// The covariance of the right pixel given the left one (px²), without the calibration error.
fn aligned(pixels: &UncertainPixels, calibration: f64) -> Matrix2<f64> {
    let own = pixels.covariance - Matrix4::identity() * (calibration * calibration);
    let block = |row, column| own.fixed_view::<2, 2>(row, column).into_owned();
    let (place, across, right) = (block(0, 0), block(2, 0), block(2, 2));
    place.try_inverse().map_or(right, |inverse| right - across * inverse * across.transpose())
}

/// The information of a landmark's first observation; its left pixel has the calibration error only.
fn information(aligned: &Matrix2<f64>, calibration: f64) -> Option<Matrix4<f64>> {
    let mut covariance = Matrix4::identity() * (calibration * calibration).max(MIN * MIN);
    let mut right = covariance.fixed_view_mut::<2, 2>(2, 2);
    right += aligned;
    covariance.cholesky().map(|factor| factor.inverse())
}

/// Minimum standard deviation of a pixel coordinate (px).
pub(super) const MIN: f64 = 0.02;

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4x3, UnitQuaternion, Vector6};
    use seafix_geometry::{Pinhole, World};

    fn rig() -> StereoRig {
        let camera = |k| Pinhole::new([800, 600], [500.0, 510.0], [400.0, 300.0], &[k, 0.05, 1e-3, -5e-4]).unwrap();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.02, -0.01, 0.03));
        StereoRig::new(camera(-0.2), camera(-0.22), Transform::new(turn, Vector3::new(0.02, -0.3, 0.01))).unwrap()
    }

    #[test]
    fn derivatives_are_those_of_small_steps() {
        let rig = rig();
        let anchor = Transform::<World, Camera>::exp(&[0.1, -0.2, 0.05, 1.0, 2.0, -1.0].into());
        let here = Transform::<World, Camera>::exp(&[0.15, -0.1, 0.08, 1.2, 2.1, -0.8].into());
        let at = Vector3::new(0.2, -0.1, 0.25);
        let seen = |anchor: &Transform<World, Camera>, here: &Transform<World, Camera>, at: &Vector3<f64>| {
            project(&rig, &(here.inverse() * *anchor), at).unwrap().pixels
        };
        let relative = here.inverse() * anchor;
        let projection = project(&rig, &relative, &at).unwrap();
        let step = 1e-6;
        for k in 0..6 {
            let mut xi = Vector6::zeros();
            xi[k] = step;
            let moved = |sign: f64| seen(&anchor, &here.perturbed(&(xi * sign)), &at);
            let by = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            assert!((by - projection.by_pose().column(k)).norm() < 1e-5, "pose {k}");
            let moved = |sign: f64| seen(&anchor.perturbed(&(xi * sign)), &here, &at);
            let by = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            assert!((by - projection.by_anchor(&relative, &at).column(k)).norm() < 1e-5, "anchor {k}");
        }
        let by_landmark: Matrix4x3<f64> = projection.by_landmark(&relative);
        for k in 0..3 {
            let moved = |sign: f64| {
                let mut at = at;
                at[k] += sign * step;
                seen(&anchor, &here, &at)
            };
            let by = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            assert!((by - by_landmark.column(k)).norm() < 1e-4, "landmark {k}");
        }
    }

    #[test]
    fn a_landmark_lies_where_its_pixels_meet() {
        let rig = rig();
        let point = Point::<Camera>::new(0.4, -0.3, 3.0);
        let pixels = UncertainPixels::independent(rig.project(&point).unwrap(), 0.2);
        let landmark = Landmark::begin(3, &pixels, 0.1, &rig).unwrap();
        assert!((Vector3::new(landmark.at.x, landmark.at.y, 1.0) / landmark.at.z - point.coords).norm() < 1e-9);
        assert_eq!((landmark.anchor, landmark.views[0].frame), (3, 3));
    }
}
