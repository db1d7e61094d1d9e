//! What every odometry owes that goes by readings of a Doppler log and a gyro.

use std::{path::Path, sync::LazyLock};

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use proptest::prelude::*;
use seafix_component::Choice;
use seafix_geometry::{Body, Camera, Covariance6, Object, Pinhole, StereoRig, Transform};
use seafix_navigation::{
    Device, Lost, ODOMETRIES, ObjectPlacement, ObjectPose, Odometry, OdometryEdge, OdometryOutcome, PoseGraph,
    PoseNode, PriorPose, Reading, RelativeMotion, StereoPair, Waypoint,
};
use seafix_proptests::{cases, law, poses::pose, within};
use seafix_simulation::{Mission, Purpose, Stream, vehicle::Current};
use seafix_vision::{Image, Threads};

const SECOND: u64 = 1_000_000_000;
/// When the first pair is taken.
const START: u64 = 100 * SECOND;

/// The odometries that go by readings.
fn listening() -> Vec<(&'static str, Box<dyn Odometry>)> {
    let built = |name| (name, ODOMETRIES.build(&Choice::named(name)).unwrap());
    ODOMETRIES.names().map(built).filter(|(_, odometry)| odometry.listens()).collect()
}

fn rig() -> StereoRig {
    let camera = Pinhole::new([16, 16], [20.0; 2], [7.5; 2], &[]).unwrap();
    StereoRig::new(camera, camera, Transform::new(Default::default(), -Vector3::x())).unwrap()
}

/// An odometry at work on pairs that show nothing.
struct Journeying<'a> {
    session: Box<dyn seafix_navigation::OdometrySession + 'a>,
    image: Image,
}

impl<'a> Journeying<'a> {
    fn new(odometry: &'a dyn Odometry, rig: &'a StereoRig, body_from_camera: Transform<Body, Camera>) -> Self {
        let image = Image::new(16, 16, vec![0.0; 256]).unwrap();
        Self { session: odometry.begin(rig, body_from_camera, Threads::One), image }
    }

    fn deliver(&mut self, readings: &[Reading]) {
        readings.iter().for_each(|reading| self.session.sense(reading));
    }

    fn pair(&mut self, stamp_ns: u64) -> OdometryOutcome {
        self.session.advance(&StereoPair { stamp_ns, left: &self.image, right: &self.image }).unwrap()
    }

    fn latest(&self) -> Waypoint {
        self.session.latest().unwrap().1
    }
}

fn reading(device: Device, stamp_ns: u64, value: Vector3<f64>, sigma: f64) -> Reading {
    Reading { device, stamp_ns, value, covariance: Matrix3::identity() * (sigma * sigma) }
}

/// Rate of turn and velocity of a vehicle that rolls, pitches, turns and heaves, at a time (s).
fn twist(t: f64) -> Vector6<f64> {
    let rate = Vector3::new(0.1 * t.sin(), 0.15 * (0.7 * t).cos(), 0.3 * (0.5 * t).sin());
    let velocity = Vector3::new(0.5 + 0.2 * (0.8 * t).sin(), 0.1 * t.cos(), 0.05 * (1.3 * t).sin());
    Vector6::new(rate.x, rate.y, rate.z, velocity.x, velocity.y, velocity.z)
}

/// The body after `seconds` in the frame that it began with, by steps a thousand times finer than any sensor's.
fn true_path(seconds: f64) -> Transform<Body, Body> {
    let steps = (seconds * 5000.0).round() as usize;
    let h = seconds / steps as f64;
    (0..steps).fold(Transform::identity(), |here, k| {
        (here * Transform::<Body, Body>::exp(&(twist((k as f64 + 0.5) * h) * h))).renormalized()
    })
}

/// What both devices say at a time after the start (ns), the log at `at`.
fn exact(after: u64, at: &Vector3<f64>) -> [Reading; 2] {
    let said = twist(after as f64 * 1e-9);
    let (rate, velocity) = (said.fixed_rows::<3>(0).into_owned(), said.fixed_rows::<3>(3).into_owned());
    [
        reading(Device::Doppler, START + after, velocity + rate.cross(at), 0.0),
        reading(Device::Gyro, START + after, rate, 0.0),
    ]
}

