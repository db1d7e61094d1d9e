//! Place recognition and loop closing over a simulated ground of points.

use nalgebra::{Matrix6, Vector3, Vector6};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};
use seafix_geometry::{
    Camera, Covariance6, MeasuredPoint, Object, Pinhole, Pixel, Point, StereoRig, Transform, UncertainPixels,
    UncertainPoint, World, so3,
};
use seafix_vision::{Descriptors, Keypoint, Table, Threads};

use super::{
    PoseGraph,
    keyframe::StereoFeatures,
    recognition::{LoopCandidate, NotRecognized, PlaceRecognizer, Recognition},
    traverse::{PoseEstimate, PoseGraphSettings, Traverse},
};
use crate::{
    chain::ObjectPose,
    navigated::{Navigated, ObjectPlacement},
    odometry_trajectory::RelativeMotion,
};

/// Length of a descriptor.
const LENGTH: usize = 32;
/// Standard deviation of a pixel coordinate (px).
const PX: f64 = 0.3;

fn even(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * f64::from(rng.next_u32()) / f64::from(u32::MAX)
}

/// An approximately normal random number: the sum of twelve uniform ones.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| even(rng, 0.0, 1.0)).sum::<f64>() - 6.0
}

fn normal6(rng: &mut ChaCha8Rng, attitude: f64, position: f64) -> Vector6<f64> {
    Vector6::from_fn(|k, _| if k < 3 { attitude * normal(rng) } else { position * normal(rng) })
}

fn rig() -> StereoRig {
    let camera = Pinhole::new([1024, 768], [500.0, 500.0], [512.0, 384.0], &[]).unwrap();
    StereoRig::new(camera, camera, Transform::new(so3::exp(&Vector3::zeros()), Vector3::new(-0.25, 0.0, 0.0))).unwrap()
}

/// A simulated ground: points with descriptors.
struct Ground {
    points: Vec<(Point<World>, Vec<f32>)>,
}

impl Ground {
    fn new(rng: &mut ChaCha8Rng, count: usize, extent: [f64; 2]) -> Self {
        let points = (0..count).map(|_| {
            let (x, y) = (even(rng, -extent[0], extent[0]), even(rng, -extent[1], extent[1]));
            (Point::new(x, y, even(rng, -0.2, 0.2)), appearance(rng))
        });
        Self { points: points.collect() }
    }

    /// The view of the rig from a pose.
    fn seen(
        &self,
        rng: &mut ChaCha8Rng,
        rig: &StereoRig,
        world_from_camera: &Transform<World, Camera>,
    ) -> StereoFeatures {
        let camera_from_world = world_from_camera.inverse();
        let (mut cloud, mut keypoints, mut rows) = (Vec::new(), Vec::new(), Vec::new());
        for (place, appearance) in &self.points {
            let Some(mut at) = rig.project(&(camera_from_world * *place)) else { continue };
            if !(rig.left().contains(&at.left, 5.0) && rig.right().contains(&at.right, 5.0)) {
                continue;
            }
            for pixel in [&mut at.left, &mut at.right] {
                *pixel = Pixel { u: pixel.u + PX * normal(rng), v: pixel.v + PX * normal(rng) };
            }
            let pixels = UncertainPixels::independent(at, PX);
            let found = rig.triangulate(&pixels).unwrap();
            let position = UncertainPoint { at: found.point, covariance: found.covariance };
            cloud.push(MeasuredPoint { position, pixels: Some(pixels) });
            keypoints.push(Keypoint { at: at.left, response: 1.0, scale: 2.0 });
            rows.extend(appearance.iter().map(|x| x + 0.02 * normal(rng) as f32));
        }
        let descriptors = Descriptors::Numbers(Table::new(LENGTH, rows));
        StereoFeatures { stamp_ns: rng.next_u64() >> 8, cloud, keypoints, descriptors }
    }
}

fn appearance(rng: &mut ChaCha8Rng) -> Vec<f32> {
    let numbers: Vec<f64> = (0..LENGTH).map(|_| normal(rng)).collect();
    let norm = numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
    numbers.iter().map(|x| (x / norm) as f32).collect()
}

