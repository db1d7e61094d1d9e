//! Stereo rigs with arbitrary extrinsics, and triangulation by maximum likelihood.

use nalgebra::{Matrix3, Matrix4, Matrix4x3, UnitQuaternion, Vector2, Vector3, Vector4};

use crate::{
    frame::{Camera, Point, RightCamera},
    measured::UncertainPixels,
    pinhole::{Pinhole, Pixel},
    so3::skew,
    transform::Transform,
};

/// The pixels of one point in both cameras of a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoPixels {
    /// The pixel in the left image.
    pub left: Pixel,
    /// The pixel in the right image.
    pub right: Pixel,
}

impl StereoPixels {
    /// The vector (u left, v left, u right, v right) (px), in the order of covariances.
    pub fn coordinates(&self) -> Vector4<f64> {
        Vector4::new(self.left.u, self.left.v, self.right.u, self.right.v)
    }
}

/// Two calibrated cameras with fixed, arbitrary extrinsics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoRig {
    left: Pinhole,
    right: Pinhole,
    right_from_left: Transform<RightCamera, Camera>,
    essential: Matrix3<f64>,
}

/// Two cameras with a baseline too short for a stereo rig (m).
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the baseline is {0:.1e} m; two cameras in one place see no depth (is one calibration used for both?)")]
pub struct BadRig(pub f64);

/// The reason why two pixels determine no point.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Untriangulable {
    /// A pixel outside the domain of the lens model.
    #[error("a pixel lies beyond the lens model")]
    OutsideLens,
    /// Rays that do not approach each other in front of both cameras.
    #[error("the rays do not meet in front of the cameras (depth {0:.3} m)")]
    Behind(f64),
    /// Rays so nearly parallel that the depth is undetermined.
    #[error("the rays are parallel to within their noise")]
    Parallel,
    /// A singular covariance of the pixels.
    #[error("the covariance of the pixels is singular")]
    Singular,
}

/// A triangulated point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangulation {
    /// The maximum-likelihood point.
    pub point: Point<Camera>,
    /// Its covariance (m²), from the pixel noise alone.
    pub covariance: Matrix3<f64>,
    /// The squared Mahalanobis residual rᵀ Σ⁻¹ r of the four pixel coordinates.
    ///
    /// With a correct covariance Σ it is χ² with one degree of freedom: the distance across the epipolar line.
    pub disagreement: f64,
}

impl StereoRig {
    /// A rig of two cameras, the second one at `right_from_left`.
    ///
    /// # Errors
    /// [`BadRig`] if the cameras are less than 1e-6 m apart.
    pub fn new(left: Pinhole, right: Pinhole, right_from_left: Transform<RightCamera, Camera>) -> Result<Self, BadRig> {
        let baseline = right_from_left.translation().norm();
        if !(baseline >= 1e-6) {
            return Err(BadRig(baseline));
        }
        let essential = skew(&(right_from_left.translation() / baseline)) * right_from_left.rotation_matrix();
        Ok(Self { left, right, right_from_left, essential })
    }

    /// The rig with both cameras exchanged: its left camera is the right one of this rig.
    pub fn exchanged(&self) -> Self {
        let back = self.right_from_left.inverse();
        let right_from_left = Transform::new(back.rotation(), back.translation());
        let essential = self.essential.transpose();
        Self { left: self.right, right: self.left, right_from_left, essential }
    }

    /// The rig with the right camera rotated in place by the rotation vector `turn` (rad, its own frame).
    pub fn with_right_turned(&self, turn: &Vector3<f64>) -> Self {
        let turn =
            Transform::<RightCamera, RightCamera>::new(UnitQuaternion::from_scaled_axis(*turn), Vector3::zeros());
        let right_from_left = turn * self.right_from_left;
        Self::new(self.left, self.right, right_from_left).expect("the baseline is unchanged")
    }

    /// The direction in the right image along which a nearer point moves away from the left camera: the unit vector
    /// of the right camera's own displacement, (1, 0) for a right camera that is exactly to the right.
    ///
    /// A pixel error of both images in this direction alone is an error of the disparity. Zero if one camera is
    /// exactly in front of the other.
    pub fn disparity_direction(&self) -> Vector2<f64> {
        let across = -self.right_from_left.translation().xy();
        across.try_normalize(1e-12).unwrap_or_else(Vector2::zeros)
    }

