//! Conversion of the covariance of a ROS odometry pose.

use nalgebra::Matrix6;
use seafix_geometry::{Camera, Covariance6, Frame, Transform, World};

use super::messages::Pose;

/// The covariance of the camera's pose; `None` if the message has none.
///
/// ROS defines the position error δp and the rotation error δθ along the axes of the parent: p = p̂ + δp, R = Exp(δθ)
/// R̂. As a right perturbation this is ξ = (R̂ᵀδθ, R̂ᵀδp), transferred to the camera by the adjoint of
/// `camera_from_child`.
pub(crate) fn covariance<C: Frame>(
    pose: &Pose,
    given: &Matrix6<f64>,
    child_from_camera: &Transform<C, Camera>,
) -> Option<Covariance6<World, Camera>> {
    let turn = pose.rotation.inverse().to_rotation_matrix().into_inner();
    // The permutation from (δp, δθ) to (φ, ρ).
    let mut swap = Matrix6::zeros();
    swap.fixed_view_mut::<3, 3>(0, 3).copy_from(&turn);
    swap.fixed_view_mut::<3, 3>(3, 0).copy_from(&turn);
    let carried = child_from_camera.inverse().adjoint() * swap;
    let matrix = carried * given * carried.transpose();
    let symmetric = (matrix + matrix.transpose()) * 0.5;
    (symmetric.iter().all(|number| number.is_finite()) && symmetric.cholesky().is_some())
        .then(|| Covariance6::new(symmetric))
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};
    use seafix_geometry::Body;

    use super::*;

    /// A case by hand: the vehicle is turned by 90° about z, and its position has an error of 1 along the world's x,
    /// which is the vehicle's −y.
    #[test]
    fn the_axes_are_the_child_s_and_rotation_comes_first() {
        let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let pose = Pose { translation: Vector3::new(5.0, 0.0, 0.0), rotation: quarter };
        let given = Matrix6::from_diagonal(&[1.0, 0.04, 0.09, 0.01, 0.02, 0.03].into());
        let same = covariance(&pose, &given, &Transform::<Body, Camera>::identity()).unwrap().matrix;
        let expected = [0.02, 0.01, 0.03, 0.04, 1.0, 0.09];
        assert!((same - Matrix6::from_diagonal(&expected.into())).amax() < 1e-15, "{same}");
        assert!(covariance(&pose, &Matrix6::zeros(), &Transform::<Body, Camera>::identity()).is_none());
    }
}
