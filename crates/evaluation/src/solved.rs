//! The criterion by which the pose of an identification problem counts as correct.

use nalgebra::Vector3;
use seafix_geometry::{Camera, Object, Point, Transform};

use crate::fix::{attitude_error, transfer_rms};

/// The criterion of a correct pose.
///
/// A pose is correct if the RMS error of all model points is at most three times that of the least-squares pose of the
/// true pairs, or if
///
/// - with gates or without a prior: the error of the model's centroid is below 5 cm and the attitude error below 2°;
/// - with putative pairs: the RMS error of all model points is below 1 cm.
///
/// No pose is correct if the true pairs determine none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solved {
    /// RMS error (m) of all model points under the least-squares pose of the true pairs; `None` if they determine no
    /// pose.
    pub ideal_rms: Option<f64>,
    /// Whether the problem gives putative pairs.
    pub putative: bool,
}

impl Solved {
    /// Whether `estimate` is correct.
    pub fn holds(
        &self,
        estimate: &Transform<Object, Camera>,
        truth: &Transform<Object, Camera>,
        model: &[Point<Object>],
    ) -> bool {
        const TIMES_IDEAL: f64 = 3.0;
        const PUTATIVE: f64 = 0.01;
        const CENTROID: f64 = 0.05;
        let (Some(ideal), Some(rms)) = (self.ideal_rms, transfer_rms(estimate, truth, model)) else { return false };
        if rms <= TIMES_IDEAL * ideal {
            return true;
        }
        if self.putative {
            return rms < PUTATIVE;
        }
        let centroid = Point::from(model.iter().map(|at| at.coords).sum::<Vector3<f64>>() / model.len() as f64);
        let off = (*estimate * truth.inverse() * centroid).distance(&centroid);
        off < CENTROID && attitude_error(estimate, truth) < 2f64.to_radians()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: f64, turn_deg: f64) -> Transform<Object, Camera> {
        Transform::exp(&[0.0, 0.0, turn_deg.to_radians(), x, 0.0, 0.0].into())
    }

    const MODEL: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];

    fn solved(rule: Solved, x: f64, turn_deg: f64) -> bool {
        rule.holds(&pose(x, turn_deg), &pose(0.0, 0.0), &MODEL.map(Point::from))
    }

    #[test]
    fn each_rule_by_hand() {
        let gates = Solved { ideal_rms: Some(0.001), putative: false };
        assert!(solved(gates, 0.049, 0.0) && !solved(gates, 0.051, 0.0));
        assert!(solved(gates, 0.0, 1.9) && !solved(gates, 0.0, 2.1));
        // With poorly determined true pairs the best possible pose is correct.
        let poor = Solved { ideal_rms: Some(0.1), putative: false };
        assert!(solved(poor, 0.29, 0.0) && !solved(poor, 0.31, 0.0));
        let putative = Solved { ideal_rms: Some(0.001), putative: true };
        assert!(solved(putative, 0.009, 0.0) && !solved(putative, 0.011, 0.0));
        assert!(!solved(Solved { ideal_rms: None, putative: false }, 0.0, 0.0), "the pairs determine no pose");
    }
}
