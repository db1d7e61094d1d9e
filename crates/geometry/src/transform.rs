//! Rigid transforms between typed frames.

use std::{fmt, marker::PhantomData, ops::Mul};

use nalgebra::{Isometry3, Matrix3, Matrix4, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::{
    frame::{Frame, Point},
    so3,
};

/// A rigid transform: it maps coordinates in frame `B` to coordinates in frame `A`, `p_a = a_from_b * p_b`.
///
/// ```
/// use nalgebra::Vector3;
/// use seafix_geometry::{Camera, Object, Point, Transform};
///
/// let object_from_camera = Transform::<Object, Camera>::exp(&[0.0, 0.0, 0.0, 1.0, 2.0, 3.0].into());
/// assert_eq!(object_from_camera * Point::origin(), Point::new(1.0, 2.0, 3.0));
/// ```
#[derive(Clone, Copy, PartialEq)]
pub struct Transform<A, B> {
    isometry: Isometry3<f64>,
    frames: PhantomData<(A, B)>,
}

/// The reason why a 4×4 matrix is not a rigid transform.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotRigid {
    /// A NaN or infinite entry.
    #[error("entry ({row}, {column}) is {value}; give a finite number")]
    NotFinite {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// A last row other than (0, 0, 0, 1).
    #[error("the last row is {0:?}; it must be [0, 0, 0, 1] (column vectors: p_a = a_from_b * p_b)")]
    LastRow([f64; 4]),
    /// A rotation part that is not orthonormal.
    #[error("the rotation part deviates from orthonormal by {0:.3e}; give it to 1e-6 or better")]
    NotOrthonormal(f64),
    /// A rotation part that is a reflection.
    #[error("the rotation part has determinant {0:.6}; a rotation has +1 (is an axis flipped?)")]
    Reflection(f64),
}

impl<A: Frame, B: Frame> Transform<A, B> {
    /// The transform that rotates by `rotation`, then translates by `translation` (m, axes of `A`).
    pub fn new(rotation: UnitQuaternion<f64>, translation: Vector3<f64>) -> Self {
        Self::from_isometry(Isometry3::from_parts(Translation3::from(translation), rotation))
    }

    fn from_isometry(isometry: Isometry3<f64>) -> Self {
        Self { isometry, frames: PhantomData }
    }

    /// The identity: only the name of the frame changes.
    pub fn identity() -> Self {
        Self::from_isometry(Isometry3::identity())
    }

    /// The transform with orthonormal axes as the columns of `axes` and this origin.
    ///
    /// The caller guarantees that `axes` is a rotation up to rounding error.
    pub fn from_axes(axes: &Matrix3<f64>, origin: Vector3<f64>) -> Self {
        let mut rotation = UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(*axes));
        rotation.renormalize();
        Self::new(rotation, origin)
    }

    /// The transform of a homogeneous 4×4 matrix (columns: `p_a = M p_b`).
    ///
    /// # Errors
    /// [`NotRigid`] if an entry is not finite, the last row is not (0, 0, 0, 1), or the rotation part deviates by more
    /// than 1e-6 or is a reflection. Data are never corrected silently.
    pub fn from_matrix(m: &Matrix4<f64>) -> Result<Self, NotRigid> {
        for row in 0..4 {
            for column in 0..4 {
                let value = m[(row, column)];
                if !value.is_finite() {
                    return Err(NotRigid::NotFinite { row, column, value });
                }
            }
        }
        let last = [m[(3, 0)], m[(3, 1)], m[(3, 2)], m[(3, 3)]];
        if last.iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(a, b)| (a - b).abs() > 1e-9) {
            return Err(NotRigid::LastRow(last));
        }
        let axes: Matrix3<f64> = m.fixed_view::<3, 3>(0, 0).into();
        let deviation = (axes.transpose() * axes - Matrix3::identity()).amax();
        if deviation > 1e-6 {
            return Err(NotRigid::NotOrthonormal(deviation));
        }
        if axes.determinant() < 0.0 {
            return Err(NotRigid::Reflection(axes.determinant()));
        }
        Ok(Self::from_axes(&axes, m.fixed_view::<3, 1>(0, 3).into()))
    }

    /// The homogeneous 4×4 matrix (column convention).
    pub fn matrix(&self) -> Matrix4<f64> {
        self.isometry.to_homogeneous()
    }

    /// The transform of nested rows, as files store it.
    ///
    /// # Errors
    /// As [`from_matrix`](Self::from_matrix).
    pub fn from_rows(rows: &[[f64; 4]; 4]) -> Result<Self, NotRigid> {
        Self::from_matrix(&Matrix4::from_fn(|row, column| rows[row][column]))
    }

    /// The homogeneous matrix as nested rows, as files store it.
    pub fn rows(&self) -> [[f64; 4]; 4] {
        let matrix = self.matrix();
        std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
    }

    /// The rotation: the axes of `B` seen in `A`.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        self.isometry.rotation
    }

    /// The rotation as a matrix; its columns are the unit vectors of `B` seen in `A`.
    pub fn rotation_matrix(&self) -> Matrix3<f64> {
        self.isometry.rotation.to_rotation_matrix().into_inner()
    }

    /// The origin of `B` in `A` (m).
    pub fn translation(&self) -> Vector3<f64> {
        self.isometry.translation.vector
    }

    /// The inverse transform, from `A` to `B`.
    #[must_use]
    pub fn inverse(&self) -> Transform<B, A> {
        Transform::from_isometry(self.isometry.inverse())
    }

    /// The SE(3) exponential Exp(ξ) of ξ = (φ, ρ): rotation φ (rad) and translation V(φ) ρ (m).
    pub fn exp(xi: &Vector6<f64>) -> Self {
        let (phi, rho) = (xi.fixed_rows::<3>(0).into_owned(), xi.fixed_rows::<3>(3).into_owned());
        Self::new(so3::exp(&phi), so3::left_jacobian(&phi) * rho)
    }

    /// The SE(3) logarithm: ξ = (φ, ρ) with Exp(ξ) = self and |φ| ≤ π.
    pub fn log(&self) -> Vector6<f64> {
        let phi = so3::log(&self.rotation());
        let rho = so3::left_jacobian(&phi).try_inverse().expect("the left Jacobian is regular for angles up to pi")
            * self.translation();
        let mut xi = Vector6::zeros();
        xi.fixed_rows_mut::<3>(0).copy_from(&phi);
        xi.fixed_rows_mut::<3>(3).copy_from(&rho);
        xi
    }

    /// The adjoint Ad(T): T · Exp(ξ) = Exp(Ad(T) ξ) · T.
    pub fn adjoint(&self) -> Matrix6<f64> {
        let r = self.rotation_matrix();
        let mut adjoint = Matrix6::zeros();
        adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
        adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
        adjoint.fixed_view_mut::<3, 3>(3, 0).copy_from(&(so3::skew(&self.translation()) * r));
        adjoint
    }

    /// The perturbed transform `self · Exp(ξ)`, with ξ in frame `B`.
    #[must_use]
    pub fn perturbed(&self, xi: &Vector6<f64>) -> Self {
        *self * Transform::<B, B>::exp(xi)
    }

    /// The error ξ of this estimate, in frame `B`: `truth = self · Exp(ξ)`.
    pub fn error_to(&self, truth: &Self) -> Vector6<f64> {
        (self.inverse() * *truth).log()
    }

    /// The same motion with other frame types, for a problem solved in the role of another.
    ///
    /// Examples: an earlier cloud of odometry in the role of a model; an object's frame as the frame of the site.
    pub fn relabel<C: Frame, D: Frame>(&self) -> Transform<C, D> {
        Transform::from_isometry(self.isometry)
    }

    /// The transform with its quaternion normalised, after long chains of products.
    #[must_use]
    pub fn renormalized(mut self) -> Self {
        self.isometry.rotation.renormalize();
        self
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.isometry.to_homogeneous().iter().all(|x| x.is_finite())
    }
}

