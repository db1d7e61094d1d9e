//! From matched pixels to measured points.

use seafix_component::in_range;
use seafix_geometry::{MeasuredPoint, StereoRig, UncertainPixels, UncertainPoint};
use serde::{Deserialize, Serialize};

/// What the triangulation is told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Triangulator {
    /// Standard deviation of a key point's coordinate (px): the covariance of every point scales with it.
    pub sigma_px: f64,
    /// Largest distance from the epipolar line (px, Sampson).
    pub epipolar_px: f64,
    /// Largest depth worth keeping (m).
    pub max_depth: f64,
}

impl Default for Triangulator {
    fn default() -> Self {
        Self { sigma_px: 0.15, epipolar_px: 1.5, max_depth: 20.0 }
    }
}

impl Triangulator {
    /// Whether the settings can be.
    ///
    /// # Errors
    /// The setting that is out of its range, its value, and the range.
    pub fn check(&self) -> Result<(), String> {
        let Self { sigma_px, epipolar_px, max_depth } = *self;
        in_range(sigma_px > 0.0 && sigma_px <= 100.0, "sigma-px", sigma_px, "more than 0, at most 100 (px)")?;
        let band = epipolar_px > 0.0 && epipolar_px <= 1000.0;
        in_range(band, "epipolar-px", epipolar_px, "more than 0, at most 1000 (px)")?;
        in_range(max_depth > 0.0 && max_depth.is_finite(), "max-depth", max_depth, "a positive depth (m)")
    }
}

impl Triangulator {
    /// Replaces `cloud` by the points whose two pixels pass the epipolar test and meet in front of the
    /// cameras, in the order of `pairs`.
    pub fn triangulate_into(&self, pairs: &[UncertainPixels], rig: &StereoRig, cloud: &mut Vec<MeasuredPoint>) {
        cloud.clear();
        let near = pairs
            .iter()
            .filter(|pair| rig.epipolar_distance(&pair.at).is_some_and(|distance| distance <= self.epipolar_px));
        cloud.extend(near.filter_map(|pair| {
            let found = rig.triangulate(pair).ok()?;
            let near = found.point.coords.z <= self.max_depth;
            near.then_some(MeasuredPoint {
                position: UncertainPoint { at: found.point, covariance: found.covariance },
                pixels: Some(*pair),
            })
        }));
    }
}
