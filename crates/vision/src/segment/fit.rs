//! The fit of a straight edge over its whole length.

use nalgebra::Vector2;
use seafix_component::{Settings, in_range};
use seafix_geometry::{NormalOffset, Pinhole, UncertainSegment};
use serde::{Deserialize, Serialize};

use super::{
    detector::Segment,
    half_points::half_points,
    line::{Line, fit_line},
    profile::{Level, blur_of},
    trace::{Crossing, Trace},
};
use crate::image::Image;

/// The settings of the fit of a segment.
///
/// Each column of pixels across the edge (each row of a steep edge) gives an offset by a blurred step; a robust
/// straight line is fitted to the offsets in undistorted directions, and the edge is followed beyond its detected ends
/// while its steps continue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SegmentFit {
    /// Half-width of the columns across the edge as a multiple of its blur's standard deviation; 1 to 10.
    ///
    /// A narrow window leaves out other edges and shadows close by, a wide one averages more noise.
    pub window: f64,
    /// Minimum length of a fitted segment (px), at least 8.
    pub min_length: f64,
    /// Maximum RMS residual of the offsets of columns (px).
    pub max_residual: f64,
    /// Standard deviation of the error of an uneven step, as a fraction of the offset's change in a wider window.
    pub uneven: f64,
    /// Standard deviation (px) of the offset if the brighter side is overexposed: its clipped levels move the edge to
    /// the darker side by a part of the blur.
    pub clipped_px: f64,
    /// Standard deviation (px) of an error common to a segment's offsets, such as an uneven blur; it is added to each
    /// of both offsets.
    pub floor_px: f64,
}

impl Default for SegmentFit {
    fn default() -> Self {
        Self { window: 2.4, min_length: 16.0, max_residual: 1.0, uneven: 1.0, clipped_px: 0.2, floor_px: 0.01 }
    }
}

/// A segment fitted to the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedSegment {
    /// The undistorted directions (X/Z, Y/Z) of the ends; the brighter side lies along (−d_y, d_x) of their difference.
    pub ends: [Vector2<f64>; 2],
    /// The two independent offsets of the line; their normals point to the brighter side.
    pub offsets: UncertainSegment,
    /// The length in the image (px).
    pub length: f64,
    /// The median levels of the darker and the brighter side.
    pub levels: [f64; 2],
    /// The RMS residual of the offsets of columns (px).
    pub residual: f64,
    /// The blur of the edge: its standard deviation (px).
    pub blur: f64,
}

/// The working memory of fits.
#[derive(Debug, Default)]
pub struct FitScratch {
    crossings: Vec<Crossing>,
    levels: Vec<Level>,
    contrasts: Vec<f64>,
    offsets: Vec<Option<f64>>,
}

/// Passes of the fit; each moves the line and follows the edge by [`FOLLOWED`] px at either end.
const PASSES: usize = 6;
/// The length (px) by which a pass follows the edge.
const FOLLOWED: f64 = 12.0;
/// The smallest half-width of the columns (px): four pixels determine level, contrast and offset.
const MIN_REACH: f64 = 1.75;
/// The blur (px) until it is estimated.
const BLUR: f64 = 0.9;
/// Columns next to an end that are left out of the fit, since another edge begins there.
const TRIMMED: usize = 2;

impl SegmentFit {
    /// Checks the settings' ranges.
    ///
    /// # Errors
    /// The name, value and valid range of a wrong setting.
    pub fn check(&self) -> Result<(), String> {
        in_range((1.0..=10.0).contains(&self.window), "window", self.window, "1 to 10")?;
        in_range((8.0..=1e4).contains(&self.min_length), "min-length", self.min_length, "8 to 10000")?;
        in_range(self.max_residual > 0.0, "max-residual", self.max_residual, "above 0")?;
        in_range((0.0..=10.0).contains(&self.uneven), "uneven", self.uneven, "0 to 10")?;
        in_range((0.0..=10.0).contains(&self.clipped_px), "clipped-px", self.clipped_px, "0 to 10")?;
        in_range((0.0..=10.0).contains(&self.floor_px), "floor-px", self.floor_px, "0 to 10")
    }

