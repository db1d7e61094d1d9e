//! Matching without descriptors by pyramidal Lucas–Kanade tracking along the epipolar curve.

use nalgebra::Vector2;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Pixel, StereoPixels, StereoRig};
use serde::{Deserialize, Serialize};

use super::{
    curve::epipolar_curve,
    matcher::{Match, Matcher, View},
    sought::Sought,
};
use crate::{
    align::Aligner,
    image::Image,
    track::{Pyramid, Tracker},
    workspace::Workspace,
};

/// Pyramidal Lucas–Kanade tracking of left key points along their epipolar curves.
///
/// The window around a key point is compared by zero-normalised cross-correlation at every pixel of its epipolar curve
/// between the depths, on a coarse pyramid level (1/8 of the size, finer near the border). The tracker follows the best
/// positions to full resolution and back. The best correlation is a match if it lies on the epipolar curve.
///
/// Right key points take no part. The distance of a pair is 1 minus the correlation. The better of two pairs within a
/// pixel of each other is kept. Limit: there is no ratio test, so a pair on a repeated pattern may be a period off.
///
/// Source: Lucas and Kanade, *An iterative image registration technique with an application to stereo vision*, 1981;
/// Bouguet, *Pyramidal implementation of the Lucas Kanade feature tracker*, 2000.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct LucasKanade {
    /// Maximum distance from the epipolar curve (px, Sampson distance).
    pub epipolar_px: f64,
    /// Minimum depth in the left camera (m).
    pub min_depth: f64,
    /// Maximum depth in the left camera (m).
    pub max_depth: f64,
    /// Number of positions on the epipolar curve that are tracked.
    pub places: usize,
    /// Settings of the tracker.
    pub tracker: Tracker,
}

impl Default for LucasKanade {
    fn default() -> Self {
        Self { epipolar_px: 1.0, min_depth: 0.1, max_depth: 50.0, places: 3, tracker: Tracker::default() }
    }
}

impl Component for LucasKanade {
    const NAME: &'static str = "lucas-kanade";
    const SUMMARY: &'static str =
        "pyramidal Lucas–Kanade tracking along the right image's epipolar curves, forward and backward";
    const SOURCE: &'static str = "Lucas and Kanade, An iterative image registration technique with an application to \
                                  stereo vision, 1981; Bouguet, Pyramidal implementation of the Lucas Kanade feature \
                                  tracker, 2000";

    fn check(&self) -> Result<(), String> {
        let Self { epipolar_px, min_depth, max_depth, places, ref tracker } = *self;
        let band = epipolar_px > 0.0 && epipolar_px <= 1000.0;
        in_range(band, "epipolar-px", epipolar_px, "more than 0, at most 1000 (px)")?;
        in_range(min_depth > 0.0 && min_depth.is_finite(), "min-depth", min_depth, "a positive depth (m)")?;
        let beyond = format!("a depth beyond min-depth = {min_depth} (m)");
        in_range(max_depth > min_depth && max_depth.is_finite(), "max-depth", max_depth, &beyond)?;
        in_range((1..=100).contains(&places), "places", places, "a number from 1 to 100")?;
        tracker.check().map_err(|message| format!("tracker.{message}"))
    }
}

/// The coarsest level of the search along the epipolar curve.
const SEARCHED: usize = 3;
/// The maximum number of positions on a curve.
const MAX: f64 = 512.0;
/// The deficit in correlation against the best from which on a position is not tracked.
const MUCH_WORSE: f64 = 0.3;

/// The memory that is kept between frames.
#[derive(Debug, Default)]
struct Memory {
    pyramids: [Pyramid; 2],
    sought: Sought<Seeker>,
}

/// The memory for one piece of the work.
#[derive(Debug, Default)]
struct Seeker {
    aligner: Aligner,
    curve: Vec<Vector2<f64>>,
    correlations: Vec<f64>,
    best: Vec<(f64, Vector2<f64>)>,
}

impl Matcher for LucasKanade {
    fn compares_descriptors(&self) -> bool {
        false
    }

    fn match_into(
        &self,
        left: &View<'_>,
        right: &View<'_>,
        rig: &StereoRig,
        work: &mut Workspace,
        found: &mut Vec<Match>,
    ) {
        let threads = work.threads();
        let Memory { pyramids, sought } = work.get();
        let [from, to] = pyramids;
        threads.join(|| from.build(left.image, self.tracker.levels), || to.build(right.image, self.tracker.levels));
        let levels = [from.levels(), to.levels()];
        sought.each(threads, left.keypoints, found, |place, seeker| {
            let (right, correlation) = self.seek(levels, place, rig, seeker)?;
            Some((right, (1.0 - correlation) as f32))
        });
    }
}

impl LucasKanade {
    /// The position of `place` in the right image, and the correlation there.
    ///
    /// A window near the border fits on finer levels only, and a pair that a coarse level does not resolve may appear
    /// on a finer one; so levels are tried from coarse to fine.
    fn seek(&self, levels: [&[Image]; 2], place: &Pixel, rig: &StereoRig, seeker: &mut Seeker) -> Option<(Pixel, f64)> {
        let coarsest = SEARCHED.min(levels[0].len().saturating_sub(1));
        (0..=coarsest).rev().find_map(|level| self.seek_from(level, levels, place, rig, seeker))
    }