/// A pose 3.5 m above the ground, looking down.
fn above(x: f64, y: f64, heading: f64) -> Transform<World, Camera> {
    Transform::new(so3::exp(&Vector3::new(0.0, 0.0, heading)), Vector3::new(x, y, -3.5))
}

/// A prior with an error that follows its covariance.
fn prior(rng: &mut ChaCha8Rng, truth: &Transform<Camera, Camera>) -> RelativeMotion {
    let covariance = Covariance6::isotropic(0.05, 0.3);
    RelativeMotion::new(truth.perturbed(&normal6(rng, 0.05, 0.3)), covariance)
}

const NOTHING: fn(usize, usize) -> Option<RelativeMotion> = |_, _| None;

#[test]
fn a_key_frame_is_recognized_from_another_side_with_a_consistent_covariance() {
    let draws = 150;
    let (rig, settings) = (rig(), Recognition::default());
    let mut recognizer = PlaceRecognizer::new(&settings, &rig, Threads::One);
    let (mut found, mut nees) = (0, 0.0);
    for seed in 0..draws {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let ground = Ground::new(&mut rng, 150, [4.0, 3.0]);
        let (then, now) = (above(0.0, 0.0, 0.0), above(0.8, -0.5, 3.0).perturbed(&normal6(&mut rng, 0.05, 0.2)));
        let keyframe = ground.seen(&mut rng, &rig, &then).reduced();
        let stereo_features = ground.seen(&mut rng, &rig, &now);
        let truth = then.inverse() * now;
        let prior = prior(&mut rng, &truth);
        if let Ok(one) =
            recognizer.recognize(&stereo_features, &[LoopCandidate { keyframe: &keyframe, prior }], NOTHING)
        {
            found += 1;
            let error = one.motion.motion.error_to(&truth);
            nees += error.dot(&(one.motion.covariance.matrix.try_inverse().unwrap() * error));
            assert!(error.fixed_rows::<3>(3).norm() < 0.05, "{seed}: {error}");
        }
    }
    assert!(found >= draws - 2, "{found}");
    let mean = nees / found as f64;
    assert!((mean - 6.0).abs() < 4.0 * (12.0 / found as f64).sqrt(), "{mean}");
}

/// Checks that `draws` other grounds are rejected.
fn rejected(draws: u64) {
    let (rig, settings) = (rig(), Recognition::default());
    let mut recognizer = PlaceRecognizer::new(&settings, &rig, Threads::One);
    for seed in 0..draws {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let ground = Ground::new(&mut rng, 150, [4.0, 3.0]);
        let mut other = Ground::new(&mut rng, 150, [4.0, 3.0]);
        // Every second ground has the same descriptors, point for point, at other positions.
        if seed % 2 == 0 {
            other
                .points
                .iter_mut()
                .zip(&ground.points)
                .for_each(|(other, (_, appearance))| other.1.clone_from(appearance));
        }
        let keyframe = ground.seen(&mut rng, &rig, &above(0.0, 0.0, 0.0)).reduced();
        let stereo_features = other.seen(&mut rng, &rig, &above(0.2, 0.1, 0.4));
        let prior = prior(&mut rng, &(above(0.0, 0.0, 0.0).inverse() * above(0.2, 0.1, 0.4)));
        let reported = recognizer.recognize(&stereo_features, &[LoopCandidate { keyframe: &keyframe, prior }], NOTHING);
        assert!(reported.is_err(), "{seed}: {reported:?}");
    }
}

#[test]
fn other_ground_is_rejected() {
    rejected(30);
}

