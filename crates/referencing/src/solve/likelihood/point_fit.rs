//! The maximum-likelihood pose of 3D points, with its terms.

use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};

use crate::{
    observations::Observations,
    solve::{
        closed_form::fit,
        degeneracy::Degenerate,
        likelihood::{
            descent::{Terms, linearize, minimize},
            initial_poses::maximum_likelihood,
            pixel_terms::{PixelTerms, TermTarget},
            point_terms::Measured,
        },
    },
};

/// Applies `work` to the answer and to the terms at it.
///
/// With a rig, the terms are those of the triangulated points' pixels, with up to `starts` initial poses.
pub(crate) fn solved<R>(
    data: &Observations<'_>,
    rig: Option<&StereoRig>,
    starts: usize,
    work: impl FnOnce(&Transform<Object, Camera>, Terms<'_>) -> Result<R, Degenerate>,
) -> Result<R, Degenerate> {
    let Some(rig) = rig else {
        let (start, measured) = (fit(&data.points), Measured::of(&data.points));
        let term = |k: usize, at: &_| Some(measured.term(k, at));
        return work(&minimize(&data.points, &start, &term)?, &term);
    };
    let mut pixel_terms = PixelTerms::new(rig);
    pixel_terms.see(&data.points, TermTarget::Triangulated)?;
    work(&maximum_likelihood(data, rig, starts, &pixel_terms)?, &|k, place| pixel_terms.live(k, place))
}

/// The inverse of the points' information at a pose.
pub(crate) fn covariance(
    data: &Observations<'_>,
    at: &Transform<Object, Camera>,
    terms: Terms<'_>,
) -> Result<Covariance6<Object, Camera>, Degenerate> {
    linearize(&data.points, at, &terms)?.covariance().map(Covariance6::new)
}
