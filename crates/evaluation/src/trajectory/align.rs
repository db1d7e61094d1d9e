//! The motion that lays an estimate on its reference.

use nalgebra::{Matrix3, Vector3};

use super::Pose;

/// A similarity of space: p ↦ `scale` · `rotation` · p + `translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// The rotation.
    pub rotation: Matrix3<f64>,
    /// The translation (m).
    pub translation: Vector3<f64>,
    /// The scale; 1 where none was asked for.
    pub scale: f64,
}

impl Alignment {
    /// The alignment that changes nothing.
    pub const IDENTITY: Self =
        Self { rotation: Pose::IDENTITY.rotation, translation: Pose::IDENTITY.position, scale: 1.0 };

    /// The 4×4 matrix (s R, t) as nested rows.
    pub fn rows(&self) -> [[f64; 4]; 4] {
        let mut matrix = (self.rotation * self.scale).to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation);
        matrix.transpose().into()
    }

    /// The pose moved: its position scaled, then both parts turned and shifted.
    #[must_use]
    pub fn apply(&self, pose: &Pose) -> Pose {
        let motion = Pose { rotation: self.rotation, position: self.translation };
        motion.then(&Pose { position: pose.position * self.scale, ..*pose })
    }

    /// The motion that lays one pose on another.
    pub fn onto(reference: &Pose, estimate: &Pose) -> Self {
        let back = estimate.rotation.transpose();
        let inverse = Pose { rotation: back, position: -(back * estimate.position) };
        let motion = reference.then(&inverse);
        Self { rotation: motion.rotation, translation: motion.position, scale: 1.0 }
    }
}

/// Why no alignment is determined.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum UndeterminedAlignment {
    /// Too few poses.
    #[error("{0} poses; an alignment takes 3")]
    TooFew(usize),
    /// The positions of one of the two are one point or one line.
    #[error(
        "the positions leave a rotation open: their second singular value is {second:.3e} m² beside {first:.3e} m² (one point, or one line)"
    )]
    OneLine {
        /// Largest singular value of the cross-covariance (m²).
        first: f64,
        /// The second (m²).
        second: f64,
    },
}

/// The alignment that minimises Σ ‖reference − (s R estimate + t)‖² over the positions (Umeyama,
/// 1991), s = 1 unless `with_scale`.
///
/// # Errors
/// [`UndeterminedAlignment`] with fewer than three poses, or positions on one line: the rotation about it is open.
///
/// # Panics
/// When the two are not of one length.
pub fn align(reference: &[Pose], estimate: &[Pose], with_scale: bool) -> Result<Alignment, UndeterminedAlignment> {
    assert_eq!(reference.len(), estimate.len(), "trajectories of one length");
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
    // Rounding leaves a line about eps of its length squared across.
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
    fn a_line_and_a_point_are_refused() {
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
