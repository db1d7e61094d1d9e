//! The best views of each point, for the eyes of an operator.

use std::collections::BTreeMap;

use nalgebra::Matrix3;
use seafix_geometry::{Camera, Point, Transform, World};

use super::{
    expect::ExpectedPose,
    picture::{HALF, Picture, cut},
    settle::Scene,
};
use crate::stereo_pairs::StereoPairs;

/// Number of views of each point.
const VIEWS: usize = 3;

/// A point with the pairs that observe it.
pub(super) struct Shown {
    pub(super) at: Point<World>,
    /// The covariance (m², world axes).
    pub(super) covariance: Matrix3<f64>,
    pub(super) pairs: Vec<usize>,
}

/// The pictures of each point: the view of the highest resolution, and those whose directions differ most from it.
///
/// Every pair is read once. The standard deviations are those of the point's expected position in the image.
pub(super) fn pictures(dive: &StereoPairs, scene: &Scene, points: &[Shown]) -> Vec<Vec<Picture>> {
    let mut wanted: BTreeMap<usize, Vec<(usize, usize)>> = BTreeMap::new();
    for (index, point) in points.iter().enumerate() {
        for (rank, pair) in chosen(scene, point).into_iter().enumerate() {
            wanted.entry(pair).or_default().push((index, rank));
        }
    }
    let mut pictures: Vec<Vec<(usize, Picture)>> = points.iter().map(|_| Vec::new()).collect();
    for (pair, all) in wanted {
        let (Some(world_from_camera), Ok((left, _))) = (scene.poses[pair], dive.pair(pair)) else { continue };
        let pose = ExpectedPose { world_from_camera, covariance: nalgebra::Matrix6::zeros() };
        for (index, rank) in all {
            let Some(expected) = pose.position(&dive.rig, &points[index].at, &points[index].covariance) else {
                continue;
            };
            let Some((image, place)) = cut(&left, expected.0, HALF) else { continue };
            pictures[index].push((rank, Picture { stamp_ns: dive.stamps()[pair], image, place, sigma: expected.1 }));
        }
    }
    let sorted = pictures.into_iter().map(|mut all| {
        all.sort_by_key(|(rank, _)| *rank);
        all.into_iter().map(|(_, picture)| picture).collect()
    });
    sorted.collect()
}

/// The pairs of the best views: the nearest, and then each that lies farthest from those before it in direction.
fn chosen(scene: &Scene, point: &Shown) -> Vec<usize> {
    let ray =
        |pair: usize| scene.poses[pair].map(|pose: Transform<World, Camera>| pose.translation() - point.at.coords);
    let rays: Vec<_> = point.pairs.iter().filter_map(|&pair| Some((pair, ray(pair)?))).collect();
    let Some(first) = rays.iter().min_by(|a, b| a.1.norm().total_cmp(&b.1.norm())) else { return Vec::new() };
    let mut chosen = vec![*first];
    while chosen.len() < VIEWS.min(rays.len()) {
        let apart = |ray: &(usize, nalgebra::Vector3<f64>)| {
            chosen.iter().map(|other| other.1.angle(&ray.1)).fold(f64::INFINITY, f64::min)
        };
        let rest = rays.iter().filter(|ray| chosen.iter().all(|other| other.0 != ray.0));
        let Some(next) = rest.max_by(|a, b| apart(a).total_cmp(&apart(b))) else { break };
        chosen.push(*next);
    }
    chosen.into_iter().map(|(pair, _)| pair).collect()
}
