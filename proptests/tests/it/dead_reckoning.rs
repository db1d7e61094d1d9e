//! Laws of every odometry by readings of a Doppler log and a gyro.

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
/// The time of the first pair.
const START: u64 = 100 * SECOND;

/// The odometries by readings.
fn listening() -> Vec<(&'static str, Box<dyn Odometry>)> {
    let built = |name| (name, ODOMETRIES.build(&Choice::named(name)).unwrap());
    ODOMETRIES.names().map(built).filter(|(_, odometry)| odometry.needs_readings()).collect()
}

fn rig() -> StereoRig {
    let camera = Pinhole::new([16, 16], [20.0; 2], [7.5; 2], &[]).unwrap();
    StereoRig::new(camera, camera, Transform::new(Default::default(), -Vector3::x())).unwrap()
}

/// An odometry session with uniform images.
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

/// Rate of turn and velocity of a vehicle that rolls, pitches, yaws and heaves, at a time (s).
fn twist(t: f64) -> Vector6<f64> {
    let rate = Vector3::new(0.1 * t.sin(), 0.15 * (0.7 * t).cos(), 0.3 * (0.5 * t).sin());
    let velocity = Vector3::new(0.5 + 0.2 * (0.8 * t).sin(), 0.1 * t.cos(), 0.05 * (1.3 * t).sin());
    Vector6::new(rate.x, rate.y, rate.z, velocity.x, velocity.y, velocity.z)
}

/// The body after `seconds` in its initial frame, by steps a thousand times finer than any sensor's.
fn true_path(seconds: f64) -> Transform<Body, Body> {
    let steps = (seconds * 5000.0).round() as usize;
    let h = seconds / steps as f64;
    (0..steps).fold(Transform::identity(), |here, k| {
        (here * Transform::<Body, Body>::exp(&(twist((k as f64 + 0.5) * h) * h))).renormalized()
    })
}

/// The readings of both devices at a time after the start (ns), with the log at `at`.
fn exact(after: u64, at: &Vector3<f64>) -> [Reading; 2] {
    let message = twist(after as f64 * 1e-9);
    let (rate, velocity) = (message.fixed_rows::<3>(0).into_owned(), message.fixed_rows::<3>(3).into_owned());
    [
        reading(Device::Doppler, START + after, velocity + rate.cross(at), 0.0),
        reading(Device::Gyro, START + after, rate, 0.0),
    ]
}

/// Exact readings give the trajectory, with an error that falls with the square of their interval, for any position of
/// log and camera in the vehicle.
///
/// Seen to fail when the initial value of an interval replaces its mean.
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

/// The steps chain to the pose, and late readings in any order lead to the same pose as timely ones.
///
/// Seen to fail when late readings are appended to the list.
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

/// B59: no odometry by readings invents a motion. A pair without readings, or with impossible ones, is skipped; after
/// too long a silence a segment starts where the last one ended. Invalid stamps are rejected.
/// Seen to fail when the silence after the last reading is ignored.
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
                    // For five seconds the device is silent, or its readings are invalid: too large, or frozen.
                    let message = if (20..70).contains(&step) { value } else { Some(sane) };
                    trajectory.deliver(
                        &message.map(|message| reading(silent, stamp, message, 1e-3)).into_iter().collect::<Vec<_>>(),
                    );
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
                assert_eq!(after.poses[0].world_from_camera, end, "{name}: the motion between is unknown");
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

/// The camera's poses at the pairs of a dive, and the motions to all but the first.
type Dived = (Vec<Transform<Object, Camera>>, Vec<RelativeMotion>);

/// The results of an odometry by readings over dives with the sensors' usual errors: of a steady vehicle, and of one
/// that turns a corner in a current, whose errors vary as by the defaults.
struct Dives {
    name: &'static str,
    steady: Vec<Dived>,
    pushed: Vec<Dived>,
}

/// The numbers of both that the bounds below assume.
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
    let message = planned.readings();
    let sensors = &mission.sensors;
    let stamped = |arrival: f64, device, time: f64, value, sigma| {
        (planned.stamp(arrival), reading(device, planned.stamp(time), value, sigma))
    };
    let doppler = message.doppler.iter();
    let doppler = doppler.map(|r| stamped(r.arrival, Device::Doppler, r.time, r.value, sensors.doppler.sigma));
    let gyro = message.attitude.iter();
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

/// The mean normalised estimation error squared of the pose after the motions of the dives, at some pairs of each.
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

/// Four standard errors of a mean of χ² of six degrees of freedom.
fn nees_bound(dives: &[Dived]) -> f64 {
    4.0 * (12.0 / dives.len() as f64).sqrt()
}

/// The motion since the first pair has consistent errors after half a second, eight seconds and more: noise, scale and
/// bias, late readings, held values, and changes of velocity and rate between readings. The mean NEES of six degrees of
/// freedom is within four of its standard errors of 6.
///
/// Seen to fail when correlated errors count as independent errors of each step.
#[test]
fn dead_integrated_motions_are_consistent() {
    for Dives { name, steady, pushed } in &*DIVES {
        let all = [consistency(steady, &[3, 40, 100]), consistency(pushed, &[3, 40, 100, 200])];
        println!("{name}: {all:.2?}");
        assert!(all.iter().flatten().all(|mean| (mean - 6.0).abs() < nees_bound(steady)), "{name}: {all:?}");
    }
}

/// A pose graph of dead-reckoned edges, five pairs each, over 20 s, with a prior pose at the start and after a quarter,
/// which determine scale and bias for the rest. Its results are the mean NEES of every node, of the motion over half of
/// the edges, and of the pose after further steps of 8 s from the last node.
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

/// A pose graph of dead-reckoned edges is consistent. Over dives of a steady vehicle the mean NEES of every node, of
/// the motion over half of its edges, and of the pose that continues from it is within four standard errors of 6; for a
/// current that pushes the vehicle through corners, which is no random walk, that of all nodes together.
///
/// Seen to fail when edges are taken as independent, and when a pose of the graph is not correlated with later steps.
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
