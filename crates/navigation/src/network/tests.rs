//! Key frames of a ground made of points: recognised where they are, refused where they are not, and closed.

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

use super::{Candidate, Glance, Here, Network, NetworkSettings, Recogniser, Recognition, Traverse, Unrecognised};
use crate::{Local, Navigated, Place, Standing};

/// Numbers of a descriptor.
const LENGTH: usize = 32;
/// Standard deviation of a pixel's coordinate (px).
const PX: f64 = 0.3;

fn even(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * f64::from(rng.next_u32()) / f64::from(u32::MAX)
}

/// A normal number from the sum of twelve even ones.
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

/// A piece of ground, each of its points with its looks.
struct Ground {
    points: Vec<(Point<World>, Vec<f32>)>,
}

impl Ground {
    fn new(rng: &mut ChaCha8Rng, count: usize, extent: [f64; 2]) -> Self {
        let points = (0..count).map(|_| {
            let (x, y) = (even(rng, -extent[0], extent[0]), even(rng, -extent[1], extent[1]));
            (Point::new(x, y, even(rng, -0.2, 0.2)), looks(rng))
        });
        Self { points: points.collect() }
    }

    /// What the rig sees of it from there.
    fn seen(&self, rng: &mut ChaCha8Rng, rig: &StereoRig, world_from_camera: &Transform<World, Camera>) -> Glance {
        let camera_from_world = world_from_camera.inverse();
        let (mut cloud, mut keypoints, mut rows) = (Vec::new(), Vec::new(), Vec::new());
        for (place, looks) in &self.points {
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
            rows.extend(looks.iter().map(|x| x + 0.02 * normal(rng) as f32));
        }
        let descriptors = Descriptors::Numbers(Table::new(LENGTH, rows));
        Glance { stamp_ns: rng.next_u64() >> 8, cloud, keypoints, descriptors }
    }
}

fn looks(rng: &mut ChaCha8Rng) -> Vec<f32> {
    let numbers: Vec<f64> = (0..LENGTH).map(|_| normal(rng)).collect();
    let norm = numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
    numbers.iter().map(|x| (x / norm) as f32).collect()
}

/// From above the origin, looking down.
fn above(x: f64, y: f64, heading: f64) -> Transform<World, Camera> {
    Transform::new(so3::exp(&Vector3::new(0.0, 0.0, heading)), Vector3::new(x, y, -3.5))
}

/// A prior that errs as it says.
fn prior(rng: &mut ChaCha8Rng, truth: &Transform<Camera, Camera>) -> Local {
    let covariance = Covariance6::isotropic(0.05, 0.3);
    Local::new(truth.perturbed(&normal6(rng, 0.05, 0.3)), covariance)
}

const NOTHING: fn(usize, usize) -> Option<Local> = |_, _| None;