    /// The fit of a detected segment; `None` if the edge is too short, too rough or leaves the image.
    pub fn fit(
        &self,
        image: &Image,
        camera: &Pinhole,
        segment: &Segment,
        scratch: &mut FitScratch,
    ) -> Option<FittedSegment> {
        let mut trace = Trace::new(image, camera, segment.ends);
        let mut blur = BLUR;
        for pass in 0..PASSES {
            let extra = if pass == 0 { 0.0 } else { FOLLOWED };
            let FitScratch { crossings, levels, contrasts, offsets } = scratch;
            levels.clear();
            // The blur is estimated once, from a wider window.
            let window = if pass == 1 { WIDER * self.reach(blur) } else { self.reach(blur) };
            trace.crossings(blur, window, extra, crossings, |column, t, level| {
                if pass == 1 {
                    levels.push(Level { column, t, level });
                }
            })?;
            measure(crossings, window, contrasts, offsets)?;
            // The core is what is known to be the edge already; beyond it the edge must prove to go on.
            let core = core(crossings);
            let line = fit_line(crossings, offsets, core.clone())?;
            let found = followed(crossings, offsets, &line, core)?;
            if pass == 1 {
                blur = blur_of(levels, crossings, contrasts, found.clone(), blur);
            }
            let [from, to] = [found.start, found.end - 1].map(|i| crossings[i].along);
            let moved = trace.ends;
            let step = moved[1] - moved[0];
            let across = trace.across();
            trace.ends = [from, to].map(|along| moved[0] + step * along + across * line.at(along));
            let shift = line.largest(from, to) * crossings[found.start].gain;
            let grown = found.len() as f64 - (core_length(crossings) as f64);
            if pass >= 2 && shift < SETTLED && grown < 3.0 {
                break;
            }
        }
        self.finish(&trace, blur, scratch)
    }

    /// The half-width of the columns (px).
    fn reach(&self, blur: f64) -> f64 {
        (self.window * blur).max(MIN_REACH)
    }

    /// The line through the columns of a settled trace, and their median contrast.
    fn settled(&self, trace: &Trace<'_>, blur: f64, window: f64, scratch: &mut FitScratch) -> Option<(Line, f64)> {
        let FitScratch { crossings, contrasts, offsets, .. } = scratch;
        trace.crossings(blur, window, 0.0, crossings, |_, _, _| ())?;
        let typical = measure(crossings, window, contrasts, offsets)?;
        let trimmed = TRIMMED..crossings.len().checked_sub(TRIMMED)?;
        Some((fit_line(crossings, offsets, trimmed)?, typical))
    }

    /// The fitted segment on the settled line.
    fn finish(&self, trace: &Trace<'_>, blur: f64, scratch: &mut FitScratch) -> Option<FittedSegment> {
        // Levels beyond the window show whether the step is even; an uneven one moves with the window.
        let wide = self.settled(trace, blur, WIDER * self.reach(blur), scratch)?.0;
        let (line, typical) = self.settled(trace, blur, self.reach(blur), scratch)?;
        let uneven = self.uneven * (line.at(0.5) - wide.at(0.5)) * scratch.crossings[scratch.crossings.len() / 2].gain;
        let crossings = &scratch.crossings;
        let length = trace.length()?;
        if length < self.min_length
            || line.residual > self.max_residual
            || line.used < MIN_USED * crossings.len() as f64
        {
            return None;
        }
        let step = trace.ends[1] - trace.ends[0];
        let across = trace.across();
        let ends = [0.0, 1.0].map(|along| trace.ends[0] + step * along + across * line.at(along));
        let settled = trace.moved(ends);
        let samples = line.samples.iter().map(|sample| (sample.along, sample.gain * sample.gain));
        let half = half_points(samples, line.variance)?;
        let mut dark: Vec<f64> = crossings.iter().filter_map(|c| Some(c.fitted?.level)).collect();
        let level = super::line::median(&mut dark)?;
        let clipped = if level + typical > WHITE { self.clipped_px } else { 0.0 };
        let offset = |along: f64| {
            let place = settled.place(along)?;
            let common = self.floor_px * self.floor_px + uneven * uneven + clipped * clipped;
            let own = half.variance * place.gain * place.gain;
            Some(NormalOffset {
                at: place.at,
                normal: place.normal,
                sigma: (own + common).sqrt(),
                texture: (own * line.texture).sqrt(),
                common: common.sqrt(),
            })
        };
        let offsets = [offset(half.places[0])?, offset(half.places[1])?];
        Some(FittedSegment { ends, offsets, length, levels: [level, level + typical], residual: line.residual, blur })
    }
}

