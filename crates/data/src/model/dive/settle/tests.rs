use nalgebra::{DMatrix, Vector3, Vector6};
use seafix_evaluation::compare_models;
use seafix_simulation::{Purpose, Stream};

use super::*;
use crate::model::{
    adjust::tests::{points, poses, rig},
    frame::ObjectFrame,
};

/// The pixels of all points in eight pairs, with noise of 0.05 px; `at` gives the position of a feature in a pair.
fn seen(rig: &StereoRig, at: impl Fn(usize, usize) -> Point<World>) -> BTreeMap<Key, UncertainPixels> {
    let mut stream = Stream::new(9, 0, 0, Purpose::Points);
    let mut seen = BTreeMap::new();
    for (pair, pose) in poses(8).iter().enumerate() {
        for feature in 0..points().len() {
            let Some(mut pixels) = rig.sees(&(pose.inverse() * at(pair, feature)), 0.0) else { continue };
            for side in [&mut pixels.left, &mut pixels.right] {
                side.u += 0.05 * stream.normal();
                side.v += 0.05 * stream.normal();
            }
            seen.insert((pair, feature), UncertainPixels::independent(pixels, 0.05));
        }
    }
    seen
}

/// Poses of a dive with an error of centimetres, and points as far off; moved as a whole by `motion`.
fn scene(motion: &Transform<World, World>) -> Scene {
    let mut stream = Stream::new(4, 0, 0, Purpose::Prior);
    let mut off = |pose: &Transform<World, Camera>| {
        let (turn, shift) = (stream.normal3(0.005), stream.normal3(0.02));
        *motion * pose.perturbed(&Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z))
    };
    Scene {
        poses: poses(8).iter().map(|pose| Some(off(pose))).collect(),
        features: points().iter().map(|point| *motion * (*point + Vector3::new(0.01, 0.02, -0.01))).collect(),
    }
}

fn settled<'a>(rig: &'a StereoRig, seen: &BTreeMap<Key, UncertainPixels>) -> (Settled<'a>, Scene) {
    let mut scene = scene(&Transform::identity());
    let settled = settle(rig, &Trail::unknown(8), &mut scene, seen).unwrap();
    (settled, scene)
}

fn rms(settled: &Settled<'_>) -> f64 {
    let truth: Vec<Vector3<f64>> = settled.features.iter().map(|feature| points()[*feature].coords).collect();
    let built: Vec<Vector3<f64>> = settled.adjustment.points.iter().map(|point| point.coords).collect();
    compare_models(&truth, &built, &DMatrix::identity(3 * truth.len(), 3 * truth.len())).unwrap().rms
}

#[test]
fn a_feature_that_moves_is_given_up() {
    let rig = rig(0.25);
    let moving = |pair: usize, feature: usize| {
        let step = if feature == 4 { 0.03 * pair as f64 } else { 0.0 };
        points()[feature] + Vector3::new(step, 0.0, 0.0)
    };
    let (settled, _) = settled(&rig, &seen(&rig, moving));
    assert_eq!(settled.given_up, BTreeSet::from([4]));
    assert!(!settled.features.contains(&4) && settled.features.len() == 9);
    assert!(rms(&settled) < 1e-3, "{}", rms(&settled));
}

#[test]
fn an_observation_of_another_corner_is_named_and_no_other() {
    let rig = rig(0.25);
    let mut seen = seen(&rig, |_, feature| points()[feature]);
    let wrong = *seen.keys().filter(|key| key.1 == 2).nth(3).unwrap();
    let pixels = seen.get_mut(&wrong).unwrap();
    pixels.at.left.u += 3.0;
    pixels.at.right.u += 3.0;
    let (settled, _) = settled(&rig, &seen);
    assert_eq!(settled.contradicting.keys().copied().collect::<Vec<_>>(), [wrong]);
    assert!(settled.given_up.is_empty() && settled.excess.common < 0.02, "{:?}", settled.excess);
    assert!(rms(&settled) < 1e-3);
}

/// Moving the complete dive moves nothing in the object's frame.
#[test]
fn a_dive_elsewhere_gives_the_same_model() {
    let rig = rig(0.25);
    let seen = seen(&rig, |_, feature| points()[feature]);
    let built = |motion: &Transform<World, World>| {
        let mut scene = scene(motion);
        let settled = settle(&rig, &Trail::unknown(8), &mut scene, &seen).unwrap();
        ObjectFrame::on(&settled.adjustment.points, [0, 1, 2]).unwrap().points
    };
    let here = built(&Transform::identity());
    let there = built(&Transform::exp(&Vector6::new(0.5, -1.0, 0.3, 20.0, -30.0, 5.0)));
    assert!(here.iter().zip(&there).all(|(a, b)| a.distance(b) < 1e-8));
}

#[test]
fn pairs_are_connected_by_three_features_or_by_the_odometry() {
    let keys = |pairs: &[(usize, &[usize])]| -> BTreeSet<Key> {
        pairs.iter().flat_map(|(pair, features)| features.iter().map(move |feature| (*pair, *feature))).collect()
    };
    let trail = Trail::unknown(5);
    let all = keys(&[(0, &[0, 1, 2, 3]), (1, &[1, 2, 3, 4, 5]), (2, &[3, 4, 5]), (3, &[5, 6, 7]), (4, &[0, 1])]);
    // Pair 3 has one feature in common with the others, and pair 4 too few of its own.
    assert_eq!(connected(&trail, &all), [0, 1, 2]);
}
