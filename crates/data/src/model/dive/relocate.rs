//! The pose of a pair from the growing model itself, without an odometry.
//!
//! Corners of the pair that form the triangle of three features give a pose (hypothesise and verify); the pose with the
//! most features at corners is refined. Patterns that repeat give several such poses, therefore the surroundings of the
//! features decide: they must align with their templates in many more places than for any other pose.

use nalgebra::Matrix3;
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, StereoRig, Transform, UncertainPoint, World, triad};
use seafix_referencing::{Observation, Observations, Solver, StereoReprojection};
use seafix_vision::{FrontEndOutput, Image};

use super::{
    expect::ExpectedPose,
    find::{Appearance, Finder},
    gather::Feature,
    settle::Scene,
};

type Pose = Transform<World, Camera>;

/// The number of triangles of features that are tried.
const TRIANGLES: usize = 60;
/// The number of standard deviations by which a length may differ.
const SIGMAS: f64 = 3.0;
/// The distance (px) of a projected feature from the corner that it explains, in each image.
const NEAR: f64 = 3.0;
/// The number of poses whose surroundings are compared.
const COMPARED: usize = 24;
/// The number of surroundings by which the best pose must exceed another, of those that align with one of both alone.
///
/// If one window in ten aligned elsewhere than at its feature, four would in 1e-4 of cases. On OpenCV's chessboard the
/// nearest other pose aligns six fewer of 54.
const DECISIVE: usize = 4;
/// The minimum number of features with aligned surroundings: one more than determine the pose.
const MIN_ALIGNED: usize = 4;
/// The radius (px) of the alignment of surroundings.
const REACH: f64 = 2.0;

/// The features that a pose explains, as pairs (feature, corner).
type Hypothesis = Vec<(usize, usize)>;

/// The pose of a pair that shows at least four known features; `None` if there is no pose or more than one.
pub(super) fn relocate(
    finder: &Finder<'_>,
    images: [&Image; 2],
    scene: &Scene,
    features: &[Feature],
    known: &[usize],
) -> Option<Pose> {
    let mut output = FrontEndOutput::default();
    finder.front_end.run(images[0], images[1], finder.rig, &mut output);
    let mut hypotheses = hypotheses(finder.rig, &output.cloud, scene, features, known);
    hypotheses.sort_by_key(|hypothesis| std::cmp::Reverse(hypothesis.len()));
    let mut distinct: Vec<Hypothesis> = Vec::new();
    for hypothesis in hypotheses {
        if distinct.len() < COMPARED && !distinct.contains(&hypothesis) {
            distinct.push(hypothesis);
        }
    }
    let refined = distinct.into_iter().filter_map(|hypothesis| {
        let pose = refined(finder.rig, &output.cloud, scene, features, &hypothesis)?;
        let pairs = explained(finder.rig, &pose, &output.cloud, scene, known);
        let pose = refined(finder.rig, &output.cloud, scene, features, &pairs)?;
        Some((aligned(finder, images, &pose, scene, features, known), pose))
    });
    let scored: Vec<(usize, Pose)> = refined.collect();
    decided(&scored, |a, b| same(a, b, scene, known))
}

/// The pose with the largest number of aligned surroundings; `None` for too few, or if another pose has nearly as many.
fn decided(scored: &[(usize, Pose)], same: impl Fn(&Pose, &Pose) -> bool) -> Option<Pose> {
    let (count, pose) = *scored.iter().max_by_key(|(count, _)| *count)?;
    // Those that align with both cancel.
    let as_good = |(other, at): &(usize, Pose)| other + DECISIVE > count && !same(&pose, at);
    (count >= MIN_ALIGNED && !scored.iter().any(as_good)).then_some(pose)
}

/// Whether two poses put the features at the same places: a pitch of a pattern is larger than a hundredth of the range.
fn same(a: &Pose, b: &Pose, scene: &Scene, known: &[usize]) -> bool {
    let (a, b) = (a.inverse(), b.inverse());
    known.iter().all(|&feature| {
        let [p, q] = [a, b].map(|camera_from_world| camera_from_world * scene.features[feature]);
        p.distance(&q) < 0.01 * p.coords.z.abs()
    })
}

