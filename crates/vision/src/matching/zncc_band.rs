//! Matching by zero-normalised cross-correlation at every pixel of the epipolar band.

use nalgebra::Vector2;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Pixel, StereoPixels, StereoRig};
use serde::{Deserialize, Serialize};

use super::{
    correlate::{LANES, Template, WIDEST},
    curve::epipolar_curve,
    matcher::{Match, Matcher, View},
    sought::Sought,
};
use crate::{detect::vertex, image::Image, workspace::Workspace};

/// Area-based matching of left key points by ZNCC at every pixel of their epipolar band.
///
/// The window around a key point is compared by zero-normalised cross-correlation c with those around all pixels within
/// `epipolar_px` of its epipolar curve between the depths, for any rig. The best is a match under three conditions: it
/// is clearly better than any position further than half a window away; the search from there in the left image returns
/// to the start; and it passes the epipolar test at its subpixel position, the vertex of the quadratic through its nine
/// correlations. The distance of a pair is that of the windows as unit vectors, √(2 − 2c). The better of two pairs
/// within a pixel of each other is kept.
///
/// Right key points take no part, so the matcher finds more pairs where contrast is low and detections seldom repeat.
/// Limit: windows are not rotated; cameras with a relative roll of more than about 10° need a descriptor.
///
/// Source: Hannah, *Computer matching of areas in stereo images*, 1974; Fua, *A parallel stereo algorithm that produces
/// dense depth maps and preserves image features*, 1993 (left–right check).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ZnccBand {
    /// Side of the window (px); odd, 3 to 51.
    pub window: usize,
    /// Minimum correlation.
    pub min_correlation: f64,
    /// Maximum ratio of the distances to the best and the second best position; 1 disables the test.
    pub ratio: f64,
    /// Half-width of the epipolar band (px).
    pub epipolar_px: f64,
    /// Minimum depth in the left camera (m).
    pub min_depth: f64,
    /// Maximum depth in the left camera (m).
    pub max_depth: f64,
}

impl Default for ZnccBand {
    fn default() -> Self {
        Self { window: 11, min_correlation: 0.8, ratio: 0.85, epipolar_px: 1.0, min_depth: 0.1, max_depth: 50.0 }
    }
}

impl Component for ZnccBand {
    const NAME: &'static str = "zncc-band";
    const SUMMARY: &'static str =
        "area-based matching by ZNCC at every pixel of the epipolar band, with left-right check";
    const SOURCE: &'static str =
        "Fua, A parallel stereo algorithm that produces dense depth maps and preserves image features, 1993";

    fn check(&self) -> Result<(), String> {
        let Self { window, min_correlation, ratio, epipolar_px, min_depth, max_depth } = *self;
        let odd = window % 2 == 1 && (3..=WIDEST).contains(&window);
        in_range(odd, "window", window, "an odd number of pixels from 3 to 51")?;
        let correlated = (-1.0..=1.0).contains(&min_correlation);
        in_range(correlated, "min-correlation", min_correlation, "a number from -1 to 1")?;
        in_range(ratio > 0.0 && ratio <= 1.0, "ratio", ratio, "more than 0, at most 1")?;
        let band = epipolar_px > 0.0 && epipolar_px <= 100.0;
        in_range(band, "epipolar-px", epipolar_px, "more than 0, at most 100 (px)")?;
        in_range(min_depth > 0.0 && min_depth.is_finite(), "min-depth", min_depth, "a positive depth (m)")?;
        let beyond = format!("a depth beyond min-depth = {min_depth} (m)");
        in_range(max_depth > min_depth && max_depth.is_finite(), "max-depth", max_depth, &beyond)
    }
}

/// The maximum number of positions on a curve.
const MAX: f64 = 8192.0;
/// The tolerance of the left–right check (px along either axis).
const RETURN: usize = 1;

/// The memory for one piece of the work.
#[derive(Debug, Default)]
struct Seeker {
    template: Template,
    curve: Vec<Vector2<f64>>,
    /// The first and the last column of the band in each of its rows.
    rows: Vec<[usize; 2]>,
    seen: Vec<([usize; 2], f32)>,
}

/// The integer pixel of the best window.
struct Best {
    at: [usize; 2],
    correlation: f32,
    /// The largest correlation elsewhere.
    second: f32,
}

