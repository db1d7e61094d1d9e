//! Laws of the adjustment on points without images.

use nalgebra::{DMatrix, Matrix3, Matrix4, UnitQuaternion, Vector3};
use seafix_evaluation::compare_models;
use seafix_geometry::{Camera, Covariance6, Pinhole, Point, StereoRig, Transform, UncertainPixels, World};
use seafix_navigation::RelativeMotion;
use seafix_simulation::{Purpose, Stream};

use super::{Adjustment, CalibrationSigma, Excess, Motion, Observation};
use crate::model::frame::{ObjectFrame, inner};

const EXACT: CalibrationSigma = CalibrationSigma { pixels: 0.0, baseline: 0.0 };
const SIGMA: f64 = 0.2;

pub(crate) fn rig(baseline: f64) -> StereoRig {
    let camera = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[]).unwrap();
    let across = Transform::new(UnitQuaternion::identity(), Vector3::new(-baseline, 0.0, 0.0));
    StereoRig::new(camera, camera, across).unwrap()
}

/// Ten points within 2 × 1.6 × 0.9 m.
pub(crate) fn points() -> Vec<Point<World>> {
    let mut stream = Stream::new(11, 0, 0, Purpose::Site);
    let mut at = || Point::new(stream.between(-1.0, 1.0), stream.between(-0.8, 0.8), stream.between(-0.45, 0.45));
    (0..10).map(|_| at()).collect()
}

/// Two crossing lines of pairs that look down from 3 m.
pub(crate) fn poses(count: usize) -> Vec<Transform<World, Camera>> {
    let down = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI);
    (0..count)
        .map(|k| {
            let along = 2.4 * (k / 2) as f64 / ((count / 2).max(2) - 1) as f64 - 1.2;
            let at = if k % 2 == 0 { Vector3::new(along, 0.1, 3.0) } else { Vector3::new(-0.1, along, 3.1) };
            let heading = UnitQuaternion::from_scaled_axis(Vector3::z() * (0.7 * k as f64));
            let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(0.1 * (k % 3) as f64 - 0.1, 0.05, 0.0));
            Transform::new(heading * tilt * down, at)
        })
        .collect()
}

/// All points that both cameras see, with noise of `sigma` px in each coordinate, drawn by `number`.
fn seen(rig: &StereoRig, poses: &[Transform<World, Camera>], sigma: f64, number: u64) -> Vec<Observation> {
    let mut stream = Stream::new(3, number, 0, Purpose::Points);
    let mut observations = Vec::new();
    for (view, pose) in poses.iter().enumerate() {
        for (point, at) in points().iter().enumerate() {
            let Some(mut pixels) = rig.sees(&(pose.inverse() * *at), 0.0) else { continue };
            for side in [&mut pixels.left, &mut pixels.right] {
                side.u += sigma * stream.normal();
                side.v += sigma * stream.normal();
            }
            let pixels = UncertainPixels::independent(pixels, SIGMA);
            observations.push(Observation { view, point, pixels });
        }
    }
    observations
}

/// The adjustment of these observations from poses and points that are centimetres off.
fn started<'a>(
    rig: &'a StereoRig,
    poses: &[Transform<World, Camera>],
    observations: Vec<Observation>,
) -> Adjustment<'a> {
    let mut stream = Stream::new(5, 0, 0, Purpose::Prior);
    let mut off = |pose: &Transform<World, Camera>| {
        let (turn, shift) = (stream.normal3(0.01), stream.normal3(0.03));
        pose.perturbed(&[turn.x, turn.y, turn.z, shift.x, shift.y, shift.z].into())
    };
    let poses = poses.iter().enumerate().map(|(k, pose)| if k == 0 { *pose } else { off(pose) }).collect();
    let points = points().iter().map(|point| *point + Vector3::new(0.02, -0.01, 0.03)).collect();
    Adjustment { rig, poses, points, observations, motions: Vec::new() }
}

fn coordinates<F>(points: &[Point<F>]) -> Vec<Vector3<f64>> {
    points.iter().map(|point| point.coords).collect()
}

#[test]
fn exact_pixels_give_the_exact_model() {
    let rig = rig(0.25);
    for robust in [false, true] {
        let poses = poses(6);
        let mut adjustment = started(&rig, &poses, seen(&rig, &poses, 0.0, 0));
        adjustment.solve(&Excess::default(), robust).unwrap();
        let truth = coordinates(&points());
        let off = compare_models(&truth, &coordinates(&adjustment.points), &DMatrix::identity(30, 30)).unwrap();
        assert!(off.rms < 1e-9, "{}", off.rms);
    }
}

