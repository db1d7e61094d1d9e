//! Stereo reprojection: maximum likelihood of the four pixel coordinates of every point.

use nalgebra::SMatrix;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        degeneracy::{Degenerate, check, fraction},
        likelihood::{
            descent::model_errors,
            initial_poses::{AlternativePose, STARTS, alternatives, maximum_likelihood},
            mixed::{self, Mixed},
            pixel_terms::{PixelTerms, TermTarget, pixels_and_rig},
            profile::pixel_covariance,
        },
        solver::Solver,
    },
};

/// The maximum-likelihood pose given the pixels of both images: min Σ rᵀ S⁻¹ r over SE(3).
///
/// r holds the four pixel residuals of a point and S = Σ_px + σ_model² J Jᵀ, with J = ∂pixels/∂p at the fitted point
/// (the model point's error marginalised). The solver reaches the Cramér–Rao bound. Its covariance (Σ Jᵀ S⁻¹ J)⁻¹ is
/// that bound at the answer; for a weak attitude it follows from the profile likelihood.
///
/// An edge adds its four offsets nᵀ(q − x), q the projection of the edge at the place x and normal n of a half of its
/// segment. Model places that several features name have one error, which is estimated with the pose.
///
/// Three or four points, or a small distant object, have several minima. If the answer from the unweighted fit of the
/// triangulated points is in doubt, the P3P poses of the left camera and the mirror image of the answer serve as
/// further starts, and the lowest cost is the answer. [`alternatives`](Solver::alternatives) returns the other minima
/// of similar cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct StereoReprojection {
    /// Maximum number of initial poses, 1 to 5, without the first answer's mirror image; 1 uses the unweighted fit
    /// alone.
    pub starts: usize,
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub min_ratio: f64,
}

impl Default for StereoReprojection {
    fn default() -> Self {
        Self { starts: STARTS, min_ratio: 1e-3 }
    }
}

impl Component for StereoReprojection {
    const NAME: &'static str = "stereo-reprojection";
    const SUMMARY: &'static str = "maximum likelihood on the pixels of both images, from several starts";
    const SOURCE: &'static str =
        "Hartley, Zisserman, Multiple View Geometry, 2003; Persson, Nordberg, Lambda Twist, 2018";
    const PROPERTIES: seafix_component::Properties = &[("features", "points and straight edges")];

    fn check(&self) -> Result<(), String> {
        in_range((1..=5).contains(&self.starts), "starts", self.starts, "1 to 5")?;
        fraction("min-ratio", self.min_ratio)
    }
}

impl Solver for StereoReprojection {
    fn needs_pixels(&self) -> bool {
        true
    }

    fn takes_edges(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        if !data.edges.is_empty() {
            return mixed::solve(data, Some(pixels_and_rig(data)?));
        }
        check(data, self.minimum(), self.min_ratio)?;
        let rig = pixels_and_rig(data)?;
        let mut pixel_terms = PixelTerms::new(rig);
        pixel_terms.see(&data.points, TermTarget::Pixels)?;
        maximum_likelihood(data, rig, self.starts, &pixel_terms)
    }

    fn solve_near(
        &self,
        data: &Observations<'_>,
        near: &Transform<Object, Camera>,
    ) -> Result<Transform<Object, Camera>, Degenerate> {
        match data.edges.is_empty() {
            true => self.solve(data),
            false => mixed::solve_near(data, Some(pixels_and_rig(data)?), near),
        }
    }

    fn alternatives(&self, data: &Observations<'_>, at: &Transform<Object, Camera>, max: f64) -> Vec<AlternativePose> {
        let Some(rig) = pixels_and_rig(data).ok().filter(|_| data.edges.is_empty()) else { return Vec::new() };
        let mut pixel_terms = PixelTerms::new(rig);
        match pixel_terms.see(&data.points, TermTarget::Pixels) {
            Ok(()) => alternatives(data, rig, self.starts, &pixel_terms, at, max),
            Err(_) => Vec::new(),
        }
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        if !data.edges.is_empty() {
            return mixed::covariance(data, Some(pixels_and_rig(data)?), at);
        }
        pixel_covariance(&data.points, pixels_and_rig(data)?, TermTarget::Pixels, at)
    }

    fn model_errors(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Vec<SMatrix<f64, 6, 3>>, Degenerate> {
        if !data.edges.is_empty() {
            return Mixed::of(data, Some(pixels_and_rig(data)?), data.rig)?.model_errors(at);
        }
        let mut all = PixelTerms::new(pixels_and_rig(data)?);
        all.see(&data.points, TermTarget::Pixels)?;
        model_errors(&data.points, at, &|k, place: &_| all.live(k, place))
    }
}
