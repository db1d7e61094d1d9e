//! General-purpose optimisers as solvers: the start, the test of the minimum and its covariance.

use seafix_component::in_range;
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use crate::{
    observations::Observations,
    solve::{
        closed_form::fit,
        degeneracy::{Degenerate, check, converged, fraction},
        likelihood::{
            pixel_cost::{Best, PixelCost},
            pixel_terms::{TermTarget, pixels_and_rig},
            profile::pixel_covariance,
        },
        solver::Solver,
    },
};

/// A general-purpose optimiser that minimises a [`PixelCost`]; every implementor is a [`Solver`].
pub(crate) trait Optimiser: Send + Sync + std::fmt::Debug {
    /// The maximum number of iterations, and the minimum ratio of second to first extent of the points.
    fn limits(&self) -> (u64, f64);

    /// The pose of lowest cost from `start`, and the number of iterations.
    fn lower(
        &self,
        data: &Observations<'_>,
        rig: &StereoRig,
        start: &Transform<Object, Camera>,
    ) -> Result<(Transform<Object, Camera>, u64), Degenerate>;

    /// Checks the range of the limits.
    fn check_limits(&self) -> Result<(), String> {
        let (iterations, min_ratio) = self.limits();
        in_range((1..=1_000_000).contains(&iterations), "iterations", iterations, "1 to 1000000")?;
        fraction("min-ratio", min_ratio)
    }
}

impl<T: Optimiser> Solver for T {
    fn needs_pixels(&self) -> bool {
        true
    }

    fn to_rounding(&self) -> bool {
        false
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.limits().1)?;
        let rig = pixels_and_rig(data)?;
        let (pose, iterations) = self.lower(data, rig, &fit(&data.points))?;
        // Independent of the library's termination status: the gradient vanishes at a minimum.
        let off = PixelCost::of(data, rig, pose, &Best::default())?.distance();
        converged(iterations, off).map(|()| pose)
    }

    /// The covariance of the likelihood that the optimiser maximises.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        pixel_covariance(&data.points, pixels_and_rig(data)?, TermTarget::Pixels, at)
    }
}
