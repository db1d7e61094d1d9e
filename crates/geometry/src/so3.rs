//! The rotation group SO(3): exponential, logarithm and Jacobian.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

/// The matrix of the cross product: `skew(a) * b = a × b`.
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The exponential: the rotation by the angle |φ| (rad) about φ/|φ|.
pub fn exp(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle = phi.norm();
    let half = 0.5 * angle;
    // The quotient sin(half) / angle; near zero its series, because the quotient loses digits.
    let scale = if angle < 1e-4 { 0.5 - angle * angle / 48.0 } else { libm::sin(half) / angle };
    UnitQuaternion::new_normalize(Quaternion::from_parts(libm::cos(half), phi * scale))
}

/// The logarithm: the rotation vector φ of `rotation` with |φ| in [0, π] (rad), the inverse of [`exp`].
pub fn log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let q = if rotation.w < 0.0 { -rotation.into_inner() } else { rotation.into_inner() };
    let sine = q.imag().norm();
    if sine < 1e-9 { q.imag() * 2.0 } else { q.imag() * (2.0 * libm::atan2(sine, q.w) / sine) }
}

/// The logarithm of a rotation matrix; the matrix is assumed to be orthonormal.
pub fn log_of_matrix(rotation: &Matrix3<f64>) -> Vector3<f64> {
    // The axis times sin θ, and cos θ.
    let r = rotation;
    let axis = Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12) * 0.5;
    let (sine, cosine) = (axis.norm(), (r.trace() - 1.0) * 0.5);
    if cosine < -0.5 {
        // Near a rotation by π the sine loses the axis.
        return log(&UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*r)));
    }
    if sine < 1e-9 { axis } else { axis * (libm::atan2(sine, cosine) / sine) }
}

/// The angle of `rotation`, in [0, π] (rad); never NaN.
pub fn angle(rotation: &UnitQuaternion<f64>) -> f64 {
    2.0 * libm::atan2(rotation.imag().norm(), rotation.w.abs())
}

/// The left Jacobian V(φ): Exp(φ, ρ) translates by V(φ) ρ.
///
/// V = I + (1 − cos θ)/θ² \[φ\]× + (θ − sin θ)/θ³ \[φ\]×², θ = |φ|.
pub fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let theta = phi.norm();
    let t2 = theta * theta;
    let (a, b) = if theta < 1e-3 {
        (0.5 - t2 / 24.0, 1.0 / 6.0 - t2 / 120.0)
    } else {
        let half = libm::sin(0.5 * theta);
        (2.0 * half * half / t2, (theta - libm::sin(theta)) / (t2 * theta))
    };
    let s = skew(phi);
    Matrix3::identity() + s * a + s * s * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_z() {
        let turn = exp(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        assert!((turn * Vector3::x() - Vector3::y()).norm() < 1e-15);
        assert!((log(&turn).z - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    }

    #[test]
    fn matrices_and_quaternions_have_one_logarithm() {
        let axis = Vector3::new(0.6, -0.48, 0.64);
        for angle in [0.0, 1e-12, 1e-8, 1e-3, 0.5, 1.5, 2.0, 2.2, 3.0, 3.1] {
            let turn = exp(&(axis * angle));
            let found = log_of_matrix(&turn.to_rotation_matrix().into_inner());
            assert!((found - axis * angle).norm() < 1e-14 + 1e-12 * angle, "{angle}: {found}");
        }
    }

    #[test]
    fn the_left_jacobian_meets_its_series() {
        let phi = Vector3::new(0.3e-3, -0.7e-3, 0.65e-3);
        let direct = left_jacobian(&phi);
        let series = left_jacobian(&(phi * 0.999));
        assert!((direct - series).norm() < 1e-6);
    }
}