#[test]
fn the_same_appearance_elsewhere_contradicts_the_known_pose() {
    let (rig, settings) = (rig(), Recognition::default());
    let mut recognizer = PlaceRecognizer::new(&settings, &rig, Threads::One);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let ground = Ground::new(&mut rng, 150, [4.0, 3.0]);
    let keyframe = ground.seen(&mut rng, &rig, &above(0.0, 0.0, 0.0)).reduced();
    let stereo_features = ground.seen(&mut rng, &rig, &above(0.0, 0.0, 0.0));
    let far =
        RelativeMotion::new(Transform::exp(&[0.0, 0.0, 0.0, 3.0, 0.0, 0.0].into()), Covariance6::isotropic(0.05, 0.3));
    let near = RelativeMotion::new(Transform::identity(), Covariance6::isotropic(0.05, 0.3));
    let at = |prior| LoopCandidate { keyframe: &keyframe, prior };
    let reported = recognizer.recognize(&stereo_features, &[at(far)], NOTHING);
    assert!(matches!(reported, Err(NotRecognized::Contradicts(_))), "{reported:?}");
    assert_eq!(recognizer.recognize(&stereo_features, &[], NOTHING), Err(NotRecognized::Nowhere));
    // Two identical grounds, known to be a metre apart: the camera cannot be above both.
    let apart = |a: usize, b: usize| {
        let x = a as f64 - b as f64;
        Some(RelativeMotion::new(
            Transform::exp(&[0.0, 0.0, 0.0, x, 0.0, 0.0].into()),
            Covariance6::isotropic(1e-3, 1e-2),
        ))
    };
    let reported = recognizer.recognize(&stereo_features, &[at(near), at(near)], apart);
    assert_eq!(reported, Err(NotRecognized::Ambiguous(0, 1)));
    assert!(recognizer.recognize(&stereo_features, &[at(near), at(near)], NOTHING).is_ok());
}

/// The result of a simulated dive of forty half-metre steps out and back.
///
/// There is one fix, at the start. The result holds the error and covariance of the last pose, by the pose graph and by
/// odometry alone, and the numbers of added and recognised key frames.
struct Dived {
    pose_graph: (Vector6<f64>, Matrix6<f64>),
    odometry: (Vector6<f64>, Matrix6<f64>),
    added: usize,
    relocalized: usize,
    kept: PoseGraph,
}

const STEP: (f64, f64) = (1e-3, 5e-3);
const FIX: (f64, f64) = (1e-3, 5e-3);
/// Number of ground points of the short tests.
const FEW: usize = 1000;

fn dive(seed: u64, points: usize, rig: &StereoRig, settings: &PoseGraphSettings, earlier: Option<&PoseGraph>) -> Dived {
    let mut ground_rng = ChaCha8Rng::seed_from_u64(55);
    let ground = Ground::new(&mut ground_rng, points, [18.0, 6.0]);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let world_from_object = Transform::<World, Object>::exp(&[0.0, 0.0, 0.5, -12.0, 1.0, 0.0].into());
    let place = ObjectPlacement { world_from_object, covariance: Covariance6::isotropic(1e-3, 1e-3) };
    let mut pose_graph = earlier.cloned().unwrap_or_else(|| PoseGraph::new(vec![("box".to_owned(), place)]));
    if earlier.is_some() {
        pose_graph.objects[0].1 = place;
    }
    let mut traverse = Traverse::begin(settings, pose_graph, rig, Threads::One);
    let path: Vec<Transform<World, Camera>> = (0..=80)
        .map(|k| {
            let (out, x) = (k <= 40, if k <= 40 { k } else { 80 - k });
            above(-10.0 + 0.5 * f64::from(x), 0.0, if out { 0.0 } else { std::f64::consts::PI })
        })
        .collect();
    let truth = world_from_object.inverse() * path[0];
    let fix = ObjectPose::new(truth.perturbed(&-normal6(&mut rng, FIX.0, FIX.1)), Covariance6::isotropic(FIX.0, FIX.1));
    let mut known = Navigated { object: 0, object_pose: fix.clone() };
    let mut alone = fix;
    let (mut added, mut relocalized) = (0, 0);
    for (k, world_from_camera) in path.iter().enumerate() {
        if k > 0 {
            let motion = path[k - 1].inverse() * *world_from_camera;
            let step = RelativeMotion::new(
                motion.perturbed(&-normal6(&mut rng, STEP.0, STEP.1)),
                Covariance6::isotropic(STEP.0, STEP.1),
            );
            traverse.advance(2.0, Some(&step));
            known = known.after(&step);
            alone = alone.after(&step);
        }
        let stamp_ns = 1 + k as u64 * 2_000_000_000;
        let estimate = PoseEstimate { stamp_ns, navigated: Some(known.clone()), prior_pose: None };
        let fixes: &[Navigated] = if k == 0 { std::slice::from_ref(&known) } else { &[] };
        let closure = traverse.visit_by(&estimate, fixes, |_| ground.seen(&mut rng, rig, world_from_camera));
        added += usize::from(closure.added.is_some());
        if let Some(Ok(found)) = closure.sought {
            relocalized += 1;
            known = found.navigated.unwrap_or(known);
        }
    }
    let last = world_from_object.inverse() * *path.last().unwrap();
    let reported =
        |object_pose: &ObjectPose| (object_pose.object_from_camera.error_to(&last), object_pose.covariance.matrix);
    Dived {
        pose_graph: reported(&known.object_pose),
        odometry: reported(&alone),
        added,
        relocalized,
        kept: traverse.finish(),
    }
}

