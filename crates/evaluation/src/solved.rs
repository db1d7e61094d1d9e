//! When the pose of an identification problem counts as found.

use nalgebra::Vector3;
use seafix_geometry::{Camera, Object, Point, Transform};

use crate::{attitude_error, transfer_rms};

/// By which rule a pose is right: it misplaces all model points by no more than three times what the least-squares pose
/// of the true pairs does (RMS), or
///
/// - where shells or nothing bound the candidates: the centroid of the model by less than 5 cm, and its attitude is
///   off by less than 2°;
/// - where putative pairs are given: all model points by less than 1 cm (RMS).
///
/// Where the true pairs determine no pose, none is right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solved {
    /// RMS over all model points of where the least-squares pose of the true pairs misplaces them (m); `None` where they
    /// determine no pose.
    pub ideal_rms: Option<f64>,
    /// Whether putative pairs are given.
    pub putative: bool,
}

impl Solved {
    /// Whether `estimate` is right.
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
        // Poorly determined: what no method could do better is right.
        let poor = Solved { ideal_rms: Some(0.1), putative: false };
        assert!(solved(poor, 0.29, 0.0) && !solved(poor, 0.31, 0.0));
        let putative = Solved { ideal_rms: Some(0.001), putative: true };
        assert!(solved(putative, 0.009, 0.0) && !solved(putative, 0.011, 0.0));
        assert!(!solved(Solved { ideal_rms: None, putative: false }, 0.0, 0.0), "nothing determines a pose");
    }
}
