//! Measures of a pose difference.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use super::pose::Pose;

/// The measure of a pose difference E, by evo's names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    /// `full`: Frobenius norm ‖E − I‖ of the 4×4 matrices; it mixes metres and radians.
    Full,
    /// `trans_part`: length of the translation of E (m).
    Translation,
    /// `rot_part`: Frobenius norm ‖R − I‖ of the rotation of E.
    Rotation,
    /// `angle_rad`: angle of the rotation of E (rad).
    AngleRad,
    /// `angle_deg`: angle of the rotation of E (degrees).
    AngleDeg,
    /// `point_distance`: distance of the positions (m); in a relative error, the difference of the distances covered.
    PointDistance,
    /// `point_distance_error_ratio`: relative error only; the difference in % of the reference's distance.
    PointDistanceRatio,
}

impl Relation {
    /// All relations.
    pub const ALL: [Self; 7] = [
        Self::Full,
        Self::Translation,
        Self::Rotation,
        Self::AngleRad,
        Self::AngleDeg,
        Self::PointDistance,
        Self::PointDistanceRatio,
    ];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Translation => "trans_part",
            Self::Rotation => "rot_part",
            Self::AngleRad => "angle_rad",
            Self::AngleDeg => "angle_deg",
            Self::PointDistance => "point_distance",
            Self::PointDistanceRatio => "point_distance_error_ratio",
        }
    }

    /// The unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Translation | Self::PointDistance => "m",
            Self::AngleRad => "rad",
            Self::AngleDeg => "deg",
            Self::PointDistanceRatio => "%",
            Self::Full | Self::Rotation => "1",
        }
    }

    /// Whether it is defined for an absolute error.
    pub fn is_absolute(self) -> bool {
        self != Self::PointDistanceRatio
    }

    pub(super) fn absolute(self, reference: &Pose, estimate: &Pose) -> f64 {
        match self {
            Self::Translation | Self::PointDistance | Self::PointDistanceRatio => {
                (estimate.position - reference.position).norm()
            }
            _ => self.size(&reference.to(estimate)),
        }
    }

    /// The measure of a relative error; `None` for a ratio with a zero denominator.
    pub(super) fn relative(self, reference: &Pose, estimate: &Pose) -> Option<f64> {
        let distances = || (reference.position.norm(), estimate.position.norm());
        match self {
            Self::PointDistance => {
                let (reference, estimate) = distances();
                Some((reference - estimate).abs())
            }
            Self::PointDistanceRatio => {
                let (reference, estimate) = distances();
                (reference > 0.0).then(|| (reference - estimate).abs() / reference * 100.0)
            }
            _ => Some(self.size(&reference.to(estimate))),
        }
    }

    fn size(self, difference: &Pose) -> f64 {
        let turn = (difference.rotation - Matrix3::identity()).norm();
        match self {
            Self::Full => turn.hypot(difference.position.norm()),
            Self::Rotation => turn,
            Self::AngleRad => angle(&difference.rotation),
            Self::AngleDeg => angle(&difference.rotation).to_degrees(),
            Self::Translation | Self::PointDistance | Self::PointDistanceRatio => difference.position.norm(),
        }
    }
}

/// The angle of a rotation, in [0, π]: by its quaternion, which is precise for small angles.
pub(super) fn angle(rotation: &Matrix3<f64>) -> f64 {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
    2.0 * libm::atan2(q.imag().norm(), q.w.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_quarter_turn_has_its_sizes() {
        let rotation = *Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2).matrix();
        let turned = Pose { rotation, position: Vector3::new(3.0, 4.0, 0.0) };
        let of = |relation: Relation| relation.absolute(&Pose::IDENTITY, &turned);
        assert!((of(Relation::AngleDeg) - 90.0).abs() < 1e-12);
        assert!((of(Relation::Rotation) - 2.0).abs() < 1e-12);
        assert!((of(Relation::Full) - 29.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(of(Relation::Translation), 5.0);
    }

    #[test]
    fn small_angles_keep_their_digits() {
        for small in [1e-3, 1e-7, 1e-12] {
            let rotation = *Rotation3::from_axis_angle(&Vector3::x_axis(), small).matrix();
            assert!((angle(&rotation) / small - 1.0).abs() < 1e-9, "{small}");
        }
    }
}