impl Matcher for ZnccBand {
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
        let (threads, rigs) = (work.threads(), [*rig, rig.exchanged()]);
        work.get::<Sought<Seeker>>().each(threads, left.keypoints, found, |place, seeker| {
            self.there_and_back([left.image, right.image], &rigs, place, seeker)
        });
    }
}

impl ZnccBand {
    /// The position of `place` in the right image, and the distance of the windows.
    fn there_and_back(
        &self,
        [left, right]: [&Image; 2],
        [rig, back]: &[StereoRig; 2],
        place: &Pixel,
        seeker: &mut Seeker,
    ) -> Option<(Pixel, f32)> {
        let begin = full(place)?;
        let depths = [self.min_depth, self.max_depth];
        let best = self.seek([left, right], rig, begin, depths, seeker)?;
        let (own, other) = (1.0 - best.correlation, 1.0 - best.second);
        let clear = self.ratio >= 1.0 || own < (self.ratio * self.ratio) as f32 * other;
        if f64::from(best.correlation) < self.min_correlation || !clear {
            return None;
        }
        let [x, y] = best.at;
        let mut around = |y: usize| seeker.template.compare(right, [x.checked_sub(1)?, y]).first_chunk::<3>().copied();
        let nine = [around(y.checked_sub(1)?)?, around(y)?, around(y + 1)?];
        let [dx, dy] = if nine.as_flattened().contains(&-1.0) { [0.0; 2] } else { vertex(nine) };
        let at =
            Pixel { u: x as f64 + dx + (place.u - begin[0] as f64), v: y as f64 + dy + (place.v - begin[1] as f64) };
        let off = rig.epipolar_distance(&StereoPixels { left: *place, right: at })?;
        // The other camera sees the point at a different depth.
        let depths = [0.5 * self.min_depth, 2.0 * self.max_depth];
        let again = self.seek([right, left], back, best.at, depths, seeker)?.at;
        let returned = again.iter().zip(begin).all(|(a, b)| a.abs_diff(b) <= RETURN);
        (off <= self.epipolar_px && returned).then(|| (at, (2.0 * own.max(0.0)).sqrt()))
    }

    /// The best position of the window around `begin` in the band of the other image.
    fn seek(
        &self,
        [from, to]: [&Image; 2],
        rig: &StereoRig,
        begin: [usize; 2],
        depths: [f64; 2],
        seeker: &mut Seeker,
    ) -> Option<Best> {
        let Seeker { template, curve, rows, seen } = seeker;
        let half = self.window / 2;
        template.take(from, begin, half)?;
        let [u, v] = begin.map(|x| x as f64);
        epipolar_curve(rig, &Pixel { u, v }, depths, 1.0, MAX, curve);
        let top = band(curve, self.epipolar_px, [to.width(), to.height()], rows)?;
        seen.clear();
        for (y, &[first, last]) in (top..).zip(&*rows) {
            for x in (first..=last).step_by(LANES) {
                let row = template.compare(to, [x, y]).into_iter().zip(x..=last);
                seen.extend(row.map(|(correlation, x)| ([x, y], correlation)));
            }
        }
        let &(at, correlation) = seen.iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
        let elsewhere = seen.iter().filter(|(other, _)| other.iter().zip(at).any(|(a, b)| a.abs_diff(b) > half));
        let second = elsewhere.map(|(_, correlation)| *correlation).fold(-1.0, f32::max);
        Some(Best { at, correlation, second })
    }
}

/// The integer pixel of a position; `None` if it is not finite.
fn full(place: &Pixel) -> Option<[usize; 2]> {
    let at = [place.u, place.v].map(libm::round);
    at.iter().all(|x| (0.0..1e9).contains(x)).then(|| at.map(|x| x as usize))
}

