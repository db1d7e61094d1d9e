//! P3P for two cameras: the left one gives the poses, all pixels choose.

use seafix_component::{Component, in_range};
use seafix_geometry::{Camera, Covariance6, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver, numerical,
    roots::{roots_of, widest},
    spread::check,
    stereo_reprojection::pixels_and_rig,
};
use crate::Observations;

/// The minimal solver: three widely spread points, as the left camera sees them, allow up to four poses; the one
/// that explains the pixels of all points in both images best is the answer. No least squares, so it says less
/// than it could; it needs no depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct P3pStereo {
    /// Second extent of the points over the first below which they count as a line.
    pub(crate) least_ratio: f64,
}

impl Default for P3pStereo {
    fn default() -> Self {
        Self { least_ratio: 1e-3 }
    }
}

impl Component for P3pStereo {
    const NAME: &'static str = "p3p-stereo";
    const SUMMARY: &'static str = "three points in the left image, the right image chooses among the roots";
    const SOURCE: &'static str = "Persson, Nordberg, Lambda Twist: an accurate fast robust P3P solver, 2018";

    fn check(&self) -> Result<(), String> {
        // Written so that a NaN is refused too.
        let share = self.least_ratio >= 0.0 && self.least_ratio < 1.0;
        in_range(share, "least-ratio", self.least_ratio, "a share from 0 to below 1")
    }
}

impl Solver for P3pStereo {
    fn needs_pixels(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.least_ratio)?;
        let rig = pixels_and_rig(data)?;
        roots_of(data, rig, widest(data)).as_slice().first().copied().ok_or(Degenerate::NoRoot)
    }

    fn used(&self, data: &Observations<'_>) -> Vec<usize> {
        if self.solve(data).is_err() {
            return Vec::new();
        }
        let mut three = widest(data).to_vec();
        three.sort_unstable();
        three
    }

    /// The derivatives are those of the three points: another choice under a small step would be no derivative.
    fn covariance(
        &self,
        data: &Observations<'_>,
        at: &Transform<Object, Camera>,
    ) -> Result<Covariance6<Object, Camera>, Degenerate> {
        let rig = pixels_and_rig(data)?;
        let three = Observations { points: widest(data).map(|i| data.points[i]).to_vec(), rig: data.rig };
        let nearest = |moved: &Observations<'_>| {
            let roots = roots_of(moved, rig, [0, 1, 2]);
            let off = |root: &&Transform<Object, Camera>| at.error_to(root).norm();
            let near = roots.as_slice().iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            near.copied().ok_or(Degenerate::NoRoot)
        };
        numerical::covariance(nearest, &three, at)
    }
}
