//! L-BFGS: the likelihood of the pixels, maximised by a library that knows nothing of poses.

use argmin::core::{Executor, State};
use argmin::solver::{linesearch::MoreThuenteLineSearch, quasinewton::LBFGS};
use seafix_component::Component;
use seafix_geometry::{Camera, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate,
    pixel_cost::{Best, Optimiser, PixelCost},
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
    pub(crate) min_ratio: f64,
}

impl Default for LBfgs {
    fn default() -> Self {
        Self { iterations: 200, min_ratio: 1e-3 }
    }
}

impl Component for LBfgs {
    const NAME: &'static str = "l-bfgs";
    const SUMMARY: &'static str = "maximum likelihood on the pixels by a general-purpose quasi-Newton method";
    const SOURCE: &'static str =
        "Liu, Nocedal, On the limited memory BFGS method for large scale optimization, 1989; the crate argmin";

    fn check(&self) -> Result<(), String> {
        self.check_limits()
    }
}

impl Optimiser for LBfgs {
    fn limits(&self) -> (u64, f64) {
        (self.iterations, self.min_ratio)
    }

    fn lower(
        &self,
        data: &Observations<'_>,
        rig: &StereoRig,
        start: &Transform<Object, Camera>,
    ) -> Result<(Transform<Object, Camera>, u64), Degenerate> {
        let best = Best::default();
        let cost = || PixelCost::of(data, rig, *start, &best);
        let search = MoreThuenteLineSearch::new().with_c(1e-4, 0.9).expect("0 < 1e-4 < 0.9 < 1");
        let method = LBFGS::new(search, 7).with_tolerance_grad(1e-8).and_then(|m| m.with_tolerance_cost(0.0));
        let method = method.expect("no tolerance is negative");
        // An error means that the line search found no lower place: mostly where the digits end. The best seen is the answer,
        // if nothing pulls there.
        let run = Executor::new(cost()?, method)
            .configure(|state| state.param(vec![0.0; 6]).max_iters(self.iterations))
            .timer(false)
            .run();
        let taken = run.map_or(self.iterations, |result| result.state().get_iter());
        Ok((cost()?.pose(&best.seen().1), taken))
    }
}
