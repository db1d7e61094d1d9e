//! Fusion of fix and known pose by their covariances, with considered model errors.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    join::{consider_states, gate},
    rule::{Contradiction, Fusion},
};
use crate::chain::ObjectPose;

/// The Schmidt–Kalman update: it gates a fix by its innovation, then takes the minimum-variance pose.
///
/// With F = J_r(r)⁻¹ the innovation is r = log(T_known⁻¹ T_fix) = ξ_known − F ξ_fix. All fixes of an object contain the
/// same model errors; known pose and fix therefore have the cross-covariance X = E\[ξ_known (F ξ_fix)ᵀ\]. Errors of
/// models and surveys are considered as by Schmidt ([`ConsiderStates`](crate::ConsiderStates)). With S = Σ_known + F
/// Σ_fix Fᵀ − X − Xᵀ a fix is rejected if rᵀ S⁻¹ r exceeds χ²₆(`confidence`); otherwise the gain is (Σ_known − X) S⁻¹.
///
/// Fixes treated as independent would make a pose after sixty fixes eight times more accurate than after one, although
/// the model error is unchanged.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields)]
pub struct Fuse {
    /// The fraction of correct fixes that passes the gate, between 0 and 1.
    ///
    /// The default of 0.999 loses one correct fix in a thousand. A wider gate accepts an object that is displaced by
    /// 0.1 m in more than one dive of a hundred.
    pub confidence: f64,
}

impl Default for Fuse {
    fn default() -> Self {
        Self { confidence: 0.999 }
    }
}

impl Component for Fuse {
    const NAME: &'static str = "fuse";
    const SUMMARY: &'static str =
        "a consistent fix is fused with the known pose; model and survey errors are consider states";
    const SOURCE: &'static str = "Schmidt, Application of state-space methods to navigation problems, 1966; on SE(3): \
                                  Barfoot, Furgale, Associating uncertainty with three-dimensional poses, 2014";

    fn check(&self) -> Result<(), String> {
        in_range(self.confidence > 0.0 && self.confidence < 1.0, "confidence", self.confidence, "a number in (0, 1)")
    }
}

impl Fusion for Fuse {
    fn take(&self, known: &ObjectPose, fix: &ObjectPose) -> Result<ObjectPose, Contradiction> {
        gate(known, fix, self.confidence)?;
        Ok(consider_states(known, fix).unwrap_or_else(|| fix.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Camera, Covariance6, Object, Transform};

    fn at(xi: [f64; 6], sigma: f64) -> ObjectPose {
        let object_from_camera = Transform::<Object, Camera>::exp(&xi.into());
        ObjectPose::new(object_from_camera, Covariance6::isotropic(sigma, sigma))
    }

    #[test]
    fn equal_knowledge_meets_in_the_middle() {
        let (a, b) = (at([0.0; 6], 0.1), at([0.0, 0.0, 0.0, 0.1, 0.0, 0.0], 0.1));
        let both = Fuse::default().take(&a, &b).expect("it agrees");
        assert!((both.object_from_camera.translation().x - 0.05).abs() < 1e-12);
        assert!((both.covariance.matrix[(3, 3)] - 0.005).abs() < 1e-5);
    }

    #[test]
    fn a_fix_far_off_is_rejected_with_its_number() {
        let (a, b) = (at([0.0; 6], 0.01), at([0.0, 0.0, 0.0, 0.1, 0.0, 0.0], 0.01));
        let Contradiction { nis, limit } = Fuse::default().take(&a, &b).expect_err("it is off by 7 sigma");
        assert!((nis - 50.0).abs() < 1e-9 && limit < 30.0);
    }
}