/// Exact readings give the way back, to an error that falls with the square of the time between them, wherever the log and
/// the camera sit in the vehicle.
///
/// Seen to fail when the value at the beginning of a stretch stands for it.
#[test]
fn exact_readings_give_the_path_back() {
    let (rig, truth) = (rig(), true_path(8.0));
    law(6, (pose::<Body, Camera>(1.0), proptest::array::uniform3(-1.0..1.0)), |(body_from_camera, at)| {
        let odometry = ODOMETRIES.build(&Choice::named("dvl-gyro").with("at", at.to_vec())).unwrap();
        let expected = body_from_camera.inverse() * truth * body_from_camera;
        let errors = [200, 100, 50].map(|ms: u64| {
            let mut trajectory = Journeying::new(&*odometry, &rig, body_from_camera);
            for step in 0..=8000 / ms {
                trajectory.deliver(&exact(step * ms * 1_000_000, &at.into()));
                trajectory.pair(START + step * ms * 1_000_000);
            }
            let found: Transform<Camera, Camera> = trajectory.latest().world_from_camera.relabel();
            found.error_to(&expected).norm()
        });
        prop_assert!(errors[2] < 2e-3, "{errors:?}");
        for ratio in [errors[0] / errors[1], errors[1] / errors[2]] {
            prop_assert!((3.6..4.4).contains(&ratio), "{errors:?}");
        }
        Ok(())
    });
}

/// The steps chain to the pose, and readings that come late, in whatever order, lead to the pose that they would have led
/// to in time.
///
/// Seen to fail when late readings go to the end of the list.
#[test]
fn late_readings_are_put_in_order() {
    let rig = rig();
    let delays = prop::collection::vec(0_u64..900, 2 * 61);
    law(16, (pose::<Body, Camera>(1.0), delays), |(body_from_camera, delays)| {
        for (name, odometry) in listening() {
            let mut all: Vec<(u64, Reading)> = Vec::new();
            for step in 0..=60 {
                all.extend(exact(step * 100_000_000, &Vector3::zeros()).map(|reading| (reading.stamp_ns, reading)));
            }
            let travel = |all: &[(u64, Reading)]| {
                let mut trajectory = Journeying::new(&*odometry, &rig, body_from_camera);
                let mut chained = Transform::<Camera, Camera>::identity();
                for pair in 0..=70 {
                    let now = START + pair * 100_000_000;
                    let reported = |arrival: u64| arrival <= now && (pair == 0 || arrival + 100_000_000 > now);
                    let new: Vec<Reading> =
                        all.iter().filter(|(arrival, _)| reported(*arrival)).map(|one| one.1).collect();
                    trajectory.deliver(&new);
                    if let OdometryOutcome::Followed { .. } = trajectory.pair(now) {
                        chained = chained * trajectory.latest().local.unwrap().motion;
                    }
                }
                (trajectory.latest().world_from_camera.relabel(), chained)
            };
            let (in_time, _) = travel(&all);
            all.iter_mut().zip(&delays).for_each(|(one, ms)| one.0 += ms * 1_000_000);
            all.sort_by_key(|(arrival, _)| *arrival);
            let (late, chained): (Transform<Camera, Camera>, _) = travel(&all);
            within(name, late.error_to(&in_time).norm(), 1e-9)?;
            within(name, late.error_to(&chained).norm(), 1e-9)?;
        }
        Ok(())
    });
}

