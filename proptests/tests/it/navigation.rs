//! Laws of carried fixes and of every odometry.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use seafix_component::Choice;
use seafix_geometry::{Camera, Covariance6, Object, Pinhole, StereoRig, Transform, World};
use seafix_navigation::{
    Device, Lost, ODOMETRIES, ObjectPose, Odometry, OdometryOutcome, OdometryTrajectory, Reading, RelativeMotion,
    StereoPair, by_world,
};
use seafix_proptests::{law, poses::pose, within};
use seafix_vision::{Image, Threads};

fn exact<A: seafix_geometry::Frame, B: seafix_geometry::Frame>() -> Covariance6<A, B> {
    Covariance6::isotropic(1e-6, 1e-6)
}

/// The steps between poses of one dive.
fn steps(dive: &[Transform<World, Camera>]) -> Vec<RelativeMotion> {
    let step = |two: &[Transform<World, Camera>]| RelativeMotion::new(two[0].inverse() * two[1], exact());
    dive.windows(2).map(step).collect()
}

/// P11. A fix at i carried to j by exact odometry, Eq. (6), is the fix at j, to 1e-10 after 2000 steps; for j = i it is
/// the fix at i bit for bit. Eq. (2), through the world, gives the same.
#[test]
fn a_fix_is_carried_along() {
    let dive = prop::collection::vec(pose::<World, Camera>(10.0), 2001);
    law(8, (pose::<World, Object>(50.0), dive), |(world_from_object, dive)| {
        let fix = |at: &Transform<World, Camera>| by_world(&world_from_object, at);
        let first = ObjectPose::new(fix(&dive[0]), exact());
        let steps = steps(&dive);
        prop_assert_eq!(first.after_all(&[]).object_from_camera, first.object_from_camera);
        let last = first.after_all(&steps).object_from_camera;
        let expected = fix(&dive[2000]);
        within("carried − direct", (last.matrix() - expected.matrix()).amax(), 1e-10)
    });
}

/// P12. Eq. (6) composed in one step or in many agrees to 1e-12 times the number of steps.
#[test]
fn one_step_is_as_good_as_many() {
    let dive = prop::collection::vec(pose::<World, Camera>(10.0), 2..200);
    law(64, (pose::<Object, Camera>(10.0), dive), |(object_from_camera, dive)| {
        let first = ObjectPose::new(object_from_camera, exact());
        let steps = steps(&dive);
        let motion = dive[0].inverse() * dive[dive.len() - 1];
        let at_once = first.after(&RelativeMotion::new(motion, exact())).object_from_camera;
        let many = first.after_all(&steps).object_from_camera;
        within("many − one", (at_once.matrix() - many.matrix()).amax(), 1e-12 * steps.len() as f64)
    });
}

/// A textured slope in view of a small rig, `step` (m) further along x with each pair.
struct Slope {
    rig: StereoRig,
    pairs: Vec<[Image; 2]>,
}

const STEP: f64 = 0.03;

fn texture(x: f64, y: f64) -> f64 {
    let tile = |scale: f64| {
        let (i, j) = ((x * scale).floor() as i64 as u32, (y * scale).floor() as i64 as u32);
        let mut hash = i.wrapping_mul(0x9E37_79B1) ^ j.wrapping_mul(0x85EB_CA77);
        hash ^= hash >> 15;
        hash = hash.wrapping_mul(0x2C1B_3C6D);
        f64::from((hash ^ (hash >> 13)) % 256)
    };
    0.6 * tile(21.0) + 0.4 * tile(8.0)
}

impl Slope {
    /// The second camera, `baseline` from the first.
    fn new(count: usize, baseline: Vector3<f64>) -> Self {
        let camera = Pinhole::new([240, 180], [200.0; 2], [119.5, 89.5], &[]).unwrap();
        let rig = StereoRig::new(camera, camera, Transform::new(UnitQuaternion::identity(), -baseline)).unwrap();
        // z = 1.5 + 0.3 y: a slope distinguishes directions.
        let view = |x: f64, y: f64| {
            let value = |i: usize| {
                let rays = (0..9).map(|k| {
                    let (a, b) = (f64::from(k % 3) / 3.0 - 1.0 / 3.0, f64::from(k / 3) / 3.0 - 1.0 / 3.0);
                    let (dx, dy) = (((i % 240) as f64 + a - 119.5) / 200.0, ((i / 240) as f64 + b - 89.5) / 200.0);
                    let z = (1.5 + 0.3 * y) / (1.0 - 0.3 * dy);
                    texture(x + dx * z, y + dy * z)
                });
                (rays.sum::<f64>() / 9.0) as f32
            };
            Image::new(240, 180, (0..240 * 180).map(value).collect()).unwrap()
        };
        let pair = |k: usize| {
            let x = STEP * k as f64;
            [view(x, 0.0), view(x + baseline.x, baseline.y)]
        };
        Self { rig, pairs: (0..count).map(pair).collect() }
    }

    fn trajectory(&self, name: &str, threads: Threads, order: &[usize]) -> OdometryTrajectory {
        let odometry = ODOMETRIES.build(&Choice::named(name)).unwrap();
        let mut session = odometry.begin(&self.rig, Transform::identity(), threads);
        for (time, &pair) in order.iter().enumerate() {
            let [left, right] = &self.pairs[pair];
            let stamp_ns = 1_000_000_000 + 100_000_000 * time as u64;
            message(stamp_ns).iter().for_each(|reading| session.sense(reading));
            session.advance(&StereoPair { stamp_ns, left, right }).unwrap();
        }
        session.trajectory()
    }
}