#[test]
fn a_key_frame_is_found_again_from_another_side_and_errs_as_it_says() {
    let draws = 150;
    let (rig, settings) = (rig(), Recognition::default());
    let mut recogniser = Recogniser::new(&settings, &rig, Threads::One);
    let (mut found, mut nees) = (0, 0.0);
    for seed in 0..draws {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let ground = Ground::new(&mut rng, 150, [4.0, 3.0]);
        let (then, now) = (above(0.0, 0.0, 0.0), above(0.8, -0.5, 3.0).perturbed(&normal6(&mut rng, 0.05, 0.2)));
        let keyframe = ground.seen(&mut rng, &rig, &then).reduced();
        let glance = ground.seen(&mut rng, &rig, &now);
        let truth = then.inverse() * now;
        let prior = prior(&mut rng, &truth);
        if let Ok(one) = recogniser.recognise(&glance, &[Candidate { keyframe: &keyframe, prior }], NOTHING) {
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

/// So many pieces of other ground are refused.
fn refused(draws: u64) {
    let (rig, settings) = (rig(), Recognition::default());
    let mut recogniser = Recogniser::new(&settings, &rig, Threads::One);
    for seed in 0..draws {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let ground = Ground::new(&mut rng, 150, [4.0, 3.0]);
        let mut other = Ground::new(&mut rng, 150, [4.0, 3.0]);
        // Every other ground looks like this one, point for point, but the points lie otherwise.
        if seed % 2 == 0 {
            other.points.iter_mut().zip(&ground.points).for_each(|(other, (_, looks))| other.1.clone_from(looks));
        }
        let keyframe = ground.seen(&mut rng, &rig, &above(0.0, 0.0, 0.0)).reduced();
        let glance = other.seen(&mut rng, &rig, &above(0.2, 0.1, 0.4));
        let prior = prior(&mut rng, &(above(0.0, 0.0, 0.0).inverse() * above(0.2, 0.1, 0.4)));
        let told = recogniser.recognise(&glance, &[Candidate { keyframe: &keyframe, prior }], NOTHING);
        assert!(told.is_err(), "{seed}: {told:?}");
    }
}

#[test]
fn other_ground_is_refused() {
    refused(30);
}

#[test]
fn the_same_looks_elsewhere_contradict_what_is_known() {
    let (rig, settings) = (rig(), Recognition::default());
    let mut recogniser = Recogniser::new(&settings, &rig, Threads::One);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let ground = Ground::new(&mut rng, 150, [4.0, 3.0]);
    let keyframe = ground.seen(&mut rng, &rig, &above(0.0, 0.0, 0.0)).reduced();
    let glance = ground.seen(&mut rng, &rig, &above(0.0, 0.0, 0.0));
    let far = Local::new(Transform::exp(&[0.0, 0.0, 0.0, 3.0, 0.0, 0.0].into()), Covariance6::isotropic(0.05, 0.3));
    let near = Local::new(Transform::identity(), Covariance6::isotropic(0.05, 0.3));
    let at = |prior| Candidate { keyframe: &keyframe, prior };
    let told = recogniser.recognise(&glance, &[at(far)], NOTHING);
    assert!(matches!(told, Err(Unrecognised::Contradicts(_))), "{told:?}");
    assert_eq!(recogniser.recognise(&glance, &[], NOTHING), Err(Unrecognised::Nowhere));
    // Twice the same ground, a metre apart as far as is known: the camera cannot be over both.
    let apart = |a: usize, b: usize| {
        let x = a as f64 - b as f64;
        Some(Local::new(Transform::exp(&[0.0, 0.0, 0.0, x, 0.0, 0.0].into()), Covariance6::isotropic(1e-3, 1e-2)))
    };
    let told = recogniser.recognise(&glance, &[at(near), at(near)], apart);
    assert_eq!(told, Err(Unrecognised::Ambiguous(0, 1)));
    assert!(recogniser.recognise(&glance, &[at(near), at(near)], NOTHING).is_ok());
}

/// Forty half metres out and back again, one fix at the beginning: the last pose, its error and covariance as the network
/// and as odometry alone have them, and how many key frames were laid and found again.
struct Dived {
    network: (Vector6<f64>, Matrix6<f64>),
    odometry: (Vector6<f64>, Matrix6<f64>),
    laid: usize,
    refound: usize,
    kept: Network,
}

const STEP: (f64, f64) = (1e-3, 5e-3);
const FIX: (f64, f64) = (1e-3, 5e-3);
/// Points of the ground: few are quick.
const FEW: usize = 1000;

fn dive(seed: u64, points: usize, rig: &StereoRig, settings: &NetworkSettings, earlier: Option<&Network>) -> Dived {
    let mut ground_rng = ChaCha8Rng::seed_from_u64(55);
    let ground = Ground::new(&mut ground_rng, points, [18.0, 6.0]);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let world_from_object = Transform::<World, Object>::exp(&[0.0, 0.0, 0.5, -12.0, 1.0, 0.0].into());
    let place = Place { world_from_object, covariance: Covariance6::isotropic(1e-3, 1e-3) };
    let mut network = earlier.cloned().unwrap_or_else(|| Network::new(vec![("box".to_owned(), place)]));
    if earlier.is_some() {
        network.objects[0].1 = place;
    }
    let mut traverse = Traverse::begin(settings, network, rig, Threads::One);
    let way: Vec<Transform<World, Camera>> = (0..=80)
        .map(|k| {
            let (out, x) = (k <= 40, if k <= 40 { k } else { 80 - k });
            above(-10.0 + 0.5 * f64::from(x), 0.0, if out { 0.0 } else { std::f64::consts::PI })
        })
        .collect();
    let truth = world_from_object.inverse() * way[0];
    let fix = Standing::new(truth.perturbed(&-normal6(&mut rng, FIX.0, FIX.1)), Covariance6::isotropic(FIX.0, FIX.1));
    let mut known = Navigated { object: 0, standing: fix.clone() };
    let mut alone = fix;
    let (mut laid, mut refound) = (0, 0);
    for (k, world_from_camera) in way.iter().enumerate() {
        if k > 0 {
            let motion = way[k - 1].inverse() * *world_from_camera;
            let step = Local::new(
                motion.perturbed(&-normal6(&mut rng, STEP.0, STEP.1)),
                Covariance6::isotropic(STEP.0, STEP.1),
            );
            traverse.advance(2.0, Some(&step));
            known = known.after(&step);
            alone = alone.after(&step);
        }
        let stamp_ns = 1 + k as u64 * 2_000_000_000;
        let here = Here { stamp_ns, navigated: Some(known.clone()), rough: None };
        let fixes: &[Navigated] = if k == 0 { std::slice::from_ref(&known) } else { &[] };
        let closure = traverse.visit_by(&here, fixes, |_| ground.seen(&mut rng, rig, world_from_camera));
        laid += usize::from(closure.laid.is_some());
        if let Some(Ok(found)) = closure.sought {
            refound += 1;
            known = found.navigated.unwrap_or(known);
        }
    }
    let last = world_from_object.inverse() * *way.last().unwrap();
    let told = |standing: &Standing| (standing.object_from_camera.error_to(&last), standing.covariance.matrix);
    Dived { network: told(&known.standing), odometry: told(&alone), laid, refound, kept: traverse.finish() }
}

fn nees((error, covariance): &(Vector6<f64>, Matrix6<f64>)) -> f64 {
    error.dot(&(covariance.try_inverse().unwrap() * error))
}

/// So many ways back over key frames end where they began, and err as they say.
///
/// Seen to fail when the motion from a key frame is 5 cm off.
fn ways_back(draws: u64, points: usize) {
    let (rig, settings) = (rig(), NetworkSettings { apart: 5.0, ..NetworkSettings::default() });
    let (mut sum, mut squares, mut alone) = (0.0, 0.0, 0.0);
    for seed in 0..draws {
        let dived = dive(seed, points, &rig, &settings, None);
        assert!((4..=12).contains(&dived.laid), "{seed}: {} laid", dived.laid);
        assert!(dived.refound >= 5, "{seed}: {} found again", dived.refound);
        sum += nees(&dived.network);
        squares += dived.network.0.fixed_rows::<3>(3).norm_squared();
        alone += dived.odometry.0.fixed_rows::<3>(3).norm_squared();
        let sigma = |one: &(Vector6<f64>, Matrix6<f64>)| one.1.fixed_view::<3, 3>(3, 3).trace();
        assert!(sigma(&dived.network) < sigma(&dived.odometry), "{seed}");
    }
    let mean = sum / draws as f64;
    assert!((mean - 6.0).abs() < 4.0 * (12.0 / draws as f64).sqrt(), "NEES {mean}");
    assert!(squares < 0.04 * alone, "{} against {}", (squares / draws as f64).sqrt(), (alone / draws as f64).sqrt());
}

#[test]
fn a_way_back_over_key_frames_ends_where_it_began() {
    ways_back(4, FEW);
}

#[test]
#[ignore = "long: 300 pieces of other ground, 24 dives"]
fn key_frames_and_ways_back_in_many_draws() {
    refused(300);
    ways_back(24, 2500);
}

#[test]
fn a_later_run_goes_on_in_the_network_of_an_earlier_one() {
    let (rig, settings) = (rig(), NetworkSettings { apart: 1000.0, ..NetworkSettings::default() });
    let first = dive(100, FEW, &rig, &settings, None);
    assert_eq!(first.refound, 0, "all of its own key frames are too young");
    let text = first.kept.text(&settings.recognition);
    let read = Network::read(std::path::Path::new("n"), &text, &settings.recognition).unwrap();
    let second = dive(101, FEW, &rig, &settings, Some(&read));
    assert!(second.refound >= 10, "{} found again", second.refound);
    let sigma = |one: &(Vector6<f64>, Matrix6<f64>)| one.1.fixed_view::<3, 3>(3, 3).trace();
    assert!(sigma(&second.network) < 0.25 * sigma(&second.odometry));
    assert!(nees(&second.network) < 25.0, "{}", nees(&second.network));
}

#[test]
fn the_same_dive_gives_the_same_bytes() {
    let (rig, settings) = (rig(), NetworkSettings { apart: 5.0, ..NetworkSettings::default() });
    let text = || dive(3, FEW, &rig, &settings, None).kept.text(&settings.recognition);
    assert!(text() == text());
}
