//! P3P with two cameras: the minimal solver of pixels.

use seafix_component::Component;
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Solver,
    descent::{NEAR, descend, linearize, settle},
    kabsch,
    roots::{Roots, squares, widest},
    sightings::{Sightings, Target},
    spread::{check, share},
    stereo_reprojection::pixels_and_rig,
};
use crate::Observations;

/// The pose from three widely spread points and their twelve pixel coordinates.
///
/// Each camera alone allows three points up to four poses (P3P), and their triangulated places allow one. Near a double
/// root noise moves the roots of one camera far, or off the real numbers, so none of them is an answer: each is a start,
/// led to the least Σ rᵀ S⁻¹ r of the three in both images. Of the minima the one that explains the pixels of *all*
/// points best stands.
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
    const SUMMARY: &'static str = "three points in both images, from the roots of each camera: minimal";
    const SOURCE: &'static str =
        "Persson, Nordberg, Lambda Twist: an accurate fast robust perspective three point solver, 2018";

    fn check(&self) -> Result<(), String> {
        share("least-ratio", self.least_ratio)
    }
}

impl Solver for P3pStereo {
    fn needs_pixels(&self) -> bool {
        true
    }

    fn solve(&self, data: &Observations<'_>) -> Result<Transform<Object, Camera>, Degenerate> {
        check(data, self.minimum(), self.least_ratio)?;
        let rig = pixels_and_rig(data)?;
        let chosen = widest(data);
        let three = Observations { points: chosen.map(|i| data.points[i]).to_vec(), rig: data.rig };
        check(&three, self.minimum(), self.least_ratio)?;
        let mut sightings = Sightings::new(rig);
        sightings.see(&three.points, Target::Pixels)?;
        let mut roots = Roots::default();
        for right in [false, true] {
            roots.of_camera(data, rig, chosen, right);
        }
        let starts = roots.as_slice().iter().copied().chain([kabsch::fit(&three.points)]);
        let mut best: Option<(f64, Transform<Object, Camera>)> = None;
        for pose in starts.filter_map(|start| refined(&three, &start, &sightings)) {
            let Some(cost) = squares(data, rig, &pose) else { continue };
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, pose));
            }
        }
        best.map(|(_, pose)| pose).ok_or(Degenerate::NoRoot)
    }

    /// The three.
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
        let rig: &StereoRig = pixels_and_rig(data)?;
        let three = widest(data).map(|i| data.points[i]);
        let mut sightings = Sightings::new(rig);
        sightings.see(&three, Target::Pixels)?;
        linearize(&three, at, &|k, place: &_| sightings.live(k, place))
            .ok_or(Degenerate::Hidden)?
            .covariance()
            .map(Covariance6::new)
            .ok_or(Degenerate::Singular)
    }
}

/// The least cost of the three near a start.
fn refined(
    three: &Observations<'_>,
    start: &Transform<Object, Camera>,
    sightings: &Sightings<'_>,
) -> Option<Transform<Object, Camera>> {
    let live = |k: usize, at: &_| sightings.live(k, at);
    let (near, here) = descend(&three.points, start, NEAR, &|k, at: &_| sightings.frozen(k, at)).ok()?;
    let here = if sightings.weights_move { linearize(&three.points, &near, &live)? } else { here };
    Some(settle(&three.points, near, here, &live).ok()?.0)
}
