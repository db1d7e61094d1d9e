//! A wrong focal length of both cameras, which stretches the depth alone.

use nalgebra::Matrix4;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{Pinhole, Pixel, RightCamera, StereoPixels, UncertainPixels, so3};

use super::*;
use crate::solve::{likelihood::leave_out::Deletions, mahalanobis::Mahalanobis};

/// The pixel noise (px).
const PIXELS: f64 = 0.3;
/// The true focal length (px).
const FOCAL: f64 = 900.0;

/// A rig with a baseline of 0.12 m and this focal length (px).
fn rig(focal: f64) -> StereoRig {
    let camera = Pinhole::new([1024, 768], [focal, focal], [511.5, 383.5], &[]).unwrap();
    StereoRig::new(camera, camera, Transform::<RightCamera, Camera>::exp(&[0.0, 0.0, 0.0, -0.12, 0.0, 0.0].into()))
        .unwrap()
}

/// A normal number.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random_range(-0.5..0.5)).sum()
}

/// `count` points in a box of these sides (m) about the origin, turned by `tilt` (rad) about x and seen from `distance`
/// (m) with a rig of [`FOCAL`]; `focal` (px) is the one the points are triangulated with.
fn seen(
    count: usize,
    sides: [f64; 3],
    tilt: f64,
    distance: f64,
    focal: f64,
    rng: &mut ChaCha8Rng,
) -> (Scene, StereoRig) {
    let model: Vec<ModelPoint> = (0..count)
        .map(|k| {
            let at = sides.map(|side| side * rng.random_range(-0.5..0.5));
            ModelPoint::exact(format!("p{k}"), at.into())
        })
        .collect();
    let turn = so3::exp(&Vector3::new(tilt, 0.0, 0.0));
    let camera_from_object = Transform::<Camera, Object>::new(turn, Vector3::new(0.0, 0.0, distance));
    let (truth, assumed) = (rig(FOCAL), rig(focal));
    let mut scene = Scene::of(model, &camera_from_object.inverse());
    for (point, seen) in scene.model.iter().zip(&mut scene.cloud) {
        let exact = truth.project(&(camera_from_object * point.at)).unwrap();
        let mut off = |p: Pixel| Pixel { u: p.u + PIXELS * normal(rng), v: p.v + PIXELS * normal(rng) };
        let at = StereoPixels { left: off(exact.left), right: off(exact.right) };
        let pixels = UncertainPixels { at, covariance: Matrix4::identity() * (PIXELS * PIXELS) };
        let found = assumed.triangulate(&pixels).unwrap();
        seen.position = UncertainPoint { at: found.point, covariance: found.covariance };
        seen.pixels = Some(pixels);
    }
    (scene, assumed)
}

/// The outcome of the complete judgement with the rig.
fn outcome(scene: &Scene, rig: &StereoRig) -> Outcome {
    let solver = Mahalanobis::default();
    let found = Identification::unproved(scene.pairs(), scene.model.len(), 0);
    scene.judge(&solver, |judge| {
        let judge = Judge { rig: Some(rig), anchors: judge.anchors.clone(), ..*judge };
        judge.poses(&found, None).0
    })
}

/// The depth error of a set, and whether it rejects the set.
fn depth_error(scene: &Scene, rig: &StereoRig) -> (ScaleError, bool) {
    let data = Observations::of(&scene.pairs(), &scene.model, &scene.cloud, Some(rig));
    let found = Deletions::of(&data).unwrap().depth_error.unwrap();
    let pose = Mahalanobis::default().solve(&data).unwrap();
    let hypothesis = scene.hypothesis(pose, likelihood::maximum(&data, &pose).cost);
    let (chi2, dof) = (hypothesis.likelihood.cost, hypothesis.dof());
    let known = Integrity { depth_error: Some(found), dof, ..of_fixes::integrity(chi2, None) };
    let judged = scene.judge(&Kabsch::default(), |judge| judge.as_large_as_modelled(&hypothesis, &known));
    (found, matches!(judged, Err(RejectionReason::DepthError { .. })))
}

/// Boxes of 0.3 × 0.3 × 0.8 m at 3 m with a wrong focal length. The estimate is the error of the focal length; an error
/// of 5 % rejects no set, one of the other medium nearly all.
///
/// Fails with another lever, and without the limits.
#[test]
fn a_focal_length_of_the_other_medium_is_rejected_by_its_depth_error() {
    for (by, min, max) in [(1.05, 0, 0), (0.95, 0, 0), (1.0 / 1.33, 19, 20), (1.33, 19, 20)] {
        let (mut rejected, mut off) = (0, 0.0);
        for seed in 0..20 {
            let (scene, rig) = seen(80, [0.3, 0.3, 0.8], 0.3, 3.0, by * FOCAL, &mut ChaCha8Rng::seed_from_u64(seed));
            let (found, rejects) = depth_error(&scene, &rig);
            rejected += usize::from(rejects);
            off += (found.value - (by - 1.0)) / 20.0;
        }
        assert!((min..=max).contains(&rejected), "{by}: {rejected} of 20");
        // σ is about 0.8 %, and the estimate is one linear step.
        assert!(off.abs() < 0.1 * (by - 1.0f64).abs().max(0.05), "{by}: off by {off}");
    }
}

/// A plane seen face-on has no information on the depth error, and its fix stands.
#[test]
fn a_plane_seen_face_on_is_not_rejected_for_its_depth() {
    for seed in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (scene, rig) = seen(30, [1.2, 1.2, 0.0], 0.0, 3.0, 1.05 * FOCAL, &mut rng);
        let Outcome::Fix(fix) = outcome(&scene, &rig) else { panic!("{seed}") };
        assert!(fix.integrity.depth_error.is_none_or(|found| found.sigma > 1.0), "{seed}: {:?}", fix.integrity);
    }
}

/// The depth errors of correct rigs, with relief or flat and tilted, have the stated standard deviation: 5 % of them
/// exceed 1.96 of it.
///
/// Fails if the standard deviation is 0.8 times its own.
#[test]
fn the_depth_error_of_a_correct_rig_has_its_standard_deviation() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let cases = [
        (12, [1.2, 1.2, 1.0], 0.3, 3.0),
        (5, [1.0, 1.0, 1.0], 0.1, 3.0),
        (30, [1.2, 1.2, 0.0], 0.1, 3.0),
        (30, [1.2, 1.2, 0.0], 0.7, 3.0),
    ];
    let (mut beyond, mut squares) = (0, 0.0);
    for _ in 0..250 {
        for (count, sides, tilt, distance) in cases {
            let (scene, rig) = seen(count, sides, tilt, distance, FOCAL, &mut rng);
            let (found, rejects) = depth_error(&scene, &rig);
            let square = (found.value / found.sigma).powi(2);
            beyond += usize::from(square > 1.96 * 1.96);
            squares += square / 1000.0;
            assert!(!rejects, "{found:?}");
        }
    }
    // 50 ± 7 of 1000; χ²₁ on average: 1 ± 0.045.
    assert!((28..72).contains(&beyond) && (0.85..1.15).contains(&squares), "{beyond} {squares}");
}