fn nees((error, covariance): &(Vector6<f64>, Matrix6<f64>)) -> f64 {
    error.dot(&(covariance.try_inverse().unwrap() * error))
}

/// Checks that `draws` return paths over key frames end at the start, with a consistent covariance.
///
/// The test fails if the motion from a key frame has an error of 5 cm.
fn returns(draws: u64, points: usize) {
    let (rig, settings) = (rig(), PoseGraphSettings { min_loop_distance: 5.0, ..PoseGraphSettings::default() });
    let (mut sum, mut squares, mut alone) = (0.0, 0.0, 0.0);
    for seed in 0..draws {
        let dived = dive(seed, points, &rig, &settings, None);
        assert!((4..=12).contains(&dived.added), "{seed}: {} added", dived.added);
        assert!(dived.relocalized >= 5, "{seed}: {} recognised", dived.relocalized);
        sum += nees(&dived.pose_graph);
        squares += dived.pose_graph.0.fixed_rows::<3>(3).norm_squared();
        alone += dived.odometry.0.fixed_rows::<3>(3).norm_squared();
        let sigma = |one: &(Vector6<f64>, Matrix6<f64>)| one.1.fixed_view::<3, 3>(3, 3).trace();
        assert!(sigma(&dived.pose_graph) < sigma(&dived.odometry), "{seed}");
    }
    let mean = sum / draws as f64;
    assert!((mean - 6.0).abs() < 4.0 * (12.0 / draws as f64).sqrt(), "NEES {mean}");
    assert!(squares < 0.04 * alone, "{} against {}", (squares / draws as f64).sqrt(), (alone / draws as f64).sqrt());
}

#[test]
fn a_path_back_over_key_frames_ends_where_it_began() {
    returns(4, FEW);
}

#[test]
#[ignore = "long: 300 other grounds, 24 dives"]
fn key_frames_and_returns_in_many_draws() {
    rejected(300);
    returns(24, 2500);
}

#[test]
fn a_later_run_goes_on_in_the_pose_graph_of_an_earlier_one() {
    let (rig, settings) = (rig(), PoseGraphSettings { min_loop_distance: 1000.0, ..PoseGraphSettings::default() });
    let first = dive(100, FEW, &rig, &settings, None);
    assert_eq!(first.relocalized, 0, "its own key frames are below the minimum loop distance");
    let text = first.kept.text(&settings.recognition);
    let read = PoseGraph::read(std::path::Path::new("n"), &text, &settings.recognition).unwrap();
    let second = dive(101, FEW, &rig, &settings, Some(&read));
    assert!(second.relocalized >= 10, "{} recognised", second.relocalized);
    let sigma = |one: &(Vector6<f64>, Matrix6<f64>)| one.1.fixed_view::<3, 3>(3, 3).trace();
    assert!(sigma(&second.pose_graph) < 0.25 * sigma(&second.odometry));
    assert!(nees(&second.pose_graph) < 25.0, "{}", nees(&second.pose_graph));
}

#[test]
fn the_same_dive_gives_the_same_bytes() {
    let (rig, settings) = (rig(), PoseGraphSettings { min_loop_distance: 5.0, ..PoseGraphSettings::default() });
    let text = || dive(3, FEW, &rig, &settings, None).kept.text(&settings.recognition);
    assert!(text() == text());
}