/// A level above it is overexposed; 255 is white.
const WHITE: f64 = 250.0;
/// The factor by which the window is widened to test whether the step is even.
const WIDER: f64 = 1.75;
/// A column counts if its contrast, averaged over its neighbours, is above this fraction of the segment's median.
const MIN_CONTRAST: f64 = 0.3;
/// The minimum fraction of the columns that the line uses.
const MIN_USED: f64 = 0.5;
/// The line has settled when a pass moves it by less (px).
const SETTLED: f64 = 0.005;

/// Replaces `offsets` by the offset (px) of the edge at each column; `None` where it has no step.
///
/// The result is the median contrast; `None` without any step.
fn measure(
    crossings: &[Crossing],
    window: f64,
    contrasts: &mut Vec<f64>,
    offsets: &mut Vec<Option<f64>>,
) -> Option<f64> {
    let typical = smooth(crossings, contrasts)?;
    offsets.clear();
    offsets.extend(crossings.iter().zip(contrasts.iter()).map(|(crossing, &contrast)| {
        let fitted = crossing.fitted.filter(|_| contrast > MIN_CONTRAST * typical)?;
        Some((fitted.moment / contrast).clamp(-window, window))
    }));
    Some(typical)
}

/// The columns between the ends of the trace.
fn core(crossings: &[Crossing]) -> std::ops::Range<usize> {
    let inside = |crossing: &Crossing| (0.0..=1.0).contains(&crossing.along);
    let start = crossings.iter().position(inside).unwrap_or(0);
    let end = crossings.iter().rposition(inside).map_or(start, |last| last + 1);
    start..end
}

fn core_length(crossings: &[Crossing]) -> usize {
    core(crossings).len()
}

/// Replaces `contrasts` by the contrast at each column, averaged over three neighbours at either side.
///
/// The median of the positive ones between the ends is the result; `None` without any.
fn smooth(crossings: &[Crossing], contrasts: &mut Vec<f64>) -> Option<f64> {
    const REACH: usize = 3;
    contrasts.clear();
    contrasts.extend((0..crossings.len()).map(|i| {
        let near = &crossings[i.saturating_sub(REACH)..(i + REACH + 1).min(crossings.len())];
        let known = near.iter().filter_map(|crossing| Some(crossing.fitted?.contrast));
        let (sum, count) = known.fold((0.0, 0.0), |(sum, count), contrast| (sum + contrast, count + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    }));
    let mut inner: Vec<f64> = contrasts[core(crossings)].iter().copied().filter(|&contrast| contrast > 0.0).collect();
    super::line::median(&mut inner)
}

/// The columns over which the edge goes on from its core, on either side.
///
/// It ends where more than three successive columns lack contrast or lie off the line.
fn followed(
    crossings: &[Crossing],
    offsets: &[Option<f64>],
    line: &Line,
    core: std::ops::Range<usize>,
) -> Option<std::ops::Range<usize>> {
    const GAP: usize = 3;
    let limit = (3.0 * line.residual).clamp(0.3, 1.0);
    let good = |i: usize| {
        let crossing = &crossings[i];
        offsets[i].is_some_and(|offset| (offset - line.at(crossing.along) * crossing.gain).abs() < limit)
    };
    let middle = core.start + core.len() / 2;
    let walk = |places: &mut dyn Iterator<Item = usize>| {
        let (mut last, mut gap) = (None, 0);
        for i in places {
            if good(i) {
                (last, gap) = (Some(i), 0);
            } else {
                gap += 1;
                // Inside the core longer gaps are bridged: the detector vouches for it.
                if gap > if core.contains(&i) { 3 * GAP } else { GAP } {
                    break;
                }
            }
        }
        last
    };
    let start = walk(&mut (0..=middle).rev())?;
    let end = walk(&mut (middle..crossings.len()))?;
    (end > start + 4).then_some(start..end + 1)
}
