//! A box before a stereo rig, with measured corners and edges.

use nalgebra::{Matrix4, Vector2, Vector3, Vector4};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use seafix_geometry::{
    Camera, Covariance6, MeasuredLine, MeasuredPoint, NormalOffset, Object, Pinhole, Pixel, Point, StereoRig,
    StereoSegments, Transform, UncertainPixels, UncertainPoint, across,
};
use seafix_referencing::{EdgeObservation, Observation};

/// The corners of a box of 0.5 × 0.4 × 0.3 m; bit k of the index is the side along axis k.
pub(crate) fn corner(k: usize) -> Vector3<f64> {
    let side = |bit: usize, length: f64| if k >> bit & 1 == 1 { length } else { 0.0 };
    Vector3::new(side(0, 0.5), side(1, 0.4), side(2, 0.3))
}

/// The ends of the twelve edges.
pub(crate) const SIDES: [[usize; 2]; 12] =
    [[4, 5], [6, 7], [4, 6], [5, 7], [0, 4], [1, 5], [0, 1], [0, 2], [2, 6], [1, 3], [3, 7], [2, 3]];

pub(crate) fn rig() -> StereoRig {
    let camera = Pinhole::new([1024, 768], [500.0; 2], [511.5, 383.5], &[]).expect("a camera");
    let step = Transform::new(nalgebra::UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0));
    StereoRig::new(camera, camera, step).expect("a rig")
}

/// A camera above the box, `height` m from it, seeing its top (z = 0.3) and two sides.
pub(crate) fn pose(height: f64, turn: f64) -> Transform<Object, Camera> {
    let down = nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::PI + 0.35, 0.25, turn);
    let centre = Vector3::new(0.25, 0.2, 0.15);
    Transform::new(down, centre - down * Vector3::new(0.05, -0.1, height))
}

pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (1.0 - rng.random::<f64>(), rng.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

pub(crate) fn normal3(rng: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| sigma * normal(rng))
}

/// A measured point with independent pixel errors.
pub(crate) fn point(rig: &StereoRig, at: &Point<Camera>, sigma: f64, rng: &mut ChaCha8Rng) -> MeasuredPoint {
    let mut pixels = UncertainPixels::independent(rig.project(at).expect("in view"), sigma);
    pixels.at.left.u += sigma * normal(rng);
    pixels.at.left.v += sigma * normal(rng);
    pixels.at.right.u += sigma * normal(rng);
    pixels.at.right.v += sigma * normal(rng);
    let found = rig.triangulate(&pixels).expect("a point before the cameras");
    MeasuredPoint { position: UncertainPoint { at: found.point, covariance: found.covariance }, pixels: Some(pixels) }
}

/// The measured line of a true edge, with errors of `sigma` (px) of its four offsets.
///
/// Close to the epipolar lines it lies at the depths of its ends, as a front end has it.
pub(crate) fn line(rig: &StereoRig, ends: [Point<Camera>; 2], sigma: f64, rng: &mut ChaCha8Rng) -> MeasuredLine {
    let seen = ends.map(|end| rig.project(&end).expect("in view"));
    let halves = |a: Pixel, b: Pixel| {
        let (from, along) = (Vector2::new(a.u, a.v), Vector2::new(b.u - a.u, b.v - a.v));
        let normal = Vector2::new(-along.y, along.x).normalize();
        [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()].map(|t| {
            let at = from + along * t;
            NormalOffset { at: Pixel { u: at.x, v: at.y }, normal, sigma, texture: 0.0, common: 0.0 }
        })
    };
    let exact =
        StereoSegments { left: halves(seen[0].left, seen[1].left), right: halves(seen[0].right, seen[1].right) };
    let noisy = |errors: &Vector4<f64>| {
        let off = |half: NormalOffset, error: f64| {
            let (u, v) = (half.at.u + error * half.normal.x, half.at.v + error * half.normal.y);
            NormalOffset { at: Pixel { u, v }, ..half }
        };
        StereoSegments {
            left: [off(exact.left[0], errors[0]), off(exact.left[1], errors[1])],
            right: [off(exact.right[0], errors[2]), off(exact.right[1], errors[3])],
        }
    };
    let segments = noisy(&Vector4::from_fn(|_, _| sigma * normal(rng)));
    let along = Vector2::new(seen[1].left.u - seen[0].left.u, seen[1].left.v - seen[0].left.v).normalize();
    let depth = along.y.abs() > FLAT;
    let found = if depth {
        intersection(rig, &segments, &ends)
    } else {
        ends.map(|end| end.coords * (1.0 + END_DISPARITY * normal(rng) * end.coords.z / (500.0 * 0.25)))
    };
    let normals = across(&(found[1] - found[0]).normalize());
    let mut j = Matrix4::zeros();
    for k in 0..4 {
        let moved = |step: f64| {
            let mut ends = found;
            ends[k / 2] += normals[k % 2] * step;
            offsets(rig, &segments, &ends)
        };
        j.set_column(k, &((moved(1e-5) - moved(-1e-5)) / 2e-5));
    }
    let mut information = j.tr_mul(&j) / (sigma * sigma);
    if !depth {
        information += Matrix4::identity() / (UNMEASURED * found[0].norm()).powi(2);
    }
    let offsets = information.try_inverse().expect("a measured line");
    MeasuredLine { ends: found.map(Point::from), offsets, segments: Some(segments), depth }
}