/// B59: no odometry by readings invents a motion. Nothing said, or nothing that a vehicle does, is a pair left out; when the
/// device is heard again after too long, a segment begins where the last one ended. Bad stamps are refused.
///
/// Seen to fail when the silence behind the last reading is not counted.
#[test]
fn no_odometry_by_readings_invents_a_motion() {
    let rig = rig();
    let wild = Vector3::new(300.0, 0.0, 0.0);
    for (name, odometry) in listening() {
        for (silent, other) in [(Device::Doppler, Device::Gyro), (Device::Gyro, Device::Doppler)] {
            for value in [None, Some(wild), Some(Vector3::repeat(f64::NAN)), Some(Vector3::new(0.01, 0.0, 0.0))] {
                let mut trajectory = Journeying::new(&*odometry, &rig, Transform::identity());
                let mut outcomes = Vec::new();
                for step in 0..100_u64 {
                    let stamp = START + step * 100_000_000;
                    let noise = 1e-3 * (step as f64).sin();
                    let sane = Vector3::new(0.3 + noise, noise, 0.0);
                    trajectory.deliver(&[reading(other, stamp, sane * 0.1, 1e-3)]);
                    // For five seconds the device is silent, or says what cannot be: too much, or the same again and again.
                    let said = if (20..70).contains(&step) { value } else { Some(sane) };
                    trajectory
                        .deliver(&said.map(|said| reading(silent, stamp, said, 1e-3)).into_iter().collect::<Vec<_>>());
                    outcomes.push(trajectory.pair(stamp));
                }
                let lost = |outcome: &OdometryOutcome| matches!(outcome, OdometryOutcome::Skipped(Lost::Silent { device, .. }) if *device == silent);
                let first = outcomes.iter().position(lost).unwrap();
                assert!((39..=41).contains(&first), "{name}, {silent}, {value:?}: {first}");
                let began: Vec<usize> = (0..100).filter(|&k| outcomes[k] == OdometryOutcome::Began).collect();
                assert_eq!(began, [0, 70], "{name}, {silent}, {value:?}");
                assert!(outcomes[first..70].iter().all(lost), "{name}, {silent}, {value:?}");
                let all = trajectory.session.trajectory();
                let (before, after) = (&all.segments[0], &all.segments[1]);
                assert!(matches!(after.broken, Some(Lost::Silent { .. })) && after.poses[0].local.is_none(), "{name}");
                let end = before.poses.last().unwrap().world_from_camera;
                assert_eq!(after.poses[0].world_from_camera, end, "{name}: the motion between is left out");
                let poses = before.poses.len();
                for stamp in [START, START + 99 * 100_000_000] {
                    let pair = StereoPair { stamp_ns: stamp, left: &trajectory.image, right: &trajectory.image };
                    assert!(trajectory.session.advance(&pair).is_err(), "{name}");
                }
                assert_eq!(trajectory.session.trajectory().segments[0].poses.len(), poses, "{name}");
            }
        }
        let mut deaf = Journeying::new(&*odometry, &rig, Transform::identity());
        assert_eq!(deaf.pair(START), OdometryOutcome::Began);
        assert!(
            (1..50).all(|k| matches!(deaf.pair(START + k * SECOND), OdometryOutcome::Skipped(Lost::Silent { .. }))),
            "{name}"
        );
    }
}

/// Where the camera was at each pair of a dive, and the motions to all but the first.
type Dived = (Vec<Transform<Object, Camera>>, Vec<RelativeMotion>);

/// What an odometry by readings tells of dives with the sensors' usual errors: of a steady vehicle, and of one that turns a corner
/// in a current, which wanders as the defaults say.
struct Dives {
    name: &'static str,
    steady: Vec<Dived>,
    pushed: Vec<Dived>,
}

/// As many of each as the bounds below are for.
static DIVES: LazyLock<Vec<Dives>> = LazyLock::new(|| {
    let mission = |frames| Mission { as_points: true, frames, rate: 5.0, ..Mission::default() };
    let current = Current { speed: 0.2, sigma: 0.05, tau: 10.0, ..Current::default() };
    let (steady, pushed) = (mission(141), Mission { current, start: 20.0, ..mission(201) });
    let all = |odometry: &dyn Odometry, mission: &Mission| {
        (0..cases(60).into()).map(|dive| dived(odometry, mission, dive)).collect()
    };
    let of = |(name, odometry): (&'static str, Box<dyn Odometry>)| {
        let reported = match name {
            "dvl-gyro" => Choice::named(name).with("unsteady", 0.003).with("unsteady-turn-deg", 0.05),
            _ => Choice::named(name),
        };
        let calm = ODOMETRIES.build(&reported).unwrap();
        Dives { name, steady: all(&*calm, &steady), pushed: all(&*odometry, &pushed) }
    };
    listening().into_iter().map(of).collect()
});

