//! Covariance intersection of fix and known pose.

use nalgebra::Matrix6;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    join::{carried_back, gate, joined},
    rule::{Contradiction, Fusion},
};
use crate::chain::ObjectPose;

/// Covariance intersection: it gates a fix by its innovation, then combines both poses under unknown correlation.
///
/// Fixes of one object share errors of its model, of the calibration and of the illumination. The fusion `fuse`
/// accounts for the model's errors only; the others have no known covariance. The intersection Σ⁻¹ = ω Σ_known⁻¹ + (1 −
/// ω) Σ_fix⁻¹, with the ω of minimum det Σ, is at least as large as the true covariance for every correlation of the
/// two inputs.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields)]
pub struct Intersect {
    /// The fraction of correct fixes that passes the gate, between 0 and 1; see [`Fuse`](super::Fuse).
    pub confidence: f64,
}

impl Default for Intersect {
    fn default() -> Self {
        Self { confidence: 0.999 }
    }
}

impl Component for Intersect {
    const NAME: &'static str = "intersect";
    const SUMMARY: &'static str =
        "a consistent fix is combined with the known pose, valid for any correlation of their errors";
    const SOURCE: &'static str = "Julier, Uhlmann, A non-divergent estimation algorithm in the presence of unknown \
                                  correlations, American Control Conference 1997";

    fn check(&self) -> Result<(), String> {
        in_range(self.confidence > 0.0 && self.confidence < 1.0, "confidence", self.confidence, "a number in (0, 1)")
    }
}

impl Fusion for Intersect {
    fn take(&self, known: &ObjectPose, fix: &ObjectPose) -> Result<ObjectPose, Contradiction> {
        gate(known, fix, self.confidence)?;
        let innovation = known.object_from_camera.error_to(&fix.object_from_camera);
        let fix_here = carried_back(&fix.covariance.matrix, &innovation);
        let both = known.covariance.matrix.try_inverse().zip(fix_here.try_inverse());
        let omega = both.map_or(0.0, |(known, fix)| min_determinant(&known, &fix));
        Ok(joined(known, fix, [omega, 1.0 - omega]).unwrap_or_else(|| fix.clone()))
    }
}

/// The ω in [0, 1] of maximum det(ω A + (1 − ω) B), by golden-section search; its logarithm is concave.
fn min_determinant(a: &Matrix6<f64>, b: &Matrix6<f64>) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let log_det = |omega: f64| {
        let factor = (a * omega + b * (1.0 - omega)).cholesky();
        factor.map_or(f64::NEG_INFINITY, |factor| factor.l().diagonal().iter().map(|x| x.ln()).sum())
    };
    let (mut low, mut high) = (0.0, 1.0);
    let (mut left, mut right) = (1.0 - GOLDEN, GOLDEN);
    let (mut at_left, mut at_right): (f64, f64) = (log_det(left), log_det(right));
    for _ in 0..40 {
        if at_left < at_right {
            low = left;
            (left, at_left) = (right, at_right);
            right = low + GOLDEN * (high - low);
            at_right = log_det(right);
        } else {
            high = right;
            (right, at_right) = (left, at_left);
            left = high - GOLDEN * (high - low);
            at_left = log_det(left);
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Camera, Covariance6, Object, Transform};

    fn at(x: f64, sigma: f64) -> ObjectPose {
        let object_from_camera = Transform::<Object, Camera>::exp(&[0.0, 0.0, 0.0, x, 0.0, 0.0].into());
        ObjectPose::new(object_from_camera, Covariance6::isotropic(sigma, sigma))
    }

    #[test]
    fn the_same_again_teaches_nothing() {
        let twice = Intersect::default().take(&at(0.0, 0.1), &at(0.1, 0.1)).unwrap();
        assert!((twice.covariance.matrix[(3, 3)] - 0.01).abs() < 1e-9, "{}", twice.covariance.matrix);
        assert!(twice.object_from_camera.translation().x > 0.0 && twice.object_from_camera.translation().x < 0.1);
    }

    #[test]
    fn the_better_of_two_is_kept() {
        let fine = Intersect::default().take(&at(0.0, 0.1), &at(0.01, 0.001)).unwrap();
        assert!((fine.object_from_camera.translation().x - 0.01).abs() < 1e-6);
        assert!((fine.covariance.matrix[(3, 3)].sqrt() - 0.001).abs() < 1e-6);
        assert!(Intersect::default().take(&at(0.0, 0.001), &at(0.1, 0.001)).is_err());
    }

    #[test]
    fn each_knows_another_axis() {
        let turned = |mut s: ObjectPose, axis: usize| {
            s.covariance.matrix[(axis, axis)] = 1.0;
            s
        };
        let both = Intersect::default().take(&turned(at(0.0, 0.1), 3), &turned(at(0.0, 0.1), 4)).unwrap();
        let variance = [both.covariance.matrix[(3, 3)], both.covariance.matrix[(4, 4)]];
        assert!(variance.iter().all(|v| (0.015..0.025).contains(v)), "{variance:?}");
    }
}
