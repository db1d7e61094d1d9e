//! Nelder–Mead: maximum likelihood of the pixels without derivatives.

use argmin::core::{Executor, State};
use argmin::solver::neldermead;
use nalgebra::Vector6;
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

/// Nelder–Mead simplex of seven poses: min Σ rᵀ S⁻¹ r over the pixels of both images.
///
/// The cost is that of `stereo-reprojection`. The simplex is restarted about its own answer until the answer no longer
/// moves: an independent check that no wrong derivative can mislead. Each simplex is scaled by the standard deviations
/// of the pose at its start, so that the cost is equally steep in all directions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct NelderMead {
    /// Maximum number of iterations of one simplex, 1 to 1000000.
    pub(crate) iterations: u64,
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
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
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        self.check_limits()
    }
}

/// Maximum number of simplices.
const MAX_ROUNDS: usize = 20;
/// Edges of the first simplex and of the smallest (standard deviations of the pose).
const EDGES: [f64; 2] = [5.0, 0.1];
/// Standard deviation of the seven costs at which a simplex ends: the first near the minimum, every later one at it.
const LEVEL: [f64; 2] = [1e-1, 1e-15];
/// The same relative to the cost; it is the limit of precision.
const DIGITS: f64 = 1e-15;
/// Movement (standard deviations) below which two simplices, one on each side, end the search.
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
            let method = method.expect("tolerances are not negative");
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