/// Poses from triangles of features and of corners.
fn hypotheses(
    rig: &StereoRig,
    cloud: &[MeasuredPoint],
    scene: &Scene,
    features: &[Feature],
    known: &[usize],
) -> Vec<Hypothesis> {
    let mut found = Vec::new();
    if known.len() < 3 {
        return found;
    }
    // A function of the number of features alone, so that a run is repeatable.
    let mut rng = ChaCha8Rng::seed_from_u64(known.len() as u64);
    for _ in 0..TRIANGLES {
        let [a, b, c] = [(); 3].map(|()| known[rng.random_range(0..known.len())]);
        let corners = [a, b, c].map(|feature| scene.features[feature]);
        let Ok(world_from_base) = triad::<World, Object>(&corners[0], &corners[1], &corners[2]) else { continue };
        let agrees = |i: usize, j: usize, one: usize, other: usize| {
            let (p, q) = (&cloud[i].position, &cloud[j].position);
            let step = q.at - p.at;
            let Some(n) = step.try_normalize(1e-9) else { return false };
            let model = features[one].spread + features[other].spread;
            let variance = n.dot(&((p.covariance + q.covariance) * n)) + model.trace() / 3.0;
            let length = scene.features[one].distance(&scene.features[other]);
            (step.norm() - length).abs() <= SIGMAS * variance.sqrt()
        };
        for i in 0..cloud.len() {
            for j in (0..cloud.len()).filter(|&j| j != i && agrees(i, j, a, b)) {
                for k in (0..cloud.len()).filter(|&k| k != i && k != j && agrees(i, k, a, c) && agrees(j, k, b, c)) {
                    let [p, q, r] = [i, j, k].map(|index| &cloud[index].position.at);
                    let Ok(camera_from_base) = triad::<Camera, Object>(p, q, r) else { continue };
                    let pose = world_from_base * camera_from_base.inverse();
                    let pairs = explained(rig, &pose, cloud, scene, known);
                    if pairs.len() >= MIN_ALIGNED {
                        found.push(pairs);
                    }
                }
            }
        }
    }
    found
}

/// The features that a pose puts at corners of both images, with the nearest corner of each.
fn explained(
    rig: &StereoRig,
    pose: &Pose,
    cloud: &[MeasuredPoint],
    scene: &Scene,
    known: &[usize],
) -> Vec<(usize, usize)> {
    let camera_from_world = pose.inverse();
    let nearest = |feature: usize| {
        let here = camera_from_world * scene.features[feature];
        if here.coords.z <= 0.0 {
            return None;
        }
        let expected = rig.sees(&here, 0.0)?;
        let near = cloud.iter().enumerate().filter_map(|(corner, point)| {
            let seen = point.pixels?.at;
            let distance = seen.left.distance(&expected.left).max(seen.right.distance(&expected.right));
            (distance <= NEAR).then_some((distance, corner))
        });
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, corner)| (feature, corner))
    };
    known.iter().filter_map(|&feature| nearest(feature)).collect()
}

/// The maximum-likelihood pose of identified features.
fn refined(
    rig: &StereoRig,
    cloud: &[MeasuredPoint],
    scene: &Scene,
    features: &[Feature],
    pairs: &[(usize, usize)],
) -> Option<Pose> {
    let points = pairs.iter().map(|&(feature, corner)| Observation {
        measured: UncertainPoint { ..cloud[corner].position },
        pixels: cloud[corner].pixels,
        model: Point::<Object>::from(scene.features[feature].coords),
        model_sigma: (features[feature].spread.trace() / 3.0).sqrt(),
    });
    let data = Observations { points: points.collect(), edges: Vec::new(), rig: Some(rig) };
    let object_from_camera = StereoReprojection::default().solve(&data).ok()?;
    Some(object_from_camera.relabel())
}

/// The number of features whose surroundings align with their templates at this pose.
fn aligned(
    finder: &Finder<'_>,
    images: [&Image; 2],
    pose: &Pose,
    scene: &Scene,
    features: &[Feature],
    known: &[usize],
) -> usize {
    let expected = ExpectedPose { world_from_camera: *pose, covariance: nalgebra::Matrix6::zeros() };
    let aligns = |feature: usize| {
        let at = &scene.features[feature];
        let place = expected.sees(finder.rig, at, &Matrix3::zeros())?.pixels.left;
        let template = features[feature].templates.first()?;
        let world_from_here = scene.poses[template.pair]?;
        let appearance = Appearance {
            template,
            here: world_from_here.inverse() * *at,
            there_from_here: pose.inverse() * world_from_here,
        };
        finder.aligned(images[0], &appearance, place, REACH).map(|_| ())
    };
    known.iter().filter(|feature| aligns(**feature).is_some()).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_counts_if_no_other_is_nearly_as_good() {
        let at = |x: f64| Pose::exp(&[0.0, 0.0, 0.0, x, 0.0, 0.0].into());
        let same = |a: &Pose, b: &Pose| (a.translation() - b.translation()).norm() < 0.01;
        let decided = |scored: &[(usize, f64)]| {
            let scored: Vec<(usize, Pose)> = scored.iter().map(|(count, x)| (*count, at(*x))).collect();
            decided(&scored, same).map(|pose| pose.translation().x)
        };
        // The same pose by two triangles, and a shift of a pattern.
        assert_eq!(decided(&[(50, 0.125), (54, 0.0), (53, 0.001)]), Some(0.0));
        assert_eq!(decided(&[(51, 0.125), (54, 0.0)]), None);
        assert_eq!(decided(&[(4, 0.0), (0, 1.0)]), Some(0.0));
        assert_eq!(decided(&[(3, 0.0)]), None);
        assert_eq!(decided(&[]), None);
    }
}