    /// The rig with the right camera's principal point moved by `pixels` along [`disparity_direction`]: every
    /// disparity grows by as much.
    ///
    /// [`disparity_direction`]: Self::disparity_direction
    pub fn with_range_offset(&self, pixels: f64) -> Self {
        let right = self.right.with_principal_moved(&(self.disparity_direction() * pixels));
        Self { right, ..*self }
    }

    /// The left camera.
    pub fn left(&self) -> &Pinhole {
        &self.left
    }

    /// The right camera.
    pub fn right(&self) -> &Pinhole {
        &self.right
    }

    /// The right camera's pose: `p_right = right_from_left * p_left`.
    pub fn right_from_left(&self) -> &Transform<RightCamera, Camera> {
        &self.right_from_left
    }

    /// The baseline: the distance between the cameras (m).
    pub fn baseline(&self) -> f64 {
        self.right_from_left.translation().norm()
    }

    /// The essential matrix E = [t̂]× R of `right_from_left`, with t̂ the direction of its translation.
    ///
    /// The undistorted directions of one point satisfy x_rᵀ E x_l = 0; E x_l is the epipolar line of x_l in the right
    /// image.
    pub fn essential(&self) -> &Matrix3<f64> {
        &self.essential
    }

    /// The mean of the four focal lengths (px): the scale from distances of directions to pixels.
    pub fn mean_focal(&self) -> f64 {
        let [l, r] = [self.left.focal(), self.right.focal()];
        0.25 * (l[0] + l[1] + r[0] + r[1])
    }

    /// Whether the rig is rectified: identical cameras without distortion, displaced along x only.
    pub fn is_rectified(&self) -> bool {
        let t = self.right_from_left.translation();
        t.y.abs().max(t.z.abs()) < 1e-12 * self.baseline() && self.is_parallel()
    }

    /// Whether the rig is rectified vertically: identical cameras without distortion, displaced along y only.
    pub fn is_rectified_upright(&self) -> bool {
        let t = self.right_from_left.translation();
        t.x.abs().max(t.z.abs()) < 1e-12 * self.baseline() && self.is_parallel()
    }

    /// Whether the cameras are identical, without distortion and parallel.
    fn is_parallel(&self) -> bool {
        let turn = crate::so3::angle(&self.right_from_left.rotation());
        turn < 1e-12 && self.left == self.right && self.left.distortion().is_none()
    }

    /// The projections of `point` into both cameras, inside the images or not; `None` if one camera cannot see it.
    pub fn project(&self, point: &Point<Camera>) -> Option<StereoPixels> {
        let left = self.left.project(point)?;
        let right = self.right.project(&(self.right_from_left * *point))?;
        Some(StereoPixels { left, right })
    }

    /// The projections of `point` with their derivatives (px/m), in the order of [`StereoPixels::coordinates`].
    pub fn project_with_jacobian(&self, point: &Point<Camera>) -> Option<(StereoPixels, Matrix4x3<f64>)> {
        let (left, by_left) = self.left.project_with_jacobian(point)?;
        let (right, by_right) = self.right.project_with_jacobian(&(self.right_from_left * *point))?;
        let by_right = by_right * self.right_from_left.rotation_matrix();
        let mut j = Matrix4x3::zeros();
        j.fixed_rows_mut::<2>(0).copy_from(&by_left);
        j.fixed_rows_mut::<2>(2).copy_from(&by_right);
        Some((StereoPixels { left, right }, j))
    }

    /// The projections of `point`, if both lie at least `margin` pixels inside the images.
    pub fn sees(&self, point: &Point<Camera>, margin: f64) -> Option<StereoPixels> {
        self.project(point)
            .filter(|seen| self.left.contains(&seen.left, margin) && self.right.contains(&seen.right, margin))
    }

    /// The Sampson distance (px) of two pixels to the epipolar constraint x_rᵀ E x_l = 0.
    ///
    /// It is computed on undistorted directions and scaled by the mean focal length. `None` if a pixel lies outside the
    /// lens model.
    pub fn epipolar_distance(&self, seen: &StereoPixels) -> Option<f64> {
        self.epipolar_offset(seen).map(f64::abs)
    }

    /// The signed Sampson distance (px); the sign is the side of the epipolar line.
    pub fn epipolar_offset(&self, seen: &StereoPixels) -> Option<f64> {
        let l = self.left.normalize(&seen.left)?.push(1.0);
        let r = self.right.normalize(&seen.right)?.push(1.0);
        let (line_r, line_l) = (self.essential * l, self.essential.transpose() * r);
        let slope = line_r.xy().norm_squared() + line_l.xy().norm_squared();
        Some(self.mean_focal() * r.dot(&line_r) / slope.sqrt())
    }

