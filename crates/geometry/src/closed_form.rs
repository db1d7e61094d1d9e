//! Closed-form triangulation.

use nalgebra::{Matrix3, Matrix3x4, Vector3};

use crate::{
    frame::{Camera, Point},
    measured::UncertainPixels,
    pinhole::Pixel,
    stereo::{StereoPixels, StereoRig, Triangulation, Untriangulable},
};

/// Step of the numerical derivatives (px).
const STEP: f64 = 1e-3;

impl StereoRig {
    /// Triangulation by the midpoint of the closest approach of both rays.
    ///
    /// The covariance is that of the pixels, propagated to first order.
    ///
    /// # Errors
    /// [`Untriangulable`] if the rays are parallel or meet behind a camera, or if the covariance is singular.
    pub fn triangulate_midpoint(&self, seen: &UncertainPixels) -> Result<Triangulation, Untriangulable> {
        self.in_closed_form(seen, Self::midpoint)
    }

    /// Linear-LS triangulation (Hartley and Sturm, *Triangulation*, 1997).
    ///
    /// It is the least-squares solution X of u_i (r₃·X + t₃) = r₁·X + t₁ and v_i (r₃·X + t₃) = r₂·X + t₂ for both
    /// cameras, with (u, v) the undistorted direction. The covariance is that of the pixels, propagated to first order.
    ///
    /// # Errors
    /// As [`triangulate_midpoint`](Self::triangulate_midpoint).
    pub fn triangulate_linear(&self, seen: &UncertainPixels) -> Result<Triangulation, Untriangulable> {
        self.in_closed_form(seen, Self::linear)
    }

    fn in_closed_form(
        &self,
        seen: &UncertainPixels,
        point: fn(&Self, &StereoPixels) -> Result<Point<Camera>, Untriangulable>,
    ) -> Result<Triangulation, Untriangulable> {
        let information = seen.covariance.cholesky().ok_or(Untriangulable::Singular)?.inverse();
        let found = point(self, &seen.at)?;
        let mut by_pixels = Matrix3x4::zeros();
        for i in 0..4 {
            let [before, after] = [-STEP, STEP].map(|step| point(self, &stepped(&seen.at, i, step)));
            by_pixels.set_column(i, &((after? - before?) / (2.0 * STEP)));
        }
        let covariance = by_pixels * seen.covariance * by_pixels.transpose();
        if !covariance.iter().all(|x| x.is_finite()) || covariance.trace() > found.coords.norm_squared() {
            return Err(Untriangulable::Parallel);
        }
        let shown = self.project(&found).ok_or(Untriangulable::Behind(found.coords.z))?;
        let r = seen.at.coordinates() - shown.coordinates();
        Ok(Triangulation { point: found, covariance, disagreement: r.dot(&(information * r)) })
    }

    fn linear(&self, seen: &StereoPixels) -> Result<Point<Camera>, Untriangulable> {
        let l = self.left().normalize(&seen.left).ok_or(Untriangulable::OutsideLens)?;
        let r = self.right().normalize(&seen.right).ok_or(Untriangulable::OutsideLens)?;
        let (rotation, t) = (self.right_from_left().rotation_matrix(), self.right_from_left().translation());
        let row = |i: usize| rotation.row(i).transpose();
        let equations = [
            (Vector3::new(-1.0, 0.0, l.x), 0.0),
            (Vector3::new(0.0, -1.0, l.y), 0.0),
            (row(2) * r.x - row(0), t.x - r.x * t.z),
            (row(2) * r.y - row(1), t.y - r.y * t.z),
        ];
        let normal: Matrix3<f64> = equations.iter().map(|(a, _)| a * a.transpose()).sum();
        let inverse = normal.try_inverse().ok_or(Untriangulable::Parallel)?;
        let mut point = Point::origin();
        // Iterative refinement: the normal equations square the rounding error of nearly parallel rays.
        for _ in 0..3 {
            let left: Vector3<f64> = equations.iter().map(|(a, b)| a * (b - a.dot(&point.coords))).sum();
            point = point + inverse * left;
        }
        let depth = f64::min(point.coords.z, (*self.right_from_left() * point).coords.z);
        if depth > 0.0 { Ok(point) } else { Err(Untriangulable::Behind(depth)) }
    }
}

/// The pixels with one of their four coordinates moved by `step`.
fn stepped(seen: &StereoPixels, coordinate: usize, step: f64) -> StereoPixels {
    let mut at = seen.coordinates();
    at[coordinate] += step;
    StereoPixels { left: Pixel { u: at[0], v: at[1] }, right: Pixel { u: at[2], v: at[3] } }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::{pinhole::Pinhole, transform::Transform};

    /// A rig with rotated cameras, one in front of the other, and lens distortion.
    fn rig() -> StereoRig {
        let camera = Pinhole::new([1024, 768], [500.0, 505.0], [511.5, 383.5], &[-0.1, 0.02, 0.0, 0.0]).unwrap();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.03, -0.12, 0.05));
        StereoRig::new(camera, camera, Transform::new(turn, Vector3::new(-0.3, 0.05, 0.08))).unwrap()
    }

    #[test]
    fn they_agree_where_the_pixels_do() {
        let rig = rig();
        for point in [Point::new(0.3, -0.2, 2.0), Point::new(-1.5, 0.9, 6.0), Point::new(0.0, 0.0, 0.8)] {
            let exact = UncertainPixels::independent(rig.project(&point).unwrap(), 0.2);
            let best = rig.triangulate(&exact).unwrap();
            for found in [rig.triangulate_midpoint(&exact).unwrap(), rig.triangulate_linear(&exact).unwrap()] {
                assert!(found.point.distance(&point) < 1e-9, "{:?}", found.point);
                assert!(found.disagreement < 1e-12);
                // The standard deviation is at least that of maximum likelihood, and here at most 10 % larger.
                let [own, min] = [found.covariance, best.covariance].map(|c| c.trace().sqrt());
                assert!(own > 0.9999 * min && own < 1.1 * min, "{own} against {min}");
            }
        }
    }

    #[test]
    fn what_is_no_point_is_rejected() {
        let rig = rig();
        let seen = rig.project(&Point::new(0.3, -0.2, 2.0)).unwrap();
        let swapped = StereoPixels { left: seen.right, right: seen.left };
        let mut pixels = UncertainPixels::independent(swapped, 0.2);
        assert!(rig.triangulate_midpoint(&pixels).is_err() && rig.triangulate_linear(&pixels).is_err());
        pixels = UncertainPixels::independent(seen, 0.0);
        assert_eq!(rig.triangulate_midpoint(&pixels), Err(Untriangulable::Singular));
    }
}