/// A fault: a covariance without the poses' uncertainty gives a mean of 60.
#[test]
fn errors_are_those_of_the_bound_and_the_covariance() {
    let rig = rig(0.25);
    let poses = poses(10);
    let truth = ObjectFrame::on(&points(), [0, 1, 2]).unwrap();
    let draws = 1500;
    let (mut nees, mut count, mut squares, mut bound) = (0.0, 0, 0.0, 0.0);
    for draw in 0..draws {
        let mut adjustment = started(&rig, &poses, seen(&rig, &poses, SIGMA, draw));
        adjustment.solve(&Excess::default(), false).unwrap();
        let spread = adjustment.spread(&Excess::default(), &EXACT).unwrap().total();
        let frame = ObjectFrame::on(&adjustment.points, [0, 1, 2]).unwrap();
        let covariance = frame.covariance(&spread);
        for k in 3..10 {
            let own: Matrix3<f64> = covariance.fixed_view::<3, 3>(3 * k, 3 * k).into_owned();
            let error = frame.points[k] - truth.points[k];
            nees += error.dot(&(own.try_inverse().unwrap() * error));
            count += 1;
        }
        let own = inner(&adjustment.points, &spread);
        bound += own.trace();
        let off = compare_models(&coordinates(&points()), &coordinates(&adjustment.points), &DMatrix::identity(30, 30));
        squares += off.unwrap().differences.iter().map(Vector3::norm_squared).sum::<f64>();
    }
    let (mean, ratio) = (nees / f64::from(count), (squares / bound).sqrt());
    // The points of a draw have common errors: the mean over 1500 draws has a standard deviation of about 0.04.
    assert!((2.85..3.15).contains(&mean), "NEES {mean}");
    assert!((0.97..1.03).contains(&ratio), "RMSE over bound {ratio}");
}

/// A pair that is added never raises a variance, for any of the points.
#[test]
fn a_pair_more_lowers_every_variance() {
    let rig = rig(0.25);
    let mut before = vec![f64::INFINITY; 10];
    let all = poses(10);
    for count in [3, 4, 6, 10] {
        let poses = &all[..count];
        let mut adjustment = started(&rig, poses, seen(&rig, poses, 0.0, 0));
        adjustment.solve(&Excess::default(), false).unwrap();
        let spread = adjustment.spread(&Excess::default(), &EXACT).unwrap().total();
        let own = inner(&adjustment.points, &spread);
        let now: Vec<f64> = (0..10).map(|k| own.fixed_view::<3, 3>(3 * k, 3 * k).trace()).collect();
        assert!(now.iter().zip(&before).all(|(now, before)| now < before), "{count}: {now:?} {before:?}");
        before = now;
    }
}

/// The variance of a distance does not depend on the base, and the rule's zeros are zeros.
#[test]
fn the_covariance_has_the_zeros_of_the_rule_and_distances_are_free_of_it() {
    let rig = rig(0.25);
    let poses = poses(6);
    let mut adjustment = started(&rig, &poses, seen(&rig, &poses, SIGMA, 7));
    adjustment.solve(&Excess::default(), false).unwrap();
    let spread = adjustment.spread(&Excess::default(), &CalibrationSigma { pixels: 0.1, baseline: 2e-3 }).unwrap();
    let distances = |base: [usize; 3]| -> Vec<f64> {
        let frame = ObjectFrame::on(&adjustment.points, base).unwrap();
        let covariance = frame.covariance(&spread.total());
        let block = |i: usize, j: usize| covariance.fixed_view::<3, 3>(3 * i, 3 * j).into_owned();
        let [p1, p2, p3] = base;
        assert_eq!(block(p1, p1), Matrix3::zeros());
        assert!(block(p3, p3)[(0, 0)] > 0.0 && block(p3, p3).row(1).norm() + block(p3, p3).row(2).norm() == 0.0);
        assert!(block(p2, p2)[(0, 0)] > 0.0 && block(p2, p2)[(1, 1)] > 0.0 && block(p2, p2).row(2).norm() == 0.0);
        assert!(block(5, 5).cholesky().is_some());
        let variance = |i: usize, j: usize| {
            let n = (frame.points[j] - frame.points[i]).normalize();
            n.dot(&((block(i, i) + block(j, j) - block(i, j) - block(j, i)) * n))
        };
        (0..10).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| variance(i, j)).collect()
    };
    let [a, b] = [distances([0, 1, 2]), distances([7, 3, 9])];
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-9 * a), "{a:?}\n{b:?}");
}

