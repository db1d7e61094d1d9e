//! P3P with two cameras: the minimal solver of pixels.

use seafix_component::{Component, Settings};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use crate::{
    observations::Observations,
    solve::{
        closed_form::fit,
        degeneracy::{Degenerate, check, fraction, widest},
        likelihood::{
            descent::{NEAR, descend, linearize, settle},
            initial_poses::{self, AlternativePose},
            pixel_terms::{PixelTerms, TermTarget, pixels_and_rig},
            profile::pixel_covariance,
            roots::{Roots, squares},
        },
        solver::Solver,
    },
};

/// The pose from the twelve pixel coordinates of three widely spread points.
///
/// Each camera alone admits up to four poses of three points (P3P), and their triangulated positions admit one. Near a
/// double root noise moves the roots of one camera far, or off the real numbers. The roots therefore serve as starts:
/// each is refined to a minimum of Σ rᵀ S⁻¹ r over the three points in both images. The answer is the minimum that best
/// explains the pixels of *all* points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct P3pStereo {
    /// Minimum ratio of second to first extent of the points, 0 to below 1; below it they count as collinear.
    pub(crate) min_ratio: f64,
}

/// The roots of both cameras and the triangulated positions.
const MAX_STARTS: usize = 9;

impl Default for P3pStereo {
    fn default() -> Self {
        Self { min_ratio: 1e-3 }
    }
}

impl Component for P3pStereo {
    const NAME: &'static str = "p3p-stereo";
    const SUMMARY: &'static str = "three points in both images, from the roots of each camera: minimal";
    const SOURCE: &'static str =
        "Persson, Nordberg, Lambda Twist: an accurate fast robust perspective three point solver, 2018";
    const PROPERTIES: seafix_component::Properties = &[("features", "points alone")];

    fn check(&self) -> Result<(), String> {
        fraction("min-ratio", self.min_ratio)
    }
}

impl Solver for P3pStereo {
    fn needs_pixels(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.min_ratio)?;
        let rig = pixels_and_rig(data)?;
        let chosen = widest(data);
        let three = Observations { points: chosen.map(|i| data.points[i]).to_vec(), edges: Vec::new(), rig: data.rig };
        check(&three, self.minimum(), self.min_ratio)?;
        let mut pixel_terms = PixelTerms::new(rig);
        pixel_terms.see(&three.points, TermTarget::Pixels)?;
        let mut roots = Roots::default();
        for right in [false, true] {
            roots.of_camera(data, rig, chosen, right);
        }
        let starts = roots.as_slice().iter().copied().chain([fit(&three.points)]);
        let found = starts.map(|start| {
            let pose = refined(&three, &start, &pixel_terms)?;
            Ok((squares(data, rig, &pose)?, pose))
        });
        // If every start fails, the first states the reason.
        let min = found.reduce(|best, other| match (&best, &other) {
            (Ok((min, _)), Ok((cost, _))) if cost < min => other,
            (Err(_), Ok(_)) => other,
            _ => best,
        });
        min.expect("the fit of the three is a start").map(|(_, pose)| pose)
    }

    /// The three points.
    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        if self.solve(data).is_err() {
            return Vec::new();
        }
        let mut three = widest(data);
        three.sort_unstable();
        three.to_vec()
    }

    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let rig = pixels_and_rig(data)?;
        pixel_covariance(&widest(data).map(|i| data.points[i]), rig, TermTarget::Pixels, at)
    }

    /// The alternatives of the three points that the pixels of all points admit.
    fn alternatives(&self, data: &Observations<'_>, at: &Transform<Object, Camera>, max: f64) -> Vec<AlternativePose> {
        let Ok(rig) = pixels_and_rig(data) else { return Vec::new() };
        let three =
            Observations { points: widest(data).map(|i| data.points[i]).to_vec(), edges: Vec::new(), rig: data.rig };
        let (mut few, mut all) = (PixelTerms::new(rig), PixelTerms::new(rig));
        if few.see(&three.points, TermTarget::Pixels).and_then(|()| all.see(&data.points, TermTarget::Pixels)).is_err()
        {
            return Vec::new();
        }
        let others = initial_poses::alternatives(&three, rig, MAX_STARTS, &few, at, max);
        let chi2 = |pose: &_| linearize(&data.points, pose, &|k, place: &_| all.live(k, place)).map(|all| all.cost);
        let Ok(own) = chi2(at) else { return Vec::new() };
        let reported = |alternative: AlternativePose| {
            Some(AlternativePose { worse: chi2(&alternative.pose).ok()? - own, ..alternative })
        };
        others.into_iter().filter_map(reported).filter(|alternative| alternative.worse <= max).collect()
    }
}

/// The minimum of the cost of the three points near a start.
fn refined(
    three: &Observations<'_>,
    start: &Transform<Object, Camera>,
    pixel_terms: &PixelTerms<'_>,
) -> Result<Transform<Object, Camera>, Degenerate> {
    let live = |k: usize, at: &_| pixel_terms.live(k, at);
    let (near, here) = descend(&three.points, start, NEAR, &|k, at: &_| pixel_terms.frozen(k, at))?;
    let here = if pixel_terms.weights_move { linearize(&three.points, &near, &live)? } else { here };
    Ok(settle(&three.points, near, here, &live)?.0)
}
