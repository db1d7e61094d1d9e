//! Nelder–Mead: the likelihood of the pixels, maximised without any derivative.

use argmin::core::{Executor, State};
use argmin::solver::neldermead;
use nalgebra::Vector6;
use seafix_component::Component;
use seafix_geometry::{Camera, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate,
    pixel_cost::{Best, Optimiser, PixelCost},
};
use crate::Observations;

/// The pose of least Σ rᵀ S⁻¹ r over the pixels of both images, the cost of `stereo-reprojection`, by a simplex of seven
/// poses, begun anew about its own answer until that moves it by nothing: an independent judge that no error of a
/// derivative can mislead. Each simplex measures in standard deviations of the pose that it begins at, so that the cost
/// falls alike in all directions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct NelderMead {
    /// Iterations of one simplex at most.
    pub(crate) iterations: u64,
    /// Second extent of the points over the first below which they count as a line.
    pub(crate) min_ratio: f64,
}

impl Default for NelderMead {
    fn default() -> Self {
        Self { iterations: 4000, min_ratio: 1e-3 }
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
const MAX_ROUNDS: usize = 20;
/// Edges of the first simplex, and of the smallest that is begun (standard deviations of the pose).
const EDGES: [f64; 2] = [5.0, 0.1];
/// The standard deviation of the costs of the seven poses at which the first simplex ends, near the minimum, and every later
/// one, at it: χ² is the square of the distance.
const LEVEL: [f64; 2] = [1e-1, 1e-15];
/// The same as a share of the cost: below it are no digits.
const DIGITS: f64 = 1e-15;
/// Two simplices, one on each side, that move their pose by less (standard deviations) are the last.
const STILL: f64 = 1e-4;

impl Optimiser for NelderMead {
    fn limits(&self) -> (u64, f64) {
        (self.iterations, self.min_ratio)
    }

    fn lower(
        &self,
        data: &Observations<'_>,
        rig: &StereoRig,
        start: &Transform<Object, Camera>,
    ) -> Result<(Transform<Object, Camera>, u64), Degenerate> {
        let (mut pose, mut taken) = (*start, 0);
        let [mut edge, min] = EDGES;
        let (mut level, mut still) = (LEVEL[0], 0);
        for _ in 0..MAX_ROUNDS {
            let best = Best::default();
            let cost = || PixelCost::of(data, rig, pose, &best);
            let corner = |i: usize| (1..7).map(|k| if k == i { edge } else { 0.0 }).collect();
            let method = neldermead::NelderMead::new((0..7).map(corner).collect()).with_sd_tolerance(level);
            let method = method.expect("no tolerance is negative");
            let run =
                Executor::new(cost()?, method).configure(|state| state.max_iters(self.iterations)).timer(false).run();
            taken += run.map_or(self.iterations, |result| result.state().get_iter());
            let (lowest, x) = best.seen();
            let moved = Vector6::from(x).norm();
            pose = cost()?.pose(&x);
            still = if moved < STILL { still + 1 } else { 0 };
            if still == 2 {
                break;
            }
            // A simplex may collapse away from the minimum; one on the other side then does not.
            edge = -f64::max(min, 0.1 * edge.abs()).copysign(edge);
            level = f64::max(LEVEL[1], lowest * DIGITS);
        }
        Ok((pose, taken))
    }
}
