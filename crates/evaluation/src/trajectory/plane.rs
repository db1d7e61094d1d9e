//! Projection of poses into a coordinate plane.

use nalgebra::{Rotation3, Vector3};

use super::pose::Pose;

/// A coordinate plane of the reference frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plane {
    /// x and y.
    Xy,
    /// x and z.
    Xz,
    /// y and z.
    Yz,
}

impl Plane {
    /// The projected pose, as in evo: the position without its component along the normal, and the rotation about the
    /// normal by the pose's Euler angle of that axis (static x, y, z).
    #[must_use]
    pub fn project(self, pose: &Pose) -> Pose {
        let normal = match self {
            Self::Xy => 2,
            Self::Xz => 1,
            Self::Yz => 0,
        };
        let (m, mut position) = (&pose.rotation, pose.position);
        position[normal] = 0.0;
        let level = m[(0, 0)].hypot(m[(1, 0)]);
        // At the pole the rotation about z is taken as zero.
        let angles = match level > 4.0 * f64::EPSILON {
            true => [m[(2, 1)].atan2(m[(2, 2)]), (-m[(2, 0)]).atan2(level), m[(1, 0)].atan2(m[(0, 0)])],
            false => [(-m[(1, 2)]).atan2(m[(1, 1)]), (-m[(2, 0)]).atan2(level), 0.0],
        };
        let turn = Vector3::ith(normal, angles[normal]);
        Pose { rotation: Rotation3::from_scaled_axis(turn).into_inner(), position }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_component_vanishes() {
        let rotation = Rotation3::from_euler_angles(0.1, -0.2, 0.7).into_inner();
        let pose = Pose { rotation, position: [1.0, 2.0, 3.0].into() };
        for (plane, normal, angle) in [(Plane::Xy, 2, 0.7), (Plane::Xz, 1, -0.2), (Plane::Yz, 0, 0.1)] {
            let flat = plane.project(&pose);
            let expected = Rotation3::from_scaled_axis(Vector3::ith(normal, angle)).into_inner();
            assert!((flat.rotation - expected).amax() < 1e-15, "{plane:?}");
            assert_eq!(flat.position[normal], 0.0);
        }
    }
}