/// A rig that is off by its stated σ makes a model that is off by as much, and says so.
#[test]
fn a_wrong_baseline_is_a_wrong_scale_within_its_deviation() {
    let (true_rig, believed) = (rig(0.25), rig(0.25 * 1.002));
    let poses = poses(8);
    let mut adjustment = started(&believed, &poses, seen(&true_rig, &poses, 0.0, 0));
    adjustment.solve(&Excess::default(), false).unwrap();
    let truth = coordinates(&points());
    let spread = adjustment.spread(&Excess::default(), &CalibrationSigma { pixels: 0.0, baseline: 2e-3 }).unwrap();
    let frame = ObjectFrame::on(&adjustment.points, [0, 1, 2]).unwrap();
    let found = compare_models(&truth, &coordinates(&frame.points), &frame.covariance(&spread.total())).err();
    assert!(found.is_none());
    let plain = compare_models(&truth, &coordinates(&adjustment.points), &spread.total()).unwrap();
    assert!((plain.scale - 1.002).abs() < 1e-4, "{}", plain.scale);
    assert!(plain.scale_sigma > 1.9e-3, "{}", plain.scale_sigma);
    assert!(plain.chi2.unwrap() < plain.dof as f64);
}

/// The switch: observations of a neighbouring corner, 12 px away, take no part in the solution.
#[test]
fn wrong_observations_lose_their_weight() {
    let rig = rig(0.25);
    let poses = poses(8);
    let mut observations = seen(&rig, &poses, 0.0, 0);
    for k in [3, 17, 40] {
        observations[k].pixels.at.left.u += 12.0;
        observations[k].pixels.at.right.u += 12.0;
    }
    let mut adjustment = started(&rig, &poses, observations);
    adjustment.solve(&Excess::default(), true).unwrap();
    let off = compare_models(&coordinates(&points()), &coordinates(&adjustment.points), &DMatrix::identity(30, 30));
    assert!(off.unwrap().rms < 1e-4);
    let chi2 = adjustment.disagreements(&Excess::default()).unwrap();
    let against: Vec<usize> = (0..chi2.len()).filter(|k| chi2[*k] > 100.0).collect();
    assert_eq!(against, [3, 17, 40]);
}

/// Two pairs without a common point are held by the odometry, and its uncertainty is that of the points between them.
#[test]
fn a_motion_connects_pairs_without_common_points() {
    let rig = rig(0.25);
    let poses = poses(4);
    let mut observations = seen(&rig, &poses[..2], 0.0, 0);
    observations.retain(|observation| (observation.view == 0) == (observation.point < 5));
    let step = poses[0].inverse() * poses[1];
    let motion = RelativeMotion::new(step, Covariance6::isotropic(1e-9, 0.01));
    let mut adjustment = started(&rig, &poses[..2], observations);
    adjustment.motions.push(Motion { from: 0, to: 1, motion });
    let count = points().len();
    let present: Vec<bool> =
        (0..count).map(|k| adjustment.observations.iter().any(|observation| observation.point == k)).collect();
    assert!(present.iter().all(|present| *present));
    adjustment.solve(&Excess::default(), false).unwrap();
    let off = compare_models(&coordinates(&points()), &coordinates(&adjustment.points), &DMatrix::identity(30, 30));
    assert!(off.unwrap().rms < 1e-9);
    // Another odometry that is sure: the difference is the motion's own variance, 0.01² in each direction.
    let with = |sigma: f64| {
        let mut adjustment = adjustment.clone();
        adjustment.motions[0].motion.covariance = Covariance6::isotropic(1e-9, sigma);
        let all = adjustment.spread(&Excess::default(), &EXACT).unwrap().total();
        all.fixed_view::<3, 3>(27, 27).into_owned()
    };
    let added = with(0.01) - with(1e-9);
    assert!((added - Matrix3::identity() * 1e-4).amax() < 1e-7, "{added}");
    adjustment.motions.clear();
    assert!(adjustment.spread(&Excess::default(), &EXACT).is_err());
}

/// The noise beyond the stated one is estimated from the residuals, apart for both images and for the disparity.
#[test]
fn the_excess_is_estimated() {
    let mut stream = Stream::new(1, 0, 0, Purpose::Points);
    let (common, difference) = (0.12, 0.05);
    let stated = 0.02;
    let mut draw = || {
        let mut residual = nalgebra::Vector4::zeros();
        for k in 0..2 {
            let (c, d) = (common * stream.normal(), difference * stream.normal());
            residual[k] = c - 0.5 * d + stated * stream.normal();
            residual[k + 2] = c + 0.5 * d + stated * stream.normal();
        }
        (residual, Matrix4::identity() * (stated * stated))
    };
    let residuals: Vec<_> = (0..4000).map(|_| draw()).collect();
    let found = Excess::of(&residuals, 1.0, 16_000);
    assert!((found.common - common).abs() < 4e-3 && (found.difference - difference).abs() < 2e-3, "{found:?}");
    let none: Vec<_> = residuals.iter().map(|(_, covariance)| (nalgebra::Vector4::repeat(0.01), *covariance)).collect();
    assert_eq!(Excess::of(&none, 1.0, 16_000), Excess::default());
}
