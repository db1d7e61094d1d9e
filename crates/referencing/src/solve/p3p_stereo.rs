//! P3P with two cameras: the minimal solver of pixels.

use seafix_component::Component;
use seafix_geometry::{Camera, Covariance6, Object, StereoRig, Transform};
use serde::{Deserialize, Serialize};

use super::{
    Degenerate, Rival, Solver,
    descent::{NEAR, descend, linearize, settle},
    kabsch,
    profile::widened,
    roots::{Roots, squares, widest},
    sightings::{Sightings, Target},
    spread::{check, share},
    starts,
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

/// The roots of both cameras and the triangulated places.
const MOST_STARTS: usize = 9;

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
        let found = starts.map(|start| {
            let pose = refined(&three, &start, &sightings)?;
            Ok((squares(data, rig, &pose)?, pose))
        });
        // Where none leads anywhere, the first says why.
        let least = found.reduce(|best, other| match (&best, &other) {
            (Ok((least, _)), Ok((cost, _))) if cost < least => other,
            (Err(_), Ok(_)) => other,
            _ => best,
        });
        least.expect("the fit of the three is a start").map(|(_, pose)| pose)
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
        let live = |k: usize, place: &_| sightings.live(k, place);
        let first = linearize(&three, at, &live)?.covariance()?;
        Ok(Covariance6::new(widened(&three, at, first, &live)))
    }

    /// Those of the three that the pixels of all points leave as likely.
    fn rivals(&self, data: &Observations<'_>, at: &Transform<Object, Camera>, most: f64) -> Vec<Rival> {
        let Ok(rig) = pixels_and_rig(data) else { return Vec::new() };
        let three = Observations { points: widest(data).map(|i| data.points[i]).to_vec(), rig: data.rig };
        let (mut few, mut all) = (Sightings::new(rig), Sightings::new(rig));
        if few.see(&three.points, Target::Pixels).and_then(|()| all.see(&data.points, Target::Pixels)).is_err() {
            return Vec::new();
        }
        let others = starts::rivals(&three, rig, MOST_STARTS, &few, at, most);
        let chi2 = |pose: &_| linearize(&data.points, pose, &|k, place: &_| all.live(k, place)).map(|all| all.cost);
        let Ok(own) = chi2(at) else { return Vec::new() };
        let told = |rival: Rival| Some(Rival { worse: chi2(&rival.pose).ok()? - own, ..rival });
        others.into_iter().filter_map(told).filter(|rival| rival.worse <= most).collect()
    }
}

/// The least cost of the three near a start.
fn refined(
    three: &Observations<'_>,
    start: &Transform<Object, Camera>,
    sightings: &Sightings<'_>,
) -> Result<Transform<Object, Camera>, Degenerate> {
    let live = |k: usize, at: &_| sightings.live(k, at);
    let (near, here) = descend(&three.points, start, NEAR, &|k, at: &_| sightings.frozen(k, at))?;
    let here = if sightings.weights_move { linearize(&three.points, &near, &live)? } else { here };
    Ok(settle(&three.points, near, here, &live)?.0)
}
