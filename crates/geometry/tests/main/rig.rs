//! Tests of stereo rigs against OpenCV and SciPy.

use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector3, Vector4};
use seafix_geometry::{
    Camera, Pinhole, Pixel, Point, StereoPixels, StereoRig, Transform, Triangulation, UncertainPixels, Untriangulable,
    so3,
};

use crate::{names, near, numbers};

const OPENCV: &str = include_str!("../fixtures/opencv.txt");
const TRIANGULATION: &str = include_str!("../fixtures/triangulation.txt");

/// The rig of `opencv.py`.
fn rig() -> StereoRig {
    let left =
        Pinhole::new([640, 480], [533.4, 541.7], [342.5, 234.7], &[-0.31, 0.12, -0.0021, 0.0016, -0.018]).unwrap();
    let right = Pinhole::new([800, 600], [610.0, 604.0], [400.5, 310.2], &[-0.28, 0.07, 0.0012, -0.0007]).unwrap();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.03, -0.12, 0.05));
    StereoRig::new(left, right, Transform::new(turn, Vector3::new(-0.3, 0.05, 0.08))).unwrap()
}

fn points(key: &str) -> Vec<Point<Camera>> {
    numbers(OPENCV, key).chunks(3).map(|at| Point::new(at[0], at[1], at[2])).collect()
}

fn pixels(key: &str) -> Vec<Pixel> {
    numbers(OPENCV, key).chunks(2).map(|at| Pixel { u: at[0], v: at[1] }).collect()
}

fn rows(matrix: &Matrix3<f64>) -> Vec<f64> {
    matrix.transpose().iter().copied().collect()
}

#[test]
fn opencv_projects_and_triangulates_alike() {
    let rig = rig();
    let [left, right] = ["rig left", "rig right"].map(pixels);
    let triangulated = points("rig triangulated");
    for (i, point) in points("rig points").iter().enumerate() {
        let seen = rig.project(point).unwrap();
        assert!(seen.left.distance(&left[i]) < 1e-12 && seen.right.distance(&right[i]) < 1e-12, "{i}: {seen:?}");
        let seen = UncertainPixels::independent(StereoPixels { left: left[i], right: right[i] }, 0.3);
        let all = [rig.triangulate(&seen), rig.triangulate_midpoint(&seen), rig.triangulate_linear(&seen)];
        for found in all.map(Result::unwrap) {
            assert!(found.point.distance(&triangulated[i]) < 1e-12, "{i}: {:?}", found.point);
            assert!(found.disagreement < 1e-20);
        }
    }
    let essential = Matrix3::from_row_slice(&numbers(OPENCV, "rig essential"));
    assert!((rig.essential() - essential).amax() < 1e-15);
    assert_eq!(rig.mean_focal(), (533.4 + 541.7 + 610.0 + 604.0) / 4.0);
    assert!((rig.baseline() - 0.0989_f64.sqrt()).abs() < 1e-15);
}

#[test]
fn opencv_has_the_same_distance_from_the_epipolar_line() {
    let rig = rig();
    let sampson = numbers(OPENCV, "rig sampson");
    let [left, off] = ["rig left", "rig off"].map(pixels);
    let mut signs = Vec::new();
    for i in 0..sampson.len() {
        let seen = StereoPixels { left: left[i], right: off[i] };
        let found = rig.epipolar_distance(&seen).unwrap();
        assert!((found - sampson[i]).abs() < 1e-9, "{i}: {found}, expected {}", sampson[i]);
        let offset = rig.epipolar_offset(&seen).unwrap();
        assert_eq!(offset.abs(), found);
        signs.push(offset > 0.0);
    }
    // The sign distinguishes both sides of the epipolar line.
    assert_ne!(signs[0], signs[1]);
}

/// Pixels that disagree by several pixels, with a full covariance.
#[test]
fn scipy_has_the_same_least_squares_solution() {
    let rig = rig();
    let covariance = Matrix4::from_row_slice(&numbers(TRIANGULATION, "covariance"));
    let check = |found: Triangulation, kind: &str, name: &str, [at, sure]: [f64; 2]| {
        near(found.point.coords.as_slice(), &numbers(TRIANGULATION, &format!("{kind} {name}")), at, name);
        let wanted = numbers(TRIANGULATION, &format!("{kind} covariance {name}"));
        near(&rows(&found.covariance), &wanted, sure, &format!("{kind} {name}"));
        near(&[found.disagreement], &numbers(TRIANGULATION, &format!("{kind} disagreement {name}")), at, name);
    };
    let mut sets = 0;
    for name in names(TRIANGULATION, "pixels ") {
        let at = numbers(TRIANGULATION, &format!("pixels {name}"));
        let at = StereoPixels { left: Pixel { u: at[0], v: at[1] }, right: Pixel { u: at[2], v: at[3] } };
        let seen = UncertainPixels { at, covariance };
        check(rig.triangulate(&seen).unwrap(), "likeliest", name, [1e-8, 1e-6]);
        check(rig.triangulate_midpoint(&seen).unwrap(), "midpoint", name, [1e-9, 1e-6]);
        check(rig.triangulate_linear(&seen).unwrap(), "linear", name, [1e-9, 1e-6]);
        sets += 1;
    }
    assert_eq!(sets, 3);
}

