//! The cameras of a rig, prepared for many projections.

use nalgebra::{Matrix3, Matrix4x3, Vector3, Vector4};
use seafix_geometry::{Camera, Frame, Pinhole, Point, RightCamera, StereoRig};

/// A stereo rig with precomputed rotation matrix and without needless distortion.
///
/// It computes [`StereoRig::project_with_jacobian`] at a third of the cost.
pub(crate) struct StereoCameras<'a> {
    left: CameraModel<'a>,
    right: CameraModel<'a>,
    /// The right camera's rotation; `None` for a rectified rig.
    turn: Option<Matrix3<f64>>,
    step: Vector3<f64>,
}

struct CameraModel<'a> {
    camera: &'a Pinhole,
    plain: bool,
    focal: [f64; 2],
    principal: [f64; 2],
}

impl<'a> StereoCameras<'a> {
    pub(crate) fn of(rig: &'a StereoRig) -> Self {
        let pose = rig.right_from_left();
        let turn = pose.rotation_matrix();
        Self {
            left: CameraModel::of(rig.left()),
            right: CameraModel::of(rig.right()),
            turn: (turn != Matrix3::identity()).then_some(turn),
            step: pose.translation(),
        }
    }

    /// The pixels of a point (u left, v left, u right, v right) and their derivative (px/m); `None` if a camera cannot
    /// see it.
    #[inline]
    pub(crate) fn project(&self, at: &Vector3<f64>) -> Option<(Vector4<f64>, Matrix4x3<f64>)> {
        let ([ul, vl], [jul, jvl]) = self.left.project::<Camera>(at)?;
        let ([ur, vr], [jur, jvr]) = match &self.turn {
            None => self.right.project::<RightCamera>(&(at + self.step))?,
            Some(turn) => {
                let (pixel, by_right) = self.right.project::<RightCamera>(&(turn * at + self.step))?;
                (pixel, by_right.map(|row| turn.tr_mul(&row)))
            }
        };
        #[rustfmt::skip]
        let j = Matrix4x3::new(
            jul.x, jul.y, jul.z,
            jvl.x, jvl.y, jvl.z,
            jur.x, jur.y, jur.z,
            jvr.x, jvr.y, jvr.z,
        );
        Some((Vector4::new(ul, vl, ur, vr), j))
    }
}

impl<'a> CameraModel<'a> {
    fn of(camera: &'a Pinhole) -> Self {
        let plain = camera.distortion().is_none();
        Self { camera, plain, focal: camera.focal(), principal: camera.principal() }
    }

    /// The pixel, and the rows of its derivative.
    #[inline]
    fn project<F: Frame>(&self, at: &Vector3<f64>) -> Option<([f64; 2], [Vector3<f64>; 2])> {
        if !self.plain {
            let (pixel, j) = self.camera.project_with_jacobian(&Point::<F>::from(*at))?;
            return Some(([pixel.u, pixel.v], [0, 1].map(|row| j.row(row).transpose())));
        }
        if !(at.z > 0.0) {
            return None;
        }
        let near = 1.0 / at.z;
        let (x, y) = (at.x * near, at.y * near);
        let [fx, fy] = self.focal;
        let [a, b] = [fx * near, fy * near];
        let pixel = [fx * x + self.principal[0], fy * y + self.principal[1]];
        Some((pixel, [Vector3::new(a, 0.0, -a * x), Vector3::new(0.0, b, -b * y)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;
    use seafix_geometry::Transform;

    #[test]
    fn they_see_what_the_rig_sees() {
        for distortion in [&[][..], &[-0.1, 0.02, 1e-3, -5e-4]] {
            let camera = Pinhole::new([1024, 768], [500.0, 510.0], [511.5, 383.5], distortion).unwrap();
            for turn in [[0.02, -0.05, 0.01], [0.0; 3]] {
                let right_from_left = Transform::exp(&Vector6::new(turn[0], turn[1], turn[2], -0.25, 0.01, 0.02));
                let rig = StereoRig::new(camera, camera, right_from_left).unwrap();
                let at = Vector3::new(0.4, -0.3, 2.5);
                let (seen, j) = StereoCameras::of(&rig).project(&at).unwrap();
                let (expected, by_point) = rig.project_with_jacobian(&Point::from(at)).unwrap();
                assert!((seen - expected.coordinates()).amax() < 1e-10 && (j - by_point).amax() < 1e-10);
                assert!(StereoCameras::of(&rig).project(&-at).is_none());
            }
        }
    }
}
