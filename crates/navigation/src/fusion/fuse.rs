//! Fix and odometry, each by its information.

use seafix_component::{Component, in_range};
use serde::{Deserialize, Serialize};

use super::{
    Contradiction, Fusion,
    join::{gate, joined},
};
use crate::Standing;

/// Gates a fix by its innovation, then joins both by their information.
///
/// With r = log(T_known⁻¹ T_fix) the fix says ξ = r + J_r(r)⁻¹ η about the error ξ of what was known. A fix
/// with rᵀ (Σ_known + Σ_fix)⁻¹ r beyond χ²₆(`confidence`) is rejected; else the error is estimated by
/// (Σ_known⁻¹ + Σ_fix⁻¹)⁻¹ Σ_fix⁻¹ r, repeated about the new pose.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fuse {
    /// The share of right fixes that passes the gate.
    pub confidence: f64,
}

impl Default for Fuse {
    fn default() -> Self {
        Self { confidence: 0.9999 }
    }
}

impl Component for Fuse {
    const NAME: &'static str = "fuse";
    const SUMMARY: &'static str = "a fix that agrees is joined with what was known, by their information";
    const SOURCE: &'static str = "Bar-Shalom, Li, Kirubarajan, Estimation with applications to tracking and \
                                  navigation, 2001; on SE(3): Barfoot, Furgale, Associating uncertainty with \
                                  three-dimensional poses, 2014";

    fn check(&self) -> Result<(), String> {
        in_range(self.confidence > 0.0 && self.confidence < 1.0, "confidence", self.confidence, "between zero and one")
    }
}

impl Fusion for Fuse {
    fn take(&self, known: &Standing, fix: &Standing) -> Result<Standing, Contradiction> {
        gate(known, fix, self.confidence)?;
        Ok(joined(known, fix, [1.0; 2]).unwrap_or(*fix))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Camera, Covariance6, Object, Transform};

    fn at(xi: [f64; 6], sigma: f64) -> Standing {
        let object_from_camera = Transform::<Object, Camera>::exp(&xi.into());
        Standing::new(object_from_camera, Covariance6::isotropic(sigma, sigma))
    }

    #[test]
    fn equal_knowledge_meets_half_way() {
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