#[test]
fn the_derivative_is_that_of_the_projection() {
    let (rig, point) = (rig(), Point::new(0.3, -0.2, 2.0));
    let (seen, slope) = rig.project_with_jacobian(&point).unwrap();
    assert_eq!(Some(seen), rig.project(&point));
    for i in 0..3 {
        let step = Vector3::ith(i, 1e-5);
        let [after, before] = [step, -step].map(|step| rig.project(&(point + step)).unwrap().coordinates());
        assert!(((after - before) / 2e-5 - slope.column(i)).norm() < 1e-6, "{i}");
    }
    assert_eq!(seen.coordinates(), Vector4::new(seen.left.u, seen.left.v, seen.right.u, seen.right.v));
}

fn plain(size: [u32; 2]) -> Pinhole {
    Pinhole::new(size, [500.0, 500.0], [511.5, 383.5], &[]).unwrap()
}

fn aside(turn: [f64; 3], step: [f64; 3]) -> StereoRig {
    let camera = plain([1024, 768]);
    StereoRig::new(camera, camera, Transform::new(so3::exp(&turn.into()), step.into())).unwrap()
}

#[test]
fn only_a_camera_beside_or_above_its_like_is_rectified() {
    let both = |rig: StereoRig| (rig.is_rectified(), rig.is_rectified_upright());
    assert_eq!(both(aside([0.0; 3], [-0.3, 0.0, 0.0])), (true, false));
    assert_eq!(both(aside([0.0; 3], [0.0, 0.3, 0.0])), (false, true));
    assert_eq!(both(aside([0.0; 3], [0.0, 0.0, 0.3])), (false, false));
    // Deviations from a rectified rig by rounding and by more, relative to the baseline.
    assert_eq!(both(aside([0.0; 3], [-0.3, 2e-13, -2e-13])), (true, false));
    assert_eq!(both(aside([0.0; 3], [-3.0, 2e-12, -2e-12])), (true, false));
    assert_eq!(both(aside([0.0; 3], [2e-12, 3.0, -2e-12])), (false, true));
    assert_eq!(both(aside([0.0; 3], [-0.3, 4.5e-13, 0.0])), (false, false));
    assert_eq!(both(aside([0.0; 3], [-0.3, 0.0, -4.5e-13])), (false, false));
    assert_eq!(both(aside([0.0; 3], [4.5e-13, 0.3, 0.0])), (false, false));
    assert_eq!(both(aside([0.0; 3], [0.0, 0.3, -4.5e-13])), (false, false));
    assert_eq!(both(aside([5e-13, 0.0, 0.0], [-0.3, 0.0, 0.0])), (true, false));
    assert_eq!(both(aside([1.5e-12, 0.0, 0.0], [-0.3, 0.0, 0.0])), (false, false));
    assert_eq!(both(aside([0.0, 2e-12, 0.0], [0.0, -0.3, 0.0])), (false, false));
    let step = || Transform::new(UnitQuaternion::identity(), Vector3::new(-0.3, 0.0, 0.0));
    let other = StereoRig::new(plain([1024, 768]), plain([1024, 769]), step()).unwrap();
    assert_eq!(both(other), (false, false));
    let lens = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[0.1, 0.0, 0.0, 0.0]).unwrap();
    assert_eq!(both(StereoRig::new(lens, lens, step()).unwrap()), (false, false));
}

#[test]
fn cameras_a_micrometre_apart_are_two() {
    let camera = plain([1024, 768]);
    let new = |x: f64| StereoRig::new(camera, camera, Transform::new(UnitQuaternion::identity(), Vector3::x() * x));
    assert!(new(1e-6).is_ok() && new(0.99e-6).is_err() && new(f64::NAN).is_err());
    let unit = new(0.25).unwrap();
    assert_eq!((unit.essential().m23, unit.essential().m32, unit.essential().m11), (-1.0, 1.0, 0.0));
}