/// Sine of the angle to the epipolar lines up to which a front end measures no depth: 6°.
const FLAT: f64 = 0.1045;
/// Standard deviation of a disparity (px) of the ends of such a line.
const END_DISPARITY: f64 = 1.0;
/// Stated standard deviation of such a depth, as a fraction of the distance.
const UNMEASURED: f64 = 0.3;

/// The distance along each measured normal from the measured place to a line in space.
fn offsets(rig: &StereoRig, segments: &StereoSegments, ends: &[Vector3<f64>; 2]) -> Vector4<f64> {
    let seen = ends.map(|end| rig.project(&Point::from(end)).expect("in view"));
    let offset = |half: &NormalOffset, [p, q]: [Pixel; 2]| {
        let (from, along) = (Vector2::new(p.u - half.at.u, p.v - half.at.v), Vector2::new(q.u - p.u, q.v - p.v));
        let tangent = Vector2::new(-half.normal.y, half.normal.x);
        half.normal.dot(&(from - along * (tangent.dot(&from) / tangent.dot(&along))))
    };
    let [l, r] = [seen.map(|pixels| pixels.left), seen.map(|pixels| pixels.right)];
    let [a, b] = &segments.left;
    let [c, d] = &segments.right;
    Vector4::new(offset(a, l), offset(b, l), offset(c, r), offset(d, r))
}

/// The places nearest to two ends on the common line of the planes of both segments.
fn intersection(rig: &StereoRig, segments: &StereoSegments, ends: &[Point<Camera>; 2]) -> [Vector3<f64>; 2] {
    let ray = |camera: &Pinhole, half: &NormalOffset| {
        let at = camera.normalize(&half.at).expect("a ray");
        Vector3::new(at.x, at.y, 1.0)
    };
    let plane = |camera: &Pinhole, [a, b]: &[NormalOffset; 2]| ray(camera, a).cross(&ray(camera, b)).normalize();
    let (left, right) = (plane(rig.left(), &segments.left), plane(rig.right(), &segments.right));
    let offset = right.dot(&rig.right_from_left().translation());
    let direction = left.cross(&right).normalize();
    let system = nalgebra::Matrix3::from_rows(&[left.transpose(), right.transpose(), direction.transpose()]);
    let origin = system.try_inverse().expect("planes that meet") * Vector3::new(0.0, -offset, 0.0);
    ends.map(|end| origin + direction * direction.dot(&(end.coords - origin)))
}

/// Identified corners and edges at a pose; `model_sigma` is the common error of each corner.
pub(crate) fn observed(
    rig: &StereoRig,
    pose: &Transform<Object, Camera>,
    (points, edges): (&[usize], &[usize]),
    (sigma, model_sigma): (f64, f64),
    rng: &mut ChaCha8Rng,
) -> (Vec<Observation>, Vec<EdgeObservation>) {
    let into = pose.inverse();
    let model: Vec<Point<Object>> = (0..8).map(|k| Point::from(corner(k) + normal3(rng, model_sigma))).collect();
    let place = |k: usize| into * Point::<Object>::from(corner(k));
    let points = points.iter().map(|&k| {
        let MeasuredPoint { position, pixels } = point(rig, &place(k), sigma, rng);
        Observation { measured: position, pixels, model: model[k], model_sigma }
    });
    let points: Vec<Observation> = points.collect();
    let edges = edges.iter().map(|&k| {
        let ends = SIDES[k];
        EdgeObservation {
            measured: line(rig, ends.map(place), sigma, rng),
            model: ends.map(|end| model[end]),
            model_sigmas: [model_sigma; 2],
        }
    });
    (points, edges.collect())
}

/// The expected square of the target registration error (m²) over the corners.
pub(crate) fn expected_square(covariance: &Covariance6<Object, Camera>, pose: &Transform<Object, Camera>) -> f64 {
    let into = pose.inverse();
    (0..8).map(|k| covariance.of_point(&(into * Point::from(corner(k)))).trace()).sum::<f64>() / 8.0
}

/// The square of the target registration error (m²) over the corners.
pub(crate) fn square(estimate: &Transform<Object, Camera>, truth: &Transform<Object, Camera>) -> f64 {
    let off = *estimate * truth.inverse();
    (0..8).map(|k| (off * Point::<Object>::from(corner(k))).distance(&Point::from(corner(k))).powi(2)).sum::<f64>()
        / 8.0
}

/// A random place within half-sizes.
pub(crate) fn within(half: [f64; 3], rng: &mut dyn Rng) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| rng.random_range(-half[axis]..half[axis]))
}
