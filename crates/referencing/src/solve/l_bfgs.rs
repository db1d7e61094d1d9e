//! L-BFGS: maximum likelihood of the pixels by a general-purpose library.

use argmin::core::{Executor, State};
use argmin::solver::{linesearch::MoreThuenteLineSearch, quasinewton::LBFGS};
use seafix_component::{Component, Settings};
use seafix_geometry::{Camera, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        degeneracy::Degenerate,
        likelihood::pixel_cost::{Best, PixelCost},
        optimiser::Optimiser,
    },
};

/// Limited-memory BFGS: min Σ rᵀ S⁻¹ r over the pixels of both images.
///
/// The cost is that of `stereo-reprojection`, as a function of six numbers; the method uses the line search of Moré and
/// Thuente and a numerical gradient. It is an independent check of the project's own minimiser and does not compete in
/// speed. It ends at the limit of precision of the cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct LBfgs {
    /// Maximum number of iterations, 1 to 1000000.
    pub(crate) iterations: u64,
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
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
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

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
        let method = method.expect("tolerances are not negative");
        // An error means that the line search found no lower cost, mostly at the limit of precision. The best
        // evaluation is the answer if the gradient vanishes there.
        let run = Executor::new(cost()?, method)
            .configure(|state| state.param(vec![0.0; 6]).max_iters(self.iterations))
            .timer(false)
            .run();
        let taken = run.map_or(self.iterations, |result| result.state().get_iter());
        Ok((cost()?.pose(&best.seen().1), taken))
    }
}
