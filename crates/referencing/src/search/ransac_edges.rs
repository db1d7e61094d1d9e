//! RANSAC over points and edges.

use nalgebra::Vector3;
use rand::{Rng, RngExt};
use seafix_geometry::{Camera, Object, Transform};
use smallvec::SmallVec;

use super::ransac::Ransac;
use crate::{
    problem::Problem,
    search::{
        feature_sets::conclude,
        features::{Features, enough},
        identification::{Identification, Rejected},
        limits::NEEDED,
        orientation::Sense,
        pose,
    },
    solve::line_frames::{Feature, frames},
};

/// The answer to a problem with edges.
///
/// A sample is two edges, or three features. Its vertices must be coherent; edges have their poses in closed form
/// ([`frames`]), three points theirs by least squares. A line without measured depth is in no sample; it supports poses.
pub(super) fn search(settings: &Ransac, problem: &Problem<'_>, rng: &mut dyn Rng) -> Result<Identification, Rejected> {
    let features = Features::of(problem);
    let size = features.len();
    let bound = features.max_possible();
    let (with_candidates, of_points) = features.available();
    if !enough(of_points, with_candidates - of_points) || with_candidates < NEEDED {
        return Err(Rejected::TooFewFeatures { points: of_points, edges: with_candidates - of_points });
    }
    if size > settings.max_pairs {
        return Err(Rejected::TooLarge { size, what: "candidate pairs", max: settings.max_pairs, bound });
    }
    let seeds: Vec<usize> = (0..size).filter(|&v| features.edge(v).is_none_or(|edge| edge.depth)).collect();
    let (mut pair_tests, mut trials, mut needed) = (0, 0u64, f64::INFINITY);
    let mut best: (f64, Option<Transform<Object, Camera>>) = (0.0, None);
    while !seeds.is_empty() && pair_tests < settings.budget && (trials as f64) < needed {
        trials += 1;
        let Some(sample) = sampled(&features, &seeds, rng, &mut pair_tests) else { continue };
        for pose in poses(&features, &sample) {
            pair_tests += size as u64;
            let (score, inliers) = support(&features, &pose);
            if score > best.0 {
                best = (score, Some(pose));
                // Each pair of edges is two vertices, of which one is true.
                let fraction = inliers as f64 / seeds.len() as f64;
                needed = libm::log(1.0 - settings.confidence) / libm::log1p(-fraction.powi(3).min(1.0 - 1e-12));
            }
        }
    }
    let ended = (pair_tests >= settings.budget && (trials as f64) < needed).then_some((settings.budget, pair_tests));
    let ranked = best.1.map_or_else(Vec::new, |pose| features.refined(pose, &mut pair_tests));
    conclude(&features, &ranked, settings.orientation, pair_tests, ended)
}

/// A coherent sample; `None` if the next one is none.
fn sampled(
    features: &Features<'_>,
    seeds: &[usize],
    rng: &mut dyn Rng,
    pair_tests: &mut u64,
) -> Option<SmallVec<[usize; 3]>> {
    let mut sample: SmallVec<[usize; 3]> = SmallVec::new();
    let mut edges = 0;
    while !enough(sample.len() - edges, edges) {
        let next = seeds[rng.random_range(0..seeds.len())];
        *pair_tests += 1;
        if !sample.iter().all(|&other| features.coherent(other, next, Sense::Any)) {
            return None;
        }
        edges += usize::from(features.edge(next).is_some());
        sample.push(next);
    }
    Some(sample)
}

/// The poses of a sample in which every edge has its direction.
fn poses(features: &Features<'_>, sample: &[usize]) -> SmallVec<[Transform<Object, Camera>; 4]> {
    let points: SmallVec<[_; 3]> = sample.iter().filter_map(|&v| features.points.get(v).copied()).collect();
    let edges: SmallVec<[_; 3]> = sample.iter().filter_map(|&v| features.edge(v)).collect();
    if edges.is_empty() {
        return pose::fitted(features.problem, &points).into_iter().collect();
    }
    let problem = features.problem;
    let points = points
        .iter()
        .map(|pair| Feature::Point(problem.model[pair.model].at.coords, problem.cloud[pair.cloud].position.at.coords));
    let of_edges = edges.iter().map(|edge| {
        let line = &edge.directed.line;
        Feature::Line(edge.directed.model, line.ends, line.direction_sigma())
    });
    let all: SmallVec<[Feature; 3]> = points.chain(of_edges).collect();
    let mut found: SmallVec<[Transform<Object, Camera>; 4]> = SmallVec::new();
    for root in frames(&all) {
        let turned = |along: &Vector3<f64>| root.rotation() * along;
        if edges.iter().all(|edge| turned(&edge.directed.along).dot(&edge.directed.line.direction) > 0.0) {
            found.push(root.inverse());
        }
    }
    found
}

/// The score Σ (1 − r²) of a pose over the best candidate of each model feature, and the number of features that it
/// explains.
fn support(features: &Features<'_>, pose: &Transform<Object, Camera>) -> (f64, usize) {
    let (mut score, mut inliers, mut v) = (0.0, 0, 0);
    while v < features.len() {
        let model = features.numbered(v).model;
        let mut min = 1.0_f64;
        while v < features.len() && features.numbered(v).model == model {
            min = min.min(features.fraction(pose, v));
            v += 1;
        }
        score += 1.0 - min * min;
        inliers += usize::from(min < 1.0);
    }
    (score, inliers)
}
