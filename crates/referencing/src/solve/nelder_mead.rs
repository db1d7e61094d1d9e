//! Nelder–Mead: the likelihood of the pixels, maximised without any derivative.

use argmin::core::{Executor, State};
use argmin::solver::neldermead;
use seafix_component::Component;
use serde::{Deserialize, Serialize};

use super::{
    Degenerate,
    pixel_cost::{Best, Optimiser, PixelCost},
};

/// The pose of least Σ rᵀ S⁻¹ r over the pixels of both images, the cost of `stereo-reprojection`, by a simplex of seven
/// poses, begun anew from its own answer until that gains nothing: an independent judge that no error of a
/// derivative can mislead. It ends where the cost has no digits left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct NelderMead {
    /// Iterations at most.
    pub(crate) iterations: u64,
    /// Second extent of the points over the first below which they count as a line.
    pub(crate) least_ratio: f64,
}

impl Default for NelderMead {
    fn default() -> Self {
        Self { iterations: 4000, least_ratio: 1e-3 }
    }
}

impl Component for NelderMead {
    const NAME: &'static str = "nelder-mead";
    const SUMMARY: &'static str = "maximum likelihood on the pixels by a simplex, without derivatives";
    const SOURCE: &'static str = "Nelder, Mead, A simplex method for function minimization, 1965; the crate argmin";

    fn check(&self) -> Result<(), String> {
        self.check_limits()
    }
}

/// Simplices begun at most.
const MOST_ROUNDS: usize = 20;

impl Optimiser for NelderMead {
    fn limits(&self) -> (u64, f64) {
        (self.iterations, self.least_ratio)
    }

    fn lower<'a>(
        &self,
        cost: impl Fn() -> Result<PixelCost<'a>, Degenerate>,
        best: &'a Best,
    ) -> Result<u64, Degenerate> {
        let (mut size, mut taken) = (5.0, 0);
        for _ in 0..MOST_ROUNDS {
            let (before, centre) = best.borrow().clone();
            let corner = |i: usize| {
                let mut x = centre.clone();
                if i > 0 {
                    x[i - 1] += size;
                }
                x
            };
            let method = neldermead::NelderMead::new((0..7).map(corner).collect()).with_sd_tolerance(1e-15);
            let method = method.map_err(|_| Degenerate::Singular)?;
            let run =
                Executor::new(cost()?, method).configure(|state| state.max_iters(self.iterations)).timer(false).run();
            taken += run.map_or(self.iterations, |result| result.state().get_iter());
            if before - best.borrow().0 < 1e-10 {
                break;
            }
            size = f64::max(0.1, 0.5 * size);
        }
        Ok(taken)
    }
}
