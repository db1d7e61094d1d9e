//! Alignment of an estimated trajectory to its reference.

use nalgebra::{Matrix3, Vector3};

use super::pose::Pose;

/// A similarity transform: p ↦ `scale` · `rotation` · p + `translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// The rotation.
    pub rotation: Matrix3<f64>,
    /// The translation (m).
    pub translation: Vector3<f64>,
    /// The scale; 1 for a rigid alignment.
    pub scale: f64,
}

impl Alignment {
    /// The identity alignment.
    pub const IDENTITY: Self =
        Self { rotation: Pose::IDENTITY.rotation, translation: Pose::IDENTITY.position, scale: 1.0 };

    /// The 4×4 matrix (s R, t) as nested rows.
    pub fn rows(&self) -> [[f64; 4]; 4] {
        let mut matrix = (self.rotation * self.scale).to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation);
        matrix.transpose().into()
    }

    /// The aligned pose: its position is scaled, then both parts are rotated and translated.
    #[must_use]
    pub fn apply(&self, pose: &Pose) -> Pose {
        let motion = Pose { rotation: self.rotation, position: self.translation };
        motion.then(&Pose { position: pose.position * self.scale, ..*pose })
    }

    /// The alignment that maps the pose `estimate` to `reference`.
    pub fn onto(reference: &Pose, estimate: &Pose) -> Self {
        let back = estimate.rotation.transpose();
        let inverse = Pose { rotation: back, position: -(back * estimate.position) };
        let motion = reference.then(&inverse);
        Self { rotation: motion.rotation, translation: motion.position, scale: 1.0 }
    }
}

/// The reason why an alignment is undetermined.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum UndeterminedAlignment {
    /// Too few poses.
    #[error("{0} poses; an alignment needs at least 3")]
    TooFew(usize),
    /// Positions of one trajectory that coincide or lie on a line.
    #[error(
        "the positions leave a rotation undetermined: their second singular value is {second:.3e} m², the first {first:.3e} m² (a point or a line)"
    )]
    OneLine {
        /// Largest singular value of the cross-covariance (m²).
        first: f64,
        /// Second singular value of the cross-covariance (m²).
        second: f64,
    },
}

/// Umeyama's alignment (1991): the minimum of Σ ‖reference − (s R estimate + t)‖² over the positions.
///
/// The scale s is 1 unless `with_scale` is set.
///
/// # Errors
/// [`UndeterminedAlignment`] with fewer than three poses, or with positions on a line: the rotation about it is
/// undetermined.
///
/// # Panics
/// If the trajectories differ in length.
pub fn align(reference: &[Pose], estimate: &[Pose], with_scale: bool) -> Result<Alignment, UndeterminedAlignment> {
    assert_eq!(reference.len(), estimate.len(), "trajectories of equal length");
    let n = reference.len();
    if n < 3 {
        return Err(UndeterminedAlignment::TooFew(n));
    }
    let mean = |poses: &[Pose]| poses.iter().map(|pose| pose.position).sum::<Vector3<f64>>() / n as f64;
    let (to, from) = (mean(reference), mean(estimate));
    let mut variance = 0.0;
    let mut covariance = Matrix3::zeros();
    for (reference, estimate) in reference.iter().zip(estimate) {
        let arm = estimate.position - from;
        variance += arm.norm_squared() / n as f64;
        covariance += (reference.position - to) * arm.transpose() / n as f64;
    }
    let svd = covariance.svd(true, true);
    let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let [first, second, third] = svd.singular_values.into();
    // Rounding gives a line a second singular value of about ε times the squared length.
    if !(second > f64::EPSILON * first.max(1.0)) {
        return Err(UndeterminedAlignment::OneLine { first, second });
    }
    let sign = if u.determinant() * v_t.determinant() < 0.0 { -1.0 } else { 1.0 };
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    let scale = if with_scale { (first + second + sign * third) / variance } else { 1.0 };
    Ok(Alignment { rotation, translation: to - rotation * from * scale, scale })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn at(position: [f64; 3]) -> Pose {
        Pose { position: position.into(), ..Pose::IDENTITY }
    }

    #[test]
    fn a_known_similarity_is_found() {
        let estimate = [at([0.0; 3]), at([1.0, 0.0, 0.0]), at([0.0, 2.0, 0.0]), at([0.0, 0.0, 3.0])];
        let truth = Alignment {
            rotation: *Rotation3::from_euler_angles(0.3, -0.8, 2.0).matrix(),
            translation: [4.0, -5.0, 6.0].into(),
            scale: 1.7,
        };
        let reference = estimate.map(|pose| truth.apply(&pose));
        let found = align(&reference, &estimate, true).unwrap();
        assert!((found.rotation - truth.rotation).amax() < 1e-14);
        assert!((found.translation - truth.translation).amax() < 1e-13);
        assert!((found.scale - 1.7).abs() < 1e-14);
    }

    #[test]
    fn a_line_and_a_point_are_rejected() {
        let line = [0.0, 1.0, 2.0, 5.0].map(|x| at([x, 2.0 * x, -x]));
        assert!(matches!(align(&line, &line, false), Err(UndeterminedAlignment::OneLine { .. })));
        let point = [at([7.0; 3]); 5];
        assert!(matches!(align(&point, &point, false), Err(UndeterminedAlignment::OneLine { .. })));
        assert_eq!(align(&line[..2], &line[..2], false), Err(UndeterminedAlignment::TooFew(2)));
    }

    #[test]
    fn one_pose_is_placed_on_another() {
        let turn = *Rotation3::from_euler_angles(0.1, 0.2, 0.3).matrix();
        let (a, b) = (Pose { rotation: turn, position: [1.0, 2.0, 3.0].into() }, at([4.0, 5.0, 6.0]));
        let moved = Alignment::onto(&a, &b).apply(&b);
        assert!((moved.position - a.position).amax() < 1e-15 && (moved.rotation - a.rotation).amax() < 1e-15);
    }
}