fn dived(odometry: &dyn Odometry, mission: &Mission, dive: u64) -> Dived {
    let planned = mission.plan(7, dive, Path::new("")).unwrap();
    let said = planned.readings();
    let sensors = &mission.sensors;
    let stamped = |arrival: f64, device, time: f64, value, sigma| {
        (planned.stamp(arrival), reading(device, planned.stamp(time), value, sigma))
    };
    let doppler = said.doppler.iter();
    let doppler = doppler.map(|r| stamped(r.arrival, Device::Doppler, r.time, r.value, sensors.doppler.sigma));
    let gyro = said.attitude.iter();
    let gyro = gyro.map(|r| stamped(r.arrival, Device::Gyro, r.time, r.value.rate, sensors.attitude.rate_sigma()));
    let mut readings: Vec<(u64, Reading)> = doppler.chain(gyro).collect();
    readings.sort_by_key(|(arrival, reading)| (*arrival, reading.stamp_ns));

    let mut trajectory = Journeying::new(odometry, planned.rig(), planned.body_from_camera());
    let (mut true_path, mut steps, mut reported) = (Vec::new(), Vec::new(), 0);
    for pair in 0..mission.frames {
        let instant = planned.instant(pair);
        let stamp = instant.stamp_ns;
        let now = readings.partition_point(|(arrival, _)| *arrival <= stamp);
        readings[reported..now].iter().for_each(|(_, reading)| trajectory.session.sense(reading));
        reported = now;
        let outcome = trajectory.pair(stamp);
        true_path.push(instant.truth().world_from_camera.relabel());
        if pair > 0 {
            assert!(matches!(outcome, OdometryOutcome::Followed { .. }), "dive {dive}, pair {pair}: {outcome:?}");
            steps.push(trajectory.latest().local.unwrap());
        }
    }
    (true_path, steps)
}

/// ξᵀ Σ⁻¹ ξ.
fn nees(error: &Vector6<f64>, covariance: &Matrix6<f64>) -> f64 {
    error.dot(&covariance.cholesky().unwrap().solve(error))
}

/// The normalised error squared of the pose after the motions of the dives, at some pairs of each: the means.
fn consistency(dives: &[Dived], at: &[usize]) -> Vec<f64> {
    let mean = |pair: usize| {
        let error = |(true_path, steps): &Dived| {
            let start = ObjectPose::new(true_path[0], Covariance6::isotropic(1e-9, 1e-9));
            let there = start.after_all(&steps[..pair]);
            nees(&there.object_from_camera.error_to(&true_path[pair]), &there.covariance.matrix)
        };
        dives.iter().map(error).sum::<f64>() / dives.len() as f64
    };
    at.iter().map(|&pair| mean(pair)).collect()
}

/// Four standard errors of the mean of so many χ² of six degrees of freedom.
fn nees_bound(dives: &[Dived]) -> f64 {
    4.0 * (12.0 / dives.len() as f64).sqrt()
}

/// The motion since the first pair errs as its covariance says, after half a second, eight seconds and more: noise, scale and
/// bias, late readings, what is held until they come, and what velocity and rate do between them. The mean NEES of six degrees of freedom lies within
/// four of its standard errors of 6.
///
/// Seen to fail when errors that last count as errors of each step alone.
#[test]
fn dead_integrated_motions_are_consistent() {
    for Dives { name, steady, pushed } in &*DIVES {
        let all = [consistency(steady, &[3, 40, 100]), consistency(pushed, &[3, 40, 100, 200])];
        println!("{name}: {all:.2?}");
        assert!(all.iter().flatten().all(|mean| (mean - 6.0).abs() < nees_bound(steady)), "{name}: {all:?}");
    }
}

