//! One point far from the others: what it seems to say of the pose is only as good as it is the right one.

#![allow(clippy::print_stdout, reason = "a law prints its counts")]

use nalgebra::Vector3;
use seafix_geometry::{Camera, MeasuredPoint, Object, Point, Transform, UncertainPoint, so3};
use seafix_referencing::{
    Acceptance, Candidates, Mahalanobis, ModelPoint, Outcome, Prior, PriorBound, Problem, Refusal, RigidConsensus,
    Tolerance, candidates, reference, rms_apart,
};
use seafix_simulation::{Purpose, Stream};

const SIGMA: f64 = 0.005;
const SHELL: f64 = 0.3;

fn anywhere(stream: &mut Stream, half: [f64; 3]) -> Vector3<f64> {
    Vector3::from(half.map(|half| stream.between(-half, half)))
}

/// A panel of ten points, 30 cm wide, on an object of three metres with forty more; of the panel eight points are seen, of the rest of
/// the object `far`, and 200 points of clutter about the panel, two metres before the camera. With a rough pose or without.
struct Scene {
    model: Vec<ModelPoint>,
    cloud: Vec<MeasuredPoint>,
    truth: Transform<Object, Camera>,
    prior: Option<Prior>,
}

impl Scene {
    fn drawn(number: u64, far: usize, prior: bool) -> Self {
        let mut stream = Stream::new(number, 0, 0, Purpose::View);
        let middle = anywhere(&mut stream, [0.75; 3]);
        let mut at: Vec<Vector3<f64>> = (0..10).map(|_| middle + anywhere(&mut stream, [0.15, 0.15, 0.045])).collect();
        at.extend((0..40).map(|_| anywhere(&mut stream, [1.5; 3])));
        let turn = so3::exp(&(stream.normal3(1.0).normalize() * stream.between(0.0, 3.1)));
        let camera_from_object = Transform::<Camera, Object>::new(turn, Vector3::z() * 2.0 - turn * middle);
        let seen = (0..8).chain(10..10 + far);
        let mut cloud: Vec<Vector3<f64>> =
            seen.map(|i| (camera_from_object * Point::from(at[i])).coords + stream.normal3(SIGMA)).collect();
        let clutter = if prior { 200 } else { 100 };
        cloud.extend((0..clutter).map(|_| Vector3::z() * 2.0 + anywhere(&mut stream, [1.2; 3])));
        let measured =
            |at: Vector3<f64>| MeasuredPoint { position: UncertainPoint::isotropic(at.into(), SIGMA), pixels: None };
        let model = at.into_iter().enumerate().map(|(i, at)| ModelPoint::exact(format!("p{i}"), Point::from(at)));
        let model: Vec<ModelPoint> = model.collect();
        let prior = prior.then(|| {
            loop {
                let turned = so3::exp(&stream.normal3(0.02)) * turn;
                let moved = camera_from_object.translation() + anywhere(&mut stream, [0.5 * SHELL; 3]);
                let rough = Transform::<Camera, Object>::new(turned, moved);
                let off = |point: &ModelPoint| (rough * point.at - camera_from_object * point.at).amax();
                if model.iter().all(|point| off(point) <= SHELL) {
                    break Prior { object_from_camera: rough.inverse(), bound: PriorBound::Box(SHELL) };
                }
            }
        });
        Self { model, cloud: cloud.into_iter().map(measured).collect(), truth: camera_from_object.inverse(), prior }
    }

    fn outcome(&self) -> Outcome {
        let Self { model, cloud, prior, .. } = self;
        let lists = match prior {
            Some(prior) => candidates(model, cloud, Some(prior), &Default::default(), None),
            None => Candidates::all(model.len(), cloud.len()),
        };
        let tolerance = Tolerance::Fixed(4.0 * SIGMA);
        let problem = Problem { model, cloud, candidates: &lists, tolerance, prior: prior.as_ref() };
        let mut stream = Stream::new(0, 0, 0, Purpose::View);
        let (search, solver) = (RigidConsensus::default(), Mahalanobis::default());
        reference(&problem, &search, &solver, &Acceptance::default(), None, stream.rng()).outcome
    }
}

/// A panel alone does not say where the far points of its object are, and clutter that is near one of them does not either: no pose
/// off by more than the alert limit is believed; 150 frames with a rough pose and 50 without, or `LEVERAGE_FRAMES` each.
///
/// Seen to fail where the covariance of all points decides: 12 of 107 fixes with a rough pose are beyond.
#[test]
fn one_accidental_far_point_makes_no_pose() {
    let frames = |default: u64| std::env::var("LEVERAGE_FRAMES").map_or(default, |n| n.parse().expect("a number"));
    for (prior, frames) in [(true, frames(150)), (false, frames(50))] {
        let (mut answered, mut beyond, mut hinges) = (0, 0, 0);
        for number in 0..frames {
            let scene = Scene::drawn(number, 0, prior);
            match scene.outcome() {
                Outcome::Referenced(fix) => {
                    answered += 1;
                    let off = rms_apart(&scene.model, &fix.object_from_camera, &scene.truth);
                    beyond += u64::from(off > Acceptance::default().alert_limit);
                }
                Outcome::Unidentified(Refusal::Hinge { .. }) => hinges += 1,
                _ => {}
            }
        }
        println!("prior {prior}: {answered} of {frames} answered, {beyond} beyond the limit, {hinges} hang on a point");
        assert!(10 * hinges > frames, "too few to tell");
        assert_eq!(beyond, 0);
    }
}

/// Points of all the object are evidence of where it is, and none of them is missed much.
///
/// Seen to fail where every pose is taken to hang on a point.
#[test]
fn far_points_that_bear_each_other_out_make_one() {
    let off = |number: u64| {
        let scene = Scene::drawn(number, 6, true);
        match scene.outcome() {
            Outcome::Referenced(fix) => Some(rms_apart(&scene.model, &fix.object_from_camera, &scene.truth)),
            _ => None,
        }
    };
    let found: Vec<f64> = (0..30).filter_map(off).collect();
    println!("{} of 30 answered", found.len());
    assert!(found.len() >= 27 && found.iter().all(|&off| off < 0.03), "{found:?}");
}
