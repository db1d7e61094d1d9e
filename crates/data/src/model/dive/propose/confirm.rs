//! Candidates located where the other pairs must show them, as marks are.
//!
//! Corners that each pair detects by itself seldom repeat: their number is limited, and a match in the right image may be
//! ambiguous. Where a corner is expected, the locator finds it in nearly every pair that shows it.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use rayon::prelude::*;
use seafix_geometry::{Camera, Pixel, Point, Transform, UncertainPixels, World};

use super::candidates::Candidate;
use crate::{
    model::dive::{
        expect::ExpectedPose,
        find::Finder,
        parallax::largest_angle,
        settle::{Key, Scene, Settled, settle},
        trail::Trail,
    },
    stereo_pairs::StereoPairs,
};

/// A candidate in the pairs that agree about its place.
#[derive(Debug, Clone)]
pub(super) struct Confirmed {
    /// The adjusted place.
    pub(super) at: Point<World>,
    /// The standard deviation of a coordinate (m), with the poses as exact.
    pub(super) sigma: f64,
    /// The pairs that show it, with its position in their left images.
    pub(super) pairs: Vec<(usize, Pixel)>,
    /// The number of pairs whose images should contain it, in front of other surfaces or behind them.
    pub(super) expected: usize,
    /// The largest angle between two lines of sight (rad).
    pub(super) parallax: f64,
}

/// Searches for all candidates in all pairs, and adjusts poses and places together.
pub(super) fn confirmed(
    finder: &Finder<'_>,
    dive: &StereoPairs,
    trail: &Trail,
    poses: &[(usize, Transform<World, Camera>)],
    candidates: &[Candidate],
) -> Vec<Confirmed> {
    let features = candidates.iter().map(|candidate| candidate.corner.at).collect();
    let mut scene = Scene { poses: vec![None; dive.stamps().len()], features };
    poses.iter().for_each(|(pair, pose)| scene.poses[*pair] = Some(*pose));
    let own = candidates.iter().enumerate().map(|(index, one)| ((one.corner.pair, index), one.corner.pixels));
    let mut seen: BTreeMap<Key, UncertainPixels> = own.collect();
    let mut expected = vec![1; candidates.len()];
    let searched: Vec<Vec<Searched>> =
        poses.par_iter().map(|(pair, _)| searched(finder, dive, trail, *pair, &scene, candidates)).collect();
    for (key, pixels) in searched.into_iter().flatten() {
        expected[key.1] += 1;
        seen.extend(pixels.map(|pixels| (key, pixels)));
    }
    match settle(&dive.rig, trail, &mut scene, &seen) {
        Ok(settled) => summaries(&settled, &expected),
        Err(_) => Vec::new(),
    }
}

/// A candidate that a pair should show, and its pixels if it does.
type Searched = (Key, Option<UncertainPixels>);

/// The candidates of other pairs that a pair should show.
fn searched(
    finder: &Finder<'_>,
    dive: &StereoPairs,
    trail: &Trail,
    pair: usize,
    scene: &Scene,
    candidates: &[Candidate],
) -> Vec<Searched> {
    let (Ok((left, right)), Some(world_from_camera)) = (dive.pair(pair), scene.poses[pair]) else { return Vec::new() };
    let mut poses: BTreeMap<usize, Option<ExpectedPose>> = BTreeMap::new();
    let mut found = Vec::new();
    for (index, Candidate { corner, .. }) in candidates.iter().enumerate().filter(|(_, one)| one.corner.pair != pair) {
        let pose = poses.entry(corner.pair).or_insert_with(|| {
            let covariance = trail.motion(corner.pair, pair)?.covariance.matrix;
            Some(ExpectedPose { world_from_camera, covariance })
        });
        let Some(expectation) = pose.and_then(|pose| pose.sees(finder.rig, &corner.at, &corner.covariance)) else {
            continue;
        };
        let here = finder.corner([&left, &right], &expectation, None);
        found.push(((pair, index), here.ok().map(|found| found.pixels)));
    }
    found
}

/// The adjusted candidates; `expected` is the number of pairs that should show each.
fn summaries(settled: &Settled<'_>, expected: &[usize]) -> Vec<Confirmed> {
    let adjustment = &settled.adjustment;
    let mut all: Vec<Confirmed> = Vec::new();
    let information = adjustment.information_of_points(&settled.excess);
    for (point, (feature, information)) in settled.features.iter().zip(information).enumerate() {
        let at = adjustment.points[point];
        let own: Vec<_> = adjustment.observations.iter().filter(|seen| seen.point == point).collect();
        let rays: Vec<Vector3<f64>> =
            own.iter().map(|seen| adjustment.poses[seen.view].translation() - at.coords).collect();
        let Some(covariance) = information.try_inverse() else { continue };
        all.push(Confirmed {
            at,
            sigma: (covariance.trace() / 3.0).sqrt(),
            pairs: own.iter().map(|seen| (settled.pairs[seen.view], seen.pixels.at.left)).collect(),
            expected: expected[*feature],
            parallax: largest_angle(&rays),
        });
    }
    all
}