    /// The position and the correlation of a search that begins on one level.
    fn seek_from(
        &self,
        level: usize,
        levels: [&[Image]; 2],
        place: &Pixel,
        rig: &StereoRig,
        seeker: &mut Seeker,
    ) -> Option<(Pixel, f64)> {
        let Seeker { aligner, curve, correlations, best } = seeker;
        let levels = [levels[0].get(..=level)?, levels[1].get(..=level)?];
        let scale = (1_u32 << level) as f64;
        epipolar_curve(rig, place, [self.min_depth, self.max_depth], scale, MAX, curve);
        curve.iter_mut().for_each(|place| *place /= scale);
        let at = Vector2::new(place.u, place.v) / scale;
        aligner.survey(&levels[0][level], &levels[1][level], &at, curve, &self.tracker.rules(), correlations);
        best.clear();
        for (i, &correlation) in correlations.iter().enumerate().filter(|(_, c)| **c > 0.0) {
            let beside = |k: usize| correlations.get(k).copied().unwrap_or(-1.0);
            if correlation >= beside(i.wrapping_sub(1)) && correlation > beside(i + 1) {
                best.push((correlation, curve[i] * scale));
            }
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0));
        let min = best.first()?.0 - MUCH_WORSE;
        let likely = best.iter().take(self.places).filter(|(correlation, _)| *correlation >= min);
        let tracks = likely.filter_map(|(_, start)| {
            let start = Pixel { u: start.x, v: start.y };
            let track = self.tracker.there(levels, place, &start, aligner)?;
            let off = rig.epipolar_distance(&StereoPixels { left: *place, right: track.at })?;
            (off <= self.epipolar_px).then_some((start, track))
        });
        let (start, track) = tracks.max_by(|a, b| a.1.correlation.total_cmp(&b.1.correlation))?;
        let returns = self.tracker.returns(levels, [place, &start], &track, aligner);
        returns.then_some((track.at, track.correlation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{describe::Descriptors, detect::Keypoint, track::stones};
    use nalgebra::{UnitQuaternion, Vector3};
    use seafix_geometry::{Pinhole, Transform};

    /// A rig with f = 500 px and the right camera displaced by `step` (m).
    fn rig(step: Vector3<f64>) -> StereoRig {
        let camera = Pinhole::new([240, 180], [500.0; 2], [119.5, 89.5], &[]).unwrap();
        StereoRig::new(camera, camera, Transform::new(UnitQuaternion::identity(), -step)).unwrap()
    }

    fn matches(rig: &StereoRig, shift: [f64; 2]) -> (Vec<Keypoint>, Vec<Match>) {
        let at = |i: usize| Pixel { u: 75.3 + 15.0 * (i % 10) as f64, v: 65.6 + 15.0 * (i / 10) as f64 };
        let keypoints: Vec<_> = (0..70).map(|i| Keypoint { at: at(i), response: 1.0, scale: 1.0 }).collect();
        let (left, right, none) = (stones(240, [0.0; 2]), stones(240, shift), Descriptors::default());
        let view = |image, keypoints| View { image, keypoints, descriptors: &none };
        let found = LucasKanade::default().matches(&view(&left, &keypoints), &view(&right, &[]), rig);
        (keypoints, found)
    }

    #[test]
    fn disparities_near_and_far_are_found() {
        for (step, shift) in [
            (Vector3::new(0.25, 0.0, 0.0), [-11.4, 0.0]), // 11.0 m
            (Vector3::new(0.25, 0.0, 0.0), [-62.5, 0.0]), // 2.0 m
            (Vector3::new(0.0, 0.2, 0.0), [0.0, -50.2]),  // one above the other
        ] {
            let (keypoints, found) = matches(&rig(step), shift);
            let [u, v] = shift;
            let fits = |k: &Pixel| k.u + u > 15.0 && k.v + v > 15.0;
            let possible = keypoints.iter().filter(|k| fits(&k.at)).count();
            assert!(10 * found.len() >= 9 * possible, "{shift:?}: {} of {possible}", found.len());
            assert!(found.windows(2).all(|pair| pair[0].left < pair[1].left));
            for pair in &found {
                let place = keypoints[pair.left].at;
                let expected = Pixel { u: place.u + u, v: place.v + v };
                assert!(pair.right.distance(&expected) < 0.1, "{shift:?}: {place:?} {pair:?}");
            }
        }
    }

    #[test]
    fn what_lies_off_the_epipolar_line_is_no_pair() {
        let (keypoints, found) = matches(&rig(Vector3::new(0.25, 0.0, 0.0)), [-30.0, 4.0]);
        // A few windows correlate by chance.
        assert!(found.len() <= 3, "{found:?}");
        for pair in &found {
            let place = keypoints[pair.left].at;
            assert!(pair.right.distance(&Pixel { u: place.u - 30.0, v: place.v + 4.0 }) > 2.0, "{place:?} {pair:?}");
        }
    }
}