    /// The maximum-likelihood point of two pixels, with its covariance (Hartley and Sturm, *Triangulation*, 1997).
    ///
    /// Gauss–Newton on the four pixel residuals r, weighted by the inverse of their covariance Σ, starts at the
    /// midpoint of the rays' closest approach; the covariance is (Jᵀ Σ⁻¹ J)⁻¹ at the solution.
    ///
    /// # Errors
    /// [`Untriangulable`] if the rays are parallel or meet behind a camera, or if Σ is singular.
    pub fn triangulate(&self, seen: &UncertainPixels) -> Result<Triangulation, Untriangulable> {
        let information = seen.covariance.cholesky().ok_or(Untriangulable::Singular)?.inverse();
        let mut point = self.midpoint(&seen.at)?;
        // Consistent pixels reach rounding error in three steps; rows that are several pixels apart take more.
        for _ in 0..50 {
            let (normal, gradient, _) =
                self.linearize(&point, &seen.at, &information).ok_or(Untriangulable::Behind(point.coords.z))?;
            let step = normal.try_inverse().ok_or(Untriangulable::Parallel)? * gradient;
            point = point + step;
            if step.norm() <= 1e-14 * point.coords.norm() {
                break;
            }
        }
        let (normal, _, disagreement) =
            self.linearize(&point, &seen.at, &information).ok_or(Untriangulable::Behind(point.coords.z))?;
        let covariance = normal.try_inverse().ok_or(Untriangulable::Parallel)?;
        if !covariance.iter().all(|x| x.is_finite()) || covariance.trace() > point.coords.norm_squared() {
            return Err(Untriangulable::Parallel);
        }
        Ok(Triangulation { point, covariance, disagreement })
    }

    /// The terms JᵀWJ, JᵀWr and rᵀWr of the four pixel residuals r at `point`.
    fn linearize(
        &self,
        point: &Point<Camera>,
        seen: &StereoPixels,
        weight: &Matrix4<f64>,
    ) -> Option<(Matrix3<f64>, Vector3<f64>, f64)> {
        let (expected, j) = self.project_with_jacobian(point)?;
        let r = seen.coordinates() - expected.coordinates();
        let weighted = weight * j;
        Some((j.transpose() * weighted, weighted.transpose() * r, r.dot(&(weight * r))))
    }

    /// The midpoint of the closest approach of both rays.
    pub(crate) fn midpoint(&self, seen: &StereoPixels) -> Result<Point<Camera>, Untriangulable> {
        let l = self.left.normalize(&seen.left).ok_or(Untriangulable::OutsideLens)?.push(1.0);
        let r = self.right.normalize(&seen.right).ok_or(Untriangulable::OutsideLens)?.push(1.0);
        let left_from_right = self.right_from_left.inverse();
        let (a, b) = (l.normalize(), left_from_right.rotation() * r.normalize());
        let t = left_from_right.translation();
        // The minimum of |s a − (t + u b)| by n = a × b avoids cancellation for nearly parallel rays.
        let n = a.cross(&b);
        let determinant = n.norm_squared();
        if !(determinant > 1e-14) {
            return Err(Untriangulable::Parallel);
        }
        let s = t.cross(&b).dot(&n) / determinant;
        let u = t.cross(&a).dot(&n) / determinant;
        if !(s > 0.0 && u > 0.0) {
            return Err(Untriangulable::Behind(s.min(u)));
        }
        Ok(Point::from((a * s + t + b * u) * 0.5))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's virtual camera: f = 500 px, 1024×768, with the right camera at the offset `step`.
    fn rig(step: Vector3<f64>) -> StereoRig {
        let camera = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[]).unwrap();
        StereoRig::new(camera, camera, Transform::new(nalgebra::UnitQuaternion::identity(), -step)).unwrap()
    }

    /// The pixels of `point` with a standard deviation of 0.2 px for each coordinate.
    fn seen(rig: &StereoRig, point: &Point<Camera>) -> UncertainPixels {
        UncertainPixels::independent(rig.project(point).unwrap(), 0.2)
    }

    #[test]
    fn disparity_is_f_b_over_z() {
        let seen = rig(Vector3::new(0.25, 0.0, 0.0)).project(&Point::new(0.3, -0.2, 2.0)).unwrap();
        assert!((seen.left.u - seen.right.u - 500.0 * 0.25 / 2.0).abs() < 1e-12);
        assert!((seen.left.v - seen.right.v).abs() < 1e-12);
    }