#[test]
fn the_right_camera_turns_where_it_stands() {
    let rig = rig();
    let turned = rig.with_right_turned(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
    let point = Point::new(0.3, -0.2, 2.0);
    let [before, after] = [rig, turned].map(|rig| (*rig.right_from_left() * point).coords);
    assert!((after - Vector3::new(-before.y, before.x, before.z)).norm() < 1e-15);
    assert_eq!((turned.left(), turned.right()), (rig.left(), rig.right()));
}

#[test]
fn both_images_must_show_a_point() {
    // With a baseline of 0.3 m and f = 500 px a point at 1 m depth is 150 px farther left in the right image.
    let rig = aside([0.0; 3], [-0.3, 0.0, 0.0]);
    let at = |u: f64, margin: f64| rig.sees(&Point::new((u - 511.5) / 500.0, 0.0, 1.0), margin).is_some();
    assert!(at(500.0, 20.0) && at(1000.0, 20.0) && at(172.0, 20.0));
    assert!(!at(1010.0, 20.0) && !at(168.0, 20.0) && !at(140.0, 0.0));
}

#[test]
fn pixels_err_by_their_standard_deviation() {
    let at = StereoPixels { left: Pixel { u: 1.0, v: 2.0 }, right: Pixel { u: 3.0, v: 4.0 } };
    assert_eq!(UncertainPixels::independent(at, 3.0).covariance, Matrix4::identity() * 9.0);
}

/// Rays at an angle φ give n² = sin² φ: the limit 1e-14 lies between 0.99e-7 and 1.01e-7 rad. The cameras see a
/// baseline of 0.3 m at depth Z under φ = 0.3 / Z.
#[test]
fn parallel_rays_meet_nowhere() {
    let rig = aside([0.0; 3], [-0.3, 0.0, 0.0]);
    let at = |depth: f64| {
        let exact = rig.project(&Point::new(0.15, 0.0, depth)).unwrap();
        rig.triangulate_midpoint(&UncertainPixels::independent(exact, 1e-9)).map(|found| found.point.coords.z)
    };
    // The step of the derivatives, a thousandth of a pixel, exceeds this disparity.
    assert!(matches!(at(0.3 / 1.1e-7), Err(Untriangulable::Behind(_))));
    assert_eq!(at(0.3 / 0.95e-7), Err(Untriangulable::Parallel));
}

/// A point with a standard deviation as large as its distance is rejected: σ_z = z² σ_d / (f b), √2 σ = σ_d.
#[test]
fn a_point_less_known_than_far_is_rejected() {
    let rig = aside([0.0; 3], [-0.3, 0.0, 0.0]);
    let at = |fraction: f64| {
        // At 30 m the standard deviation of the depth is 6 σ_d m.
        let exact = rig.project(&Point::new(0.15, 0.0, 30.0)).unwrap();
        let seen = UncertainPixels::independent(exact, fraction * 5.0 / std::f64::consts::SQRT_2);
        [rig.triangulate(&seen), rig.triangulate_midpoint(&seen), rig.triangulate_linear(&seen)]
    };
    assert!(at(0.98).iter().all(Result::is_ok));
    assert!(at(1.02).iter().all(|found| *found == Err(Untriangulable::Parallel)));
}

#[test]
fn rays_that_part_meet_behind() {
    // With a disparity of −10 px the rays meet at −500 · 0.3 / 10 m.
    let rig = aside([0.0; 3], [-0.3, 0.0, 0.0]);
    let at = StereoPixels { left: Pixel { u: 506.5, v: 383.5 }, right: Pixel { u: 516.5, v: 383.5 } };
    let seen = UncertainPixels::independent(at, 0.2);
    let depths = [rig.triangulate(&seen), rig.triangulate_midpoint(&seen), rig.triangulate_linear(&seen)];
    for found in depths {
        let Err(Untriangulable::Behind(depth)) = found else { panic!("{found:?}") };
        assert!((depth + 15.0).abs() < 1e-3, "{depth}");
    }
    // The point is in front of the left camera only; the right one looks back.
    let back = aside([0.0, std::f64::consts::PI, 0.0], [-0.3, 0.0, 4.0]);
    let at = StereoPixels { left: Pixel { u: 511.5, v: 383.5 }, right: Pixel { u: 500.0, v: 383.5 } };
    let seen = UncertainPixels::independent(at, 0.2);
    for found in [back.triangulate(&seen), back.triangulate_midpoint(&seen), back.triangulate_linear(&seen)] {
        assert!(matches!(found, Err(Untriangulable::Behind(depth)) if depth < 0.0), "{found:?}");
    }
}

/// Rays that approach in front of the left camera and behind the right one.
///
/// Their midpoint is in front of both cameras. The left ray runs along z from the origin. The right camera is at (0.3,
/// 0, 0); its ray b = (0.1, 0.9, −0.42) is nearest at u = −0.3 bₓ / (bₓ² + b_y²) of b.
#[test]
fn a_ray_is_not_followed_backwards() {
    let b = Vector3::new(0.1, 0.9, -0.42);
    let axis = Vector3::new(-0.893, 0.792, -0.32);
    let turn = UnitQuaternion::rotation_between(&axis, &Vector3::z()).unwrap();
    let camera = plain([1024, 768]);
    let rig = StereoRig::new(camera, camera, Transform::new(turn, -(turn * Vector3::new(0.3, 0.0, 0.0)))).unwrap();
    let left = Pixel { u: 511.5, v: 383.5 };
    let right = rig.right().project(&Point::<Camera>::from(turn * b)).unwrap();
    let seen = UncertainPixels::independent(StereoPixels { left, right }, 0.01);
    let u = -0.3 * b.x / (b.x * b.x + b.y * b.y) * b.norm();
    for found in [rig.triangulate(&seen), rig.triangulate_midpoint(&seen)] {
        assert!(
            matches!(found, Err(Untriangulable::Behind(depth)) if (depth - u).abs() < 1e-9),
            "{found:?}, expected {u}"
        );
    }
}
