//! Poses judged by the images: the feature points that a pose predicts, compared with matches.
//!
//! A right pose predicts points where the cameras have measured points. Any other pose meets matches by chance, as often
//! as its neighbours do. Counts of chance are Poisson's; five standard deviations above it are not chance.

use std::collections::BTreeMap;

use seafix_geometry::{Camera, StereoPixels, Transform, UncertainPixels, World};

use super::poses::View;

type Pose = Transform<World, Camera>;

/// The matches of one pair: its index, and each match with its depth (m).
#[derive(Debug, Clone)]
pub(crate) struct MeasuredPair {
    pair: usize,
    matches: Vec<(StereoPixels, f64)>,
}

/// The distance (px) of a match that may be a feature point's: a few pixels, for corners of lenses and surveys.
const NEAR: f64 = 3.0;
/// The relative difference of its depth.
const DEPTH: f64 = 0.1;
/// The minimum number of points that the images confirm.
const FEW: f64 = 8.0;
/// The number of standard deviations above chance.
const SURE: f64 = 5.0;

impl MeasuredPair {
    /// The matches `seen` of the pair with index `pair`.
    pub(crate) fn new(view: &View<'_>, pair: usize, seen: &[StereoPixels]) -> Self {
        let depth = |seen: &StereoPixels| {
            let measured = view.rig.triangulate(&UncertainPixels::independent(*seen, 1.0)).ok()?;
            (measured.point.coords.z > 0.0).then_some((*seen, measured.point.coords.z))
        };
        Self { pair, matches: seen.iter().filter_map(depth).collect() }
    }

    /// The same matches, measured with the rig of another view.
    pub(super) fn again(&self, view: &View<'_>) -> Self {
        let seen: Vec<StereoPixels> = self.matches.iter().map(|(seen, _)| *seen).collect();
        Self::new(view, self.pair, &seen)
    }
}

/// The number of feature points that the images confirm at the poses of the measured pairs, after `undo`.
///
/// A prior may be wrong by `reach` px: the common displacement that most points agree with is undone in each pair.
pub(crate) fn confirmed(
    view: &View<'_>,
    measured: &[MeasuredPair],
    poses: &[Option<Pose>],
    undo: &dyn Fn(&Pose) -> Pose,
    reach: f64,
) -> f64 {
    let of = |measured: &MeasuredPair| {
        let pose = poses.get(measured.pair).copied().flatten()?;
        Some(confirmed_in(view, measured, &undo(&pose), reach))
    };
    measured.iter().filter_map(of).sum::<usize>() as f64
}

/// The number of points of a pair with a match at one displacement of at most `reach` px.
fn confirmed_in(view: &View<'_>, measured: &MeasuredPair, pose: &Pose, reach: f64) -> usize {
    let camera_from_world = pose.inverse();
    // Displacements in cells of twice the distance, with the number of points in each; the middle one is about zero.
    let cell = |off: f64| (off / (2.0 * NEAR)).round() as i64;
    let mut cells: BTreeMap<[i64; 2], (usize, usize)> = BTreeMap::new();
    let points = view.objects.iter().flatten().map(|point| camera_from_world * *point);
    for (index, point) in points.enumerate() {
        if point.coords.z <= 0.0 || view.rig.sees(&point, 0.0).is_none() {
            continue;
        }
        let Some(pixel) = view.rig.left().project(&point) else { continue };
        for (seen, depth) in &measured.matches {
            let off = [seen.left.u - pixel.u, seen.left.v - pixel.v];
            if off[0].hypot(off[1]) <= reach + NEAR && (depth / point.coords.z).ln().abs() <= DEPTH {
                // A point counts once in a cell; points come in order.
                let (count, last) = cells.entry(off.map(cell)).or_insert((0, usize::MAX));
                if *last != index {
                    (*count, *last) = (*count + 1, index);
                }
            }
        }
    }
    cells.values().map(|(count, _)| *count).max().unwrap_or(0)
}

/// The median depth (m) of the matches; `None` without matches.
pub(crate) fn median_depth(measured: &[MeasuredPair]) -> Option<f64> {
    let mut depths: Vec<f64> = measured.iter().flat_map(|pair| &pair.matches).map(|(_, depth)| *depth).collect();
    depths.sort_by(f64::total_cmp);
    depths.get(depths.len() / 2).copied()
}

/// Whether images that confirm `other` points speak against a reading of which they confirm `given`.
pub(crate) fn is_clearly_more(other: f64, given: f64) -> bool {
    other >= FEW && other - given > SURE * (given + 1.0).sqrt()
}
