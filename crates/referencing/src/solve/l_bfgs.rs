//! L-BFGS: the likelihood of the pixels, maximised by a library that knows nothing of poses.

use argmin::core::Executor;
use argmin::solver::{linesearch::MoreThuenteLineSearch, quasinewton::LBFGS};
use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver, StereoReprojection,
    pixel_cost::{PixelCost, nothing},
    spread::{check, in_front},
    stereo_reprojection::pixels_and_rig,
};
use crate::Observations;

/// The pose of least Σ rᵀ S⁻¹ r over the pixels of both images, the cost of `stereo-reprojection`, by limited-memory
/// BFGS with Moré's and Thuente's line search on six numbers and a numerical gradient: an independent judge of our own
/// minimiser, not a rival in speed. It ends where the cost has no digits left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct LBfgs {
    /// Iterations at most.
    pub(crate) iterations: u64,
    /// Second extent of the points over the first below which they count as a line.
    pub(crate) least_ratio: f64,
}

impl Default for LBfgs {
    fn default() -> Self {
        Self { iterations: 200, least_ratio: 1e-3 }
    }
}

impl Component for LBfgs {
    const NAME: &'static str = "l-bfgs";
    const SUMMARY: &'static str = "maximum likelihood on the pixels by a general-purpose quasi-Newton method";
    const SOURCE: &'static str =
        "Liu, Nocedal, On the limited memory BFGS method for large scale optimization, 1989; the crate argmin";

    fn check(&self) -> Result<(), String> {
        let some = (1..=1_000_000).contains(&self.iterations);
        in_range(some, "iterations", self.iterations, "1 to 1000000")?;
        // Written so that a NaN is refused too.
        let share = self.least_ratio >= 0.0 && self.least_ratio < 1.0;
        in_range(share, "least-ratio", self.least_ratio, "a share from 0 to below 1")
    }
}

impl Solver for LBfgs {
    fn needs_pixels(&self) -> bool {
        true
    }

    fn to_rounding(&self) -> bool {
        false
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.least_ratio)?;
        let rig = pixels_and_rig(data)?;
        in_front(data)?;
        let best = nothing();
        let cost = PixelCost::of(data, rig, &best)?;
        let search = MoreThuenteLineSearch::new().with_c(1e-4, 0.9).map_err(|_| Degenerate::Singular)?;
        let method = LBFGS::new(search, 7).with_tolerance_grad(1e-8).and_then(|m| m.with_tolerance_cost(0.0));
        let method = method.map_err(|_| Degenerate::Singular)?;
        // An error means that the line search found no lower place: where the digits end. The best seen is the answer.
        let _ = Executor::new(cost, method)
            .configure(|state| state.param(vec![0.0; 6]).max_iters(self.iterations))
            .timer(false)
            .run();
        Ok(PixelCost::of(data, rig, &best)?.pose(&best.borrow().1))
    }

    /// That of the likelihood whose maximum this is.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        StereoReprojection::default().covariance(data, at)
    }
}