impl<A: Frame, B: Frame, C: Frame> Mul<Transform<B, C>> for Transform<A, B> {
    type Output = Transform<A, C>;

    /// The composition `a_from_c = a_from_b * b_from_c`.
    fn mul(self, b_from_c: Transform<B, C>) -> Transform<A, C> {
        Transform::from_isometry(self.isometry * b_from_c.isometry)
    }
}

impl<A: Frame, B: Frame> Mul<Point<B>> for Transform<A, B> {
    type Output = Point<A>;

    /// The transformed point `p_a = a_from_b * p_b`.
    fn mul(self, point: Point<B>) -> Point<A> {
        Point::from(self.isometry.rotation * point.coords + self.isometry.translation.vector)
    }
}

impl<A, B> fmt::Display for Transform<A, B> {
    /// Translation (m) and rotation vector (degrees), for people.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (t, r) = (self.isometry.translation.vector, self.isometry.rotation.scaled_axis().map(f64::to_degrees));
        write!(f, "[{:.4}, {:.4}, {:.4}] m, rotation [{:.3}, {:.3}, {:.3}]°", t.x, t.y, t.z, r.x, r.y, r.z)
    }
}

impl<A, B> fmt::Debug for Transform<A, B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |full: &'static str| full.rsplit("::").next().unwrap_or("?");
        let (t, q) = (self.isometry.translation.vector, self.isometry.rotation);
        write!(
            f,
            "{}_from_{} {{ t: [{}, {}, {}], q_xyzw: [{}, {}, {}, {}] }}",
            name(std::any::type_name::<A>()),
            name(std::any::type_name::<B>()),
            t.x,
            t.y,
            t.z,
            q.i,
            q.j,
            q.k,
            q.w
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Camera, Object};

    #[test]
    fn a_transform_prints_its_translation_and_its_rotation_vector() {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let pose = Transform::<Object, Camera>::new(turn, Vector3::new(1.0, -2.5, 0.0));
        assert_eq!(pose.to_string(), "[1.0000, -2.5000, 0.0000] m, rotation [0.000, 0.000, 90.000]°");
    }

    #[test]
    fn a_quarter_turn_and_a_step() {
        let turn = so3::exp(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let object_from_camera = Transform::<Object, Camera>::new(turn, Vector3::new(1.0, 0.0, 0.0));
        let p = object_from_camera * Point::new(1.0, 0.0, 0.0);
        assert!(p.distance(&Point::new(1.0, 1.0, 0.0)) < 1e-15);
        assert!((object_from_camera.inverse() * p).distance(&Point::new(1.0, 0.0, 0.0)) < 1e-15);
    }

    #[test]
    fn the_adjoint_carries_a_perturbation_across() {
        let t = Transform::<Object, Camera>::exp(&[0.3, -0.2, 0.5, 1.0, 2.0, -1.0].into());
        let xi = Vector6::from([0.02, 0.01, -0.03, 0.2, -0.1, 0.3]);
        let left = Transform::<Object, Object>::exp(&(t.adjoint() * xi)) * t;
        assert!((left.matrix() - t.perturbed(&xi).matrix()).amax() < 1e-14);
    }

    #[test]
    fn a_matrix_that_is_no_motion_is_rejected() {
        let mut m = Matrix4::identity();
        m[(0, 0)] = -1.0;
        assert!(matches!(Transform::<Object, Camera>::from_matrix(&m), Err(NotRigid::Reflection(_))));
        m[(0, 0)] = 1.01;
        assert!(matches!(Transform::<Object, Camera>::from_matrix(&m), Err(NotRigid::NotOrthonormal(_))));
        m[(0, 0)] = f64::NAN;
        assert!(matches!(Transform::<Object, Camera>::from_matrix(&m), Err(NotRigid::NotFinite { .. })));
        let m = Matrix4::identity().append_translation(&Vector3::new(1.0, 2.0, 3.0)).transpose();
        assert!(matches!(Transform::<Object, Camera>::from_matrix(&m), Err(NotRigid::LastRow(_))));
    }
}
