//! Rigid motions in matrix form, for the inner loops.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use seafix_geometry::{Camera, Object, Transform, so3};

/// A rigid motion p_camera = R p_object + t.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::search) struct Motion {
    pub(in crate::search) rotation: Matrix3<f64>,
    pub(in crate::search) translation: Vector3<f64>,
}

impl Motion {
    pub(in crate::search) fn of(camera_from_object: &Transform<Camera, Object>) -> Self {
        Self { rotation: camera_from_object.rotation_matrix(), translation: camera_from_object.translation() }
    }

    pub(in crate::search) fn transform(&self) -> Transform<Camera, Object> {
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.rotation));
        Transform::new(rotation, self.translation)
    }

    pub(in crate::search) fn apply(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * p + self.translation
    }

    /// The camera's position (object frame).
    pub(in crate::search) fn origin(&self) -> Vector3<f64> {
        -(self.rotation.transpose() * self.translation)
    }

    /// The motion rotated by φ about a place, then translated by τ.
    pub(in crate::search) fn moved(&self, phi: &Vector3<f64>, tau: &Vector3<f64>, about: &Vector3<f64>) -> Self {
        let turn = so3::exp(phi).to_rotation_matrix().into_inner();
        Self { rotation: turn * self.rotation, translation: turn * (self.translation - about) + about + tau }
    }

    /// The least-squares motion of three points, in closed form.
    ///
    /// The optimal motion maps the plane of one triangle to that of the other, centroid to centroid; the remaining
    /// angle is tan θ = Σ (p × c)·n / Σ p·c. `None` if either triangle is nearly a line.
    pub(in crate::search) fn of_three(model: [&Vector3<f64>; 3], cloud: [&Vector3<f64>; 3]) -> Option<Self> {
        let (from, to) = (Plane::of(model)?, Plane::of(cloud)?);
        let (mut sine, mut cosine) = (0.0, 0.0);
        for k in 0..3 {
            let (p, c) = (from.coordinates(model[k]), to.coordinates(cloud[k]));
            cosine += p[0] * c[0] + p[1] * c[1];
            sine += p[0] * c[1] - p[1] * c[0];
        }
        let length = (sine * sine + cosine * cosine).sqrt();
        if !(length > 0.0) {
            return None;
        }
        let (sine, cosine) = (sine / length, cosine / length);
        let turned = Matrix3::from_columns(&[
            to.axes[0] * cosine + to.axes[1] * sine,
            to.axes[1] * cosine - to.axes[0] * sine,
            to.axes[2],
        ]);
        let rotation = turned * Matrix3::from_columns(&from.axes).transpose();
        Some(Self { rotation, translation: to.centre - rotation * from.centre })
    }
}

/// The plane of three points, with axes in it.
struct Plane {
    centre: Vector3<f64>,
    axes: [Vector3<f64>; 3],
}

/// Sine of the angle between two sides below which three points are collinear.
const SLIM: f64 = 0.02;

impl Plane {
    fn of([a, b, c]: [&Vector3<f64>; 3]) -> Option<Self> {
        let (u, v) = (b - a, c - a);
        let normal = u.cross(&v);
        let area = normal.norm();
        let sides = u.norm() * v.norm();
        if !(area > SLIM * sides) {
            return None;
        }
        let x = u / u.norm();
        let z = normal / area;
        Some(Self { centre: (a + b + c) / 3.0, axes: [x, z.cross(&x), z] })
    }

    fn coordinates(&self, p: &Vector3<f64>) -> [f64; 2] {
        let step = p - self.centre;
        [step.dot(&self.axes[0]), step.dot(&self.axes[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{observations::Observation, solve::closed_form::fit as least_squares};
    use seafix_geometry::UncertainPoint;

    #[test]
    fn three_points_have_the_least_squares_motion() {
        let model = [Vector3::new(0.0, 0.1, 0.2), Vector3::new(1.0, -0.2, 0.4), Vector3::new(0.3, 0.8, -0.5)];
        let cloud = [Vector3::new(1.01, 2.0, 3.0), Vector3::new(1.2, 2.93, 3.52), Vector3::new(0.4, 2.1, 3.9)];
        let motion = Motion::of_three(model.each_ref(), cloud.each_ref()).unwrap();
        let observed = |k: usize| Observation {
            measured: UncertainPoint::isotropic(cloud[k].into(), 0.0),
            pixels: None,
            model: model[k].into(),
            model_sigma: 0.0,
        };
        let pairs: Vec<Observation> = (0..3).map(observed).collect();
        let expected = Motion::of(&least_squares(&pairs).inverse());
        assert!((motion.rotation - expected.rotation).amax() < 1e-12);
        assert!((motion.translation - expected.translation).amax() < 1e-12);
        assert!(Motion::of_three([&model[0], &model[1], &model[1]], cloud.each_ref()).is_none());
    }
}