/// Replaces `rows` by the first and the last column of each row within `reach` of the curve; returns the first row.
///
/// The image has this width and height.
fn band(curve: &[Vector2<f64>], reach: f64, [width, height]: [usize; 2], rows: &mut Vec<[usize; 2]>) -> Option<usize> {
    // Half a pixel more, for positions between pixels.
    let reach = reach + 0.5;
    let range = |x: f64, n: usize| {
        let (first, last) = (libm::ceil(x - reach).max(0.0), libm::floor(x + reach).min(n as f64 - 1.0));
        (first <= last).then_some((first as usize, last as usize))
    };
    let (mut top, mut bottom) = (usize::MAX, 0);
    for (first, last) in curve.iter().filter(|at| range(at.x, width).is_some()).filter_map(|at| range(at.y, height)) {
        (top, bottom) = (top.min(first), bottom.max(last));
    }
    rows.clear();
    rows.resize((bottom + 1).checked_sub(top)?, [usize::MAX, 0]);
    for at in curve {
        let (Some((left, right)), Some((first, last))) = (range(at.x, width), range(at.y, height)) else { continue };
        for [begin, end] in &mut rows[first - top..=last - top] {
            (*begin, *end) = ((*begin).min(left), (*end).max(right));
        }
    }
    // A row that a coarse curve skips has no column.
    rows.iter_mut().filter(|row| row[0] > row[1]).for_each(|row| *row = [1, 0]);
    Some(top)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{describe::Descriptors, detect::Keypoint, track::stones};
    use nalgebra::{UnitQuaternion, Vector3};
    use seafix_geometry::{Pinhole, Transform};

    fn matches(step: Vector3<f64>, shift: [f64; 2]) -> (Vec<Keypoint>, Vec<Match>) {
        let camera = Pinhole::new([240, 180], [500.0; 2], [119.5, 89.5], &[]).unwrap();
        let rig = StereoRig::new(camera, camera, Transform::new(UnitQuaternion::identity(), -step)).unwrap();
        let at = |i: usize| Pixel { u: 75.3 + 15.0 * (i % 10) as f64, v: 65.6 + 15.0 * (i / 10) as f64 };
        let keypoints: Vec<_> = (0..70).map(|i| Keypoint { at: at(i), response: 1.0, scale: 1.0 }).collect();
        let (left, right, none) = (stones(240, [0.0; 2]), stones(240, shift), Descriptors::default());
        let view = |image, keypoints| View { image, keypoints, descriptors: &none };
        let found = ZnccBand::default().matches(&view(&left, &keypoints), &view(&right, &[]), &rig);
        (keypoints, found)
    }

    #[test]
    fn disparities_near_and_far_are_found_beside_and_below() {
        for (step, shift) in [
            (Vector3::new(0.25, 0.0, 0.0), [-11.4, 0.0]),
            (Vector3::new(0.25, 0.0, 0.0), [-62.5, 0.0]),
            (Vector3::new(0.0, 0.2, 0.0), [0.0, -50.2]),
        ] {
            let (keypoints, found) = matches(step, shift);
            let possible = keypoints.iter().filter(|k| k.at.u + shift[0] > 8.0 && k.at.v + shift[1] > 8.0).count();
            assert!(10 * found.len() >= 8 * possible, "{shift:?}: {} of {possible}", found.len());
            for pair in &found {
                let place = keypoints[pair.left].at;
                let expected = Pixel { u: place.u + shift[0], v: place.v + shift[1] };
                // The quadratic gives the position to half a pixel, the start of the refinement.
                assert!(pair.right.distance(&expected) < 0.5, "{shift:?}: {place:?} {pair:?}");
            }
        }
    }

    #[test]
    fn the_band_has_the_pixels_near_the_curve() {
        let curve: Vec<_> = (0..40).map(|i| Vector2::new(3.0 + f64::from(i), 5.0 + 0.5 * f64::from(i))).collect();
        let mut rows = Vec::new();
        let top = band(&curve, 1.0, [30, 20], &mut rows).unwrap();
        for (x, y) in (0..600).map(|i| (i % 30, i / 30)) {
            let off = |at: &Vector2<f64>| (at.x - x as f64).abs().max((at.y - y as f64).abs());
            let near = curve.iter().map(off).fold(f64::INFINITY, f64::min);
            let inside = y >= top && rows.get(y - top).is_some_and(|row| (row[0]..=row[1]).contains(&x));
            assert!((inside || near > 1.0) && (!inside || near <= 1.5), "{x} {y}: {near}");
        }
        assert_eq!(band(&[Vector2::new(-9.0, 4.0)], 1.0, [30, 20], &mut rows), None);
    }
}
