//! The error of transferred model points under an error of the pose.

use nalgebra::{Matrix3, Matrix3x6, Matrix6};
use seafix_geometry::{Camera, Covariance6, Object, Transform, so3::skew};

use crate::site::model::ModelPoint;

/// The second moments of the model points as seen from the camera.
///
/// A small pose error ξ = (φ, ρ) moves the points by a mean square of ξᵀ A ξ, with A the mean of Jᵀ J and J = (\[p\]×,
/// −I).
pub(super) struct Transfer {
    moments: Matrix6<f64>,
}

impl Transfer {
    pub(super) fn of(model: &[ModelPoint], object_from_camera: &Transform<Object, Camera>) -> Self {
        let camera_from_object = object_from_camera.inverse();
        let mut moments = Matrix6::zeros();
        for point in model {
            let mut j = Matrix3x6::zeros();
            j.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&(camera_from_object * point.at).coords));
            j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
            moments += j.transpose() * j;
        }
        Self { moments: moments / model.len().max(1) as f64 }
    }

    /// The predicted error of the model points (m, RMS over the points, one sigma).
    pub(super) fn rms(&self, covariance: &Covariance6<Object, Camera>) -> f64 {
        // tr A Σ, both symmetric.
        self.moments.component_mul(&covariance.matrix).sum().sqrt()
    }

    /// The RMS distance (m) between the model points under two poses.
    ///
    /// One of the poses must be near that of these moments.
    pub(super) fn between(&self, one: &Transform<Object, Camera>, other: &Transform<Object, Camera>) -> f64 {
        let xi = one.error_to(other);
        xi.dot(&(self.moments * xi)).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;
    use seafix_geometry::Point;

    use super::*;
    use crate::accept::apart::rms_apart;

    #[test]
    fn moments_are_those_of_every_point() {
        let at = [[0.3, 0.1, -0.2], [1.0, -0.4, 0.5], [-0.7, 0.6, 0.1], [0.2, 0.9, -0.8]];
        let model = at.map(|at| ModelPoint::exact("", Point::from(at)));
        let pose = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.4, 0.1, 0.2, -3.0].into());
        let transfer = Transfer::of(&model, &pose);
        let root = Matrix6::from_fn(|i, k| 1e-3 * ((i * 5 + k * 3) % 7) as f64);
        let covariance = Covariance6::new(root * root.transpose());
        let sum: f64 = model.iter().map(|point| covariance.of_point(&(pose.inverse() * point.at)).trace()).sum();
        assert!((transfer.rms(&covariance) - (sum / 4.0).sqrt()).abs() < 1e-12);
        let other = pose.perturbed(&Vector6::new(2e-4, -1e-4, 3e-4, 1e-3, 2e-3, -1e-3));
        let (linear, exact) = (transfer.between(&pose, &other), rms_apart(&model, &pose, &other));
        assert!((linear / exact - 1.0).abs() < 1e-3, "{linear} {exact}");
    }
}