/// The readings of a vehicle that moves along x.
fn message(stamp_ns: u64) -> [Reading; 2] {
    let reading =
        |device, x| Reading { device, stamp_ns, value: Vector3::new(x, 0.0, 0.0), covariance: Matrix3::zeros() };
    [reading(Device::Doppler, STEP / 0.1), reading(Device::Gyro, 0.0)]
}

/// The odometries by images.
fn by_images() -> impl Iterator<Item = (&'static str, Box<dyn Odometry>)> {
    let built = |name| (name, ODOMETRIES.build(&Choice::named(name)).unwrap());
    ODOMETRIES.names().map(built).filter(|(_, odometry)| !odometry.needs_readings())
}

fn paths(trajectory: &OdometryTrajectory) -> Vec<Vector3<f64>> {
    trajectory.waypoints().map(|pose| pose.world_from_camera.translation()).collect()
}

/// Every odometry gives the trajectory over a slope to 2 %, for any direction of the baseline and any number of
/// threads.
#[test]
fn every_odometry_finds_a_short_path() {
    for baseline in [Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.0, 0.1, 0.0)] {
        let slope = Slope::new(6, baseline);
        for name in ODOMETRIES.names() {
            let trajectory = slope.trajectory(name, Threads::One, &[0, 1, 2, 3, 4, 5]);
            let found = paths(&trajectory);
            assert_eq!(found.len(), 6, "{name}: {:?}", trajectory.outcomes);
            for (k, at) in found.iter().enumerate() {
                let off = (at - Vector3::new(STEP * k as f64, 0.0, 0.0)).norm();
                assert!(off < 0.02 * 5.0 * STEP, "{name}: {k} {off} {found:?}");
            }
            let again = slope.trajectory(name, Threads::Pool, &[0, 1, 2, 3, 4, 5]);
            assert_eq!(paths(&again), found, "{name}");
        }
    }
}

/// B15, B16, B59: no odometry by images invents a motion. A stamp out of order is rejected and changes nothing. An
/// image that repeats the previous one, or is black, is skipped with its name. A view of another place breaks the
/// trajectory, and the next segment starts where the last one ended.
#[test]
fn no_odometry_by_images_invents_a_motion() {
    let slope = Slope::new(3, Vector3::new(0.1, 0.0, 0.0));
    let black = Image::new(240, 180, vec![2.0; 240 * 180]).unwrap();
    for (name, odometry) in by_images() {
        let mut session = odometry.begin(&slope.rig, Transform::identity(), Threads::One);
        let mut give = |stamp_ns: u64, images: [&Image; 2]| {
            let done = session.advance(&StereoPair { stamp_ns, left: images[0], right: images[1] });
            (done, session.trajectory())
        };
        let images = |k: usize| [&slope.pairs[k][0], &slope.pairs[k][1]];
        assert!(give(1_000_000_000, images(0)).0.is_ok());
        for stamp in [1_000_000_000, 999_999_999] {
            let (done, trajectory) = give(stamp, images(1));
            assert_eq!((done.unwrap_err().before_ns, trajectory.outcomes.len()), (1_000_000_000, 1), "{name}");
        }
        assert!(give(1_100_000_000, images(1)).0.is_ok());
        let outcome = |trajectory: &OdometryTrajectory| trajectory.outcomes.last().cloned().unwrap();
        let (_, trajectory) = give(1_200_000_000, images(1));
        assert!(matches!(outcome(&trajectory), OdometryOutcome::Skipped(Lost::Frozen(_))), "{name}: {trajectory:?}");
        let (_, trajectory) = give(1_300_000_000, [images(2)[0], &black]);
        assert!(matches!(outcome(&trajectory), OdometryOutcome::Skipped(Lost::Blank(..))), "{name}: {trajectory:?}");
        let (_, trajectory) = give(1_400_000_000, images(2));
        assert!(matches!(outcome(&trajectory), OdometryOutcome::Followed { .. }), "{name}: {trajectory:?}");
        assert_eq!(trajectory.segments.len(), 1, "{name}");
        // The same slope upside down is another place.
        let flipped = |image: &Image| Image::new(240, 180, image.pixels().iter().rev().copied().collect()).unwrap();
        let turned: Vec<[Image; 2]> = (0..2).map(|k| [1, 0].map(|side| flipped(&slope.pairs[k][side]))).collect();
        for (k, pair) in turned.iter().enumerate() {
            assert!(give(1_500_000_000 + 100_000_000 * k as u64, [&pair[0], &pair[1]]).0.is_ok());
        }
        let (_, trajectory) = give(1_700_000_000, [&turned[0][0], &turned[0][1]]);
        assert_eq!(trajectory.segments.len(), 2, "{name}: {:?}", trajectory.outcomes);
        let (before, after) = (&trajectory.segments[0], &trajectory.segments[1]);
        assert!(after.broken.is_some() && after.poses[0].local.is_none(), "{name}");
        let last = before.poses.last().unwrap().world_from_camera;
        assert_eq!(after.poses[0].world_from_camera, last, "{name}: the motion between is unknown");
    }
}
