//! The corner that a mark means, from other pairs than its own.
//!
//! In the pair of its mark a corner may have no fitted place or no match: it has little contrast there, or lies before
//! another surface. Its line of sight is known nevertheless. Corners of other pairs on that line are candidates; the one
//! that most pairs confirm is the feature.

use nalgebra::Matrix3;
use rayon::prelude::*;
use seafix_geometry::{Camera, Pixel, Point, UncertainPoint, World};
use seafix_vision::Image;

use super::{
    expect::ExpectedPose,
    find::{Finder, SPACING},
    settle::Scene,
};
use crate::stereo_pairs::StereoPairs;

/// The mark of a feature whose corner is searched for.
#[derive(Debug, Clone, Copy)]
pub(super) struct MarkRay {
    /// The index of the feature.
    pub(super) feature: usize,
    /// The pair of the mark.
    pub(super) pair: usize,
    /// The mark in its left image.
    pub(super) mark: Pixel,
}

/// A pair with its pose and images.
struct View {
    pair: usize,
    pose: ExpectedPose,
    images: [Image; 2],
}

/// The maximum number of pairs that are read: their images are in memory together.
const EXAMINED: usize = 12;
/// The number of those, nearest to the mark's pair, whose corners are candidates.
const PROPOSING: usize = 4;
/// The depths that are searched, relative to the smallest and the largest depth of the known features.
const DEPTHS: [f64; 2] = [0.8, 1.25];
/// The minimum number of pairs that confirm a corner.
const MIN_CONFIRMED: usize = 3;

/// The corners of the marks, with their positions in the world; none for a mark whose corner fewer than half of the
/// pairs confirm.
pub(super) fn recovered(
    finder: &Finder<'_>,
    dive: &StereoPairs,
    scene: &Scene,
    known: &[usize],
    lines: &[MarkRay],
) -> Vec<(usize, UncertainPoint<World>)> {
    if lines.is_empty() {
        return Vec::new();
    }
    let posed: Vec<usize> = (0..scene.poses.len()).filter(|pair| scene.poses[*pair].is_some()).collect();
    let step = posed.len().div_ceil(EXAMINED).max(1);
    let view = |pair: &usize| {
        let pose = ExpectedPose { world_from_camera: scene.poses[*pair]?, covariance: nalgebra::Matrix6::zeros() };
        let (left, right) = dive.pair(*pair).ok()?;
        Some(View { pair: *pair, pose, images: [left, right] })
    };
    let views: Vec<View> = posed.into_iter().step_by(step).collect::<Vec<_>>().par_iter().filter_map(view).collect();
    let corner = |line: &MarkRay| Some((line.feature, line.corner(finder, scene, known, &views)?));
    lines.par_iter().filter_map(corner).collect()
}

impl MarkRay {
    /// The corner that most pairs confirm.
    fn corner(
        &self,
        finder: &Finder<'_>,
        scene: &Scene,
        known: &[usize],
        views: &[View],
    ) -> Option<UncertainPoint<World>> {
        let candidates = self.candidates(finder, scene, known, views)?;
        let judged = candidates.into_iter().filter_map(|(off, candidate)| {
            let (expected, confirmed) = confirmed(finder, views, &candidate);
            (confirmed >= MIN_CONFIRMED && 2 * confirmed >= expected).then_some((confirmed, off, candidate))
        });
        // Of those that all pairs confirm, the one nearest to the mark.
        let best = judged.max_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)))?;
        Some(best.2)
    }

    /// Corners of the nearest pairs on the line of sight, with their distance (px) from the mark.
    fn candidates(
        &self,
        finder: &Finder<'_>,
        scene: &Scene,
        known: &[usize],
        views: &[View],
    ) -> Option<Vec<(f64, UncertainPoint<World>)>> {
        let world_from_marked = scene.poses[self.pair]?;
        let marked_from_world = world_from_marked.inverse();
        let ray = finder.rig.left().normalize(&self.mark)?.push(1.0);
        let depths = || known.iter().map(|feature| (marked_from_world * scene.features[*feature]).coords.z);
        let (near, far) = (depths().fold(f64::INFINITY, f64::min), depths().fold(0.0, f64::max));
        let (near, far) = (near * DEPTHS[0], far * DEPTHS[1]);
        if near <= 0.0 || near > far {
            return None;
        }
        let away = |view: &&View| {
            let step = view.pose.world_from_camera.translation() - world_from_marked.translation();
            step.norm()
        };
        let mut nearest: Vec<&View> = views.iter().filter(|view| view.pair != self.pair).collect();
        nearest.sort_by(|a, b| away(a).total_cmp(&away(b)));
        let mut found = Vec::new();
        for view in nearest.into_iter().take(PROPOSING) {
            let camera_from_marked = view.pose.world_from_camera.inverse() * world_from_marked;
            let at = |inverse_depth: f64| camera_from_marked * Point::<Camera>::from(ray / inverse_depth);
            let [Some(first), Some(last)] = [far, near].map(|depth| finder.rig.left().project(&at(1.0 / depth))) else {
                continue;
            };
            let steps = (first.distance(&last) / SPACING).ceil().max(1.0) as usize;
            let place = |k: usize| at(1.0 / far + (1.0 / near - 1.0 / far) * k as f64 / steps as f64);
            let places = (0..=steps).map(place).filter(|place| finder.rig.sees(place, 0.0).is_some());
            for measured in finder.corners_along([&view.images[0], &view.images[1]], places) {
                let turn = view.pose.world_from_camera.rotation_matrix();
                let world = view.pose.world_from_camera * measured.at;
                let Some(seen) = finder.rig.left().project(&(marked_from_world * world)) else { continue };
                let off = seen.distance(&self.mark);
                if off <= finder.reach {
                    let covariance = turn * measured.covariance * turn.transpose();
                    found.push((off, UncertainPoint { at: world, covariance }));
                }
            }
        }
        Some(found)
    }
}

/// The number of pairs that should show a corner, and of those that do.
fn confirmed(finder: &Finder<'_>, views: &[View], candidate: &UncertainPoint<World>) -> (usize, usize) {
    let spread: Matrix3<f64> = candidate.covariance;
    let expected = views.iter().filter_map(|view| Some((view, view.pose.sees(finder.rig, &candidate.at, &spread)?)));
    let (mut count, mut found) = (0, 0);
    for (view, expectation) in expected {
        count += 1;
        found += usize::from(finder.corner([&view.images[0], &view.images[1]], &expectation, None).is_ok());
    }
    (count, found)
}