    #[test]
    fn depth_noise_is_z_squared_sigma_d_over_f_b() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0));
        let point = Point::new(0.125, 0.0, 4.0);
        let found = rig.triangulate(&seen(&rig, &point)).unwrap();
        assert!(found.point.distance(&point) < 1e-12);
        let expected = 16.0 * (0.2 * 2f64.sqrt()) / (500.0 * 0.25);
        assert!((found.covariance[(2, 2)].sqrt() / expected - 1.0).abs() < 1e-3);
    }

    #[test]
    fn an_error_common_to_both_images_leaves_the_depth_alone() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0));
        let point = Point::new(0.125, 0.0, 4.0);
        let (place, alignment) = (0.3 * 0.3, 0.02 * 0.02);
        let mut pixels = seen(&rig, &point);
        pixels.covariance = Matrix4::identity() * place;
        for i in 0..2 {
            pixels.covariance[(i, i + 2)] = place;
            pixels.covariance[(i + 2, i)] = place;
            pixels.covariance[(i + 2, i + 2)] = place + alignment;
        }
        let found = rig.triangulate(&pixels).unwrap();
        let expected = 16.0 * 0.02 / (500.0 * 0.25);
        assert!((found.covariance[(2, 2)].sqrt() / expected - 1.0).abs() < 1e-6, "{}", found.covariance);
        assert!((found.covariance[(1, 1)].sqrt() / (4.0 * 0.3 / 500.0) - 1.0).abs() < 1e-2);
    }

    #[test]
    fn disagreement_is_the_distance_across_the_epipolar_line() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0));
        let mut pixels = seen(&rig, &Point::new(0.7, -0.3, 3.0));
        assert!(rig.triangulate(&pixels).unwrap().disagreement < 1e-20);
        // 0.4 px between the rows, with a standard deviation of 0.2 √2 px: χ² = 2.
        pixels.at.right.v += 0.4;
        assert!((rig.triangulate(&pixels).unwrap().disagreement - 2.0).abs() < 1e-3);
        pixels.covariance = Matrix4::zeros();
        assert_eq!(rig.triangulate(&pixels), Err(Untriangulable::Singular));
    }

    #[test]
    fn a_vertical_baseline_works_the_same() {
        let rig = rig(Vector3::new(0.0, 0.3, 0.0));
        let point = Point::new(-0.5, 0.4, 3.0);
        assert!(rig.triangulate(&seen(&rig, &point)).unwrap().point.distance(&point) < 1e-12);
    }

    #[test]
    fn swapped_images_lie_behind_the_cameras() {
        let rig = rig(Vector3::new(0.25, 0.0, 0.0));
        let mut seen = seen(&rig, &Point::new(0.0, 0.0, 3.0));
        seen.at = StereoPixels { left: seen.at.right, right: seen.at.left };
        assert!(matches!(rig.triangulate(&seen), Err(Untriangulable::Behind(_))));
    }

    #[test]
    fn an_exchanged_rig_sees_the_same_from_the_other_side() {
        let rotation = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 0.05));
        let camera = *rig(Vector3::x()).left();
        let rig = StereoRig::new(camera, camera, Transform::new(rotation, Vector3::new(-0.2, 0.1, 0.05))).unwrap();
        let (back, point) = (rig.exchanged(), Point::new(0.2, -0.1, 3.0));
        let there = rig.project(&point).unwrap();
        let seen = *rig.right_from_left() * point;
        let again = back.project(&Point::from(seen.coords)).unwrap();
        assert!(again.left.distance(&there.right) < 1e-10 && again.right.distance(&there.left) < 1e-10);
        assert!((back.exchanged().essential() - rig.essential()).norm() < 1e-15);
        let made = StereoRig::new(camera, camera, *back.right_from_left()).unwrap();
        assert!((made.essential() - back.essential()).norm() < 1e-14);
    }

    #[test]
    fn cameras_in_one_place_are_rejected() {
        let camera = *rig(Vector3::x()).left();
        assert!(StereoRig::new(camera, camera, Transform::identity()).is_err());
    }

    #[test]
    fn an_exact_projection_has_no_epipolar_distance() {
        let rig = rig(Vector3::new(0.25, 0.02, 0.01));
        let mut seen = rig.project(&Point::new(0.7, -0.3, 3.0)).unwrap();
        assert!(rig.epipolar_distance(&seen).unwrap() < 1e-10);
        seen.right.v += 1.0;
        let off = rig.epipolar_distance(&seen).unwrap();
        assert!((off - 1.0 / 2f64.sqrt()).abs() < 0.01, "{off}");
    }
}