/// A network of dead-reckoned legs, five pairs each, over 20 s, with a pose from elsewhere at its beginning and after a
/// quarter, which tell scale and bias for the rest: the mean NEES of every station; of the motion across half of the legs;
/// of the pose that further steps, for 8 s, lead to from the last station.
fn median_network_means(dives: &[Dived]) -> (Vec<f64>, [f64; 2]) {
    const EDGE_STEPS: usize = 5;
    const EDGES: usize = 20;
    const FURTHER: usize = 40;
    const KNOWN: (f64, f64) = (2e-4, 1e-3);
    let mut pose_nodes = vec![0.0; EDGES + 1];
    let (mut across, mut further) = (0.0, 0.0);
    let count = dives.len() as f64;
    for (dive, (true_path, steps)) in dives.iter().enumerate() {
        let mut stream = Stream::new(7, dive as u64, 0, Purpose::Prior);
        let place =
            ObjectPlacement { world_from_object: Transform::identity(), covariance: Covariance6::isotropic(0.0, 0.0) };
        let mut pose_graph = PoseGraph::new(vec![("origin".to_owned(), place)]);
        for number in 0..=EDGES {
            let world_from_camera = true_path[number * EDGE_STEPS].relabel();
            let stamp_ns = 1 + number as u64;
            pose_graph.add_node(PoseNode { stamp_ns, world_from_camera, sigma: 1.0, keyframe: None });
            if number > 0 {
                let (first, others) = steps[(number - 1) * EDGE_STEPS..number * EDGE_STEPS].split_first().unwrap();
                let motion = others.iter().fold(*first, |odometry_edge, step| odometry_edge.then(step));
                pose_graph.odometry_edges.push(OdometryEdge { from: number - 1, to: number, motion });
            }
            if number == 0 || number == EDGES / 4 {
                let noise = Vector6::from_fn(|k, _| stream.normal() * if k < 3 { KNOWN.0 } else { KNOWN.1 });
                // T_true = T_est · Exp(ξ).
                let world_from_camera = world_from_camera.perturbed(&-noise);
                let covariance = Covariance6::isotropic(KNOWN.0, KNOWN.1);
                pose_graph.prior_poses.push(PriorPose { pose_node: number, world_from_camera, covariance });
            }
        }
        let closed = pose_graph.solve().unwrap();
        for (number, sum) in pose_nodes.iter_mut().enumerate() {
            let error = closed.pose_node(number).error_to(&true_path[number * EDGE_STEPS].relabel());
            *sum += nees(&error, &closed.covariance(number).matrix) / count;
        }
        let (from, to) = (EDGES / 4, 3 * EDGES / 4);
        let motion = closed.relative(from, to).unwrap();
        let truth = true_path[from * EDGE_STEPS].inverse() * true_path[to * EDGE_STEPS];
        across += nees(&motion.motion.error_to(&truth), &motion.covariance.matrix) / count;
        let there = closed.navigated(0, EDGES).unwrap().object_pose.after_all(&steps[EDGES * EDGE_STEPS..][..FURTHER]);
        further += nees(
            &there.object_from_camera.error_to(&true_path[EDGES * EDGE_STEPS + FURTHER]),
            &there.covariance.matrix,
        ) / count;
    }
    (pose_nodes, [across, further])
}

/// A network whose legs are dead reckoned says how well it knows its poses: over dives of a steady vehicle the mean NEES of
/// every station, that of the motion across half of its legs, and that of the pose that goes on from it lie within four
/// standard errors of 6; where a current pushes it through corners, which are no random walk, that of all stations
/// together.
///
/// Seen to fail when legs are taken as independent of each other, and when a pose of the network shares nothing with the
/// steps that follow.
#[test]
fn pose_graphs_over_dead_reckoning_are_consistent() {
    for Dives { name, steady, pushed } in &*DIVES {
        let (pose_nodes, [across, further]) = median_network_means(steady);
        let (driven, _) = median_network_means(pushed);
        println!("{name}: {pose_nodes:.2?} {across:.2} {further:.2}; {driven:.2?}");
        let driven = driven.iter().sum::<f64>() / driven.len() as f64;
        for mean in pose_nodes.into_iter().chain([across, further, driven]) {
            assert!((mean - 6.0).abs() < nees_bound(steady), "{name}: {mean:.2}");
        }
    }
}
