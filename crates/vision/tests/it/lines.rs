//! Properties of measured lines, over the segment matchers.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_component::Choice;
use seafix_geometry::{Camera, MeasuredLine, Pinhole, Pixel, Point, StereoRig, Transform};
use seafix_vision::{Image, LineFrontEnd, LineOutput, LineRules, SEGMENT_DETECTORS, SEGMENT_MATCHERS, SegmentFit};

const SIZE: [usize; 2] = [480, 360];
/// The depth of the wall (m).
pub(crate) const DEPTH: f64 = 3.0;

/// A rig whose right camera is displaced by `step` (m) and turned, so that its rows are no epipolar lines.
pub(crate) fn rig(step: [f64; 3], lens: &[f64]) -> StereoRig {
    let camera = Pinhole::new(SIZE.map(|n| n as u32), [400.0; 2], [239.5, 179.5], lens).expect("a valid camera");
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.01, -0.02, 0.03));
    StereoRig::new(camera, camera, Transform::new(turn, turn * -Vector3::from(step))).expect("a valid rig")
}

/// The corners of two rectangles on the wall (m).
pub(crate) const RECTANGLES: [([f64; 2], [f64; 2], f64); 2] =
    [([-0.9, -0.6], [-0.2, 0.5], 70.0), ([0.3, -0.4], [0.9, 0.7], -50.0)];

/// The grey level of the wall at (x, y), blurred over 6 mm, nearly a pixel; the axes are turned by 0.2 rad.
fn level(x: f64, y: f64) -> f64 {
    let (x, y) = (turned(x, y), turned(y, -x));
    let step = |x: f64| 0.5 * libm::erfc(-x / (0.006 * std::f64::consts::SQRT_2));
    RECTANGLES.iter().fold(110.0, |level, ([x0, y0], [x1, y1], contrast)| {
        level + contrast * (step(x - x0) - step(x - x1)) * (step(y - y0) - step(y - y1))
    })
}

fn turned(x: f64, y: f64) -> f64 {
    libm::cos(0.2) * x + libm::sin(0.2) * y
}

fn images(rig: &StereoRig) -> [Image; 2] {
    views(rig, DEPTH, |_| 0.0)
}

/// The images of the wall, the part with the second rectangle at depth `second` (m), plus `noise` at each pixel.
pub(crate) fn views(rig: &StereoRig, second: f64, mut noise: impl FnMut(usize) -> f64) -> [Image; 2] {
    let back = rig.right_from_left().inverse();
    let cameras = [
        (rig.left(), Vector3::zeros(), UnitQuaternion::identity()),
        (rig.right(), back.translation(), back.rotation()),
    ];
    cameras.map(|(camera, origin, rotation)| {
        let pixel = |i: usize| {
            let at = Pixel { u: (i % SIZE[0]) as f64, v: (i / SIZE[0]) as f64 };
            let Some(direction) = camera.normalize(&at) else { return 0.0 };
            let ray = rotation * direction.push(1.0);
            let [near, far] = [second, DEPTH].map(|depth| origin + ray * ((depth - origin.z) / ray.z));
            let p = if turned(near.x, near.y) > 0.1 { near } else { far };
            (level(p.x, p.y) + noise(i)).round() as f32
        };
        Image::new(SIZE[0], SIZE[1], (0..SIZE[0] * SIZE[1]).map(pixel).collect()).expect("width × height pixels")
    })
}

fn lines(rig: &StereoRig, matcher: &str, calibration_px: f64) -> Vec<MeasuredLine> {
    measured(&images(rig), rig, matcher, calibration_px).lines
}

pub(crate) fn measured([left, right]: &[Image; 2], rig: &StereoRig, matcher: &str, calibration_px: f64) -> LineOutput {
    let mut output = LineOutput::default();
    front_end(matcher, calibration_px).run([left, right], rig, &mut output);
    output
}

fn front_end(matcher: &str, calibration_px: f64) -> LineFrontEnd {
    LineFrontEnd {
        detector: SEGMENT_DETECTORS.build(&Choice::named("a-contrario")).expect("a component"),
        fit: SegmentFit::default(),
        matcher: SEGMENT_MATCHERS.build(&Choice::named(matcher)).expect("a component"),
        rules: LineRules::default(),
        calibration_px,
    }
}

/// The distance (m) of a point of the wall from the nearest true edge.
fn off(point: &Point<Camera>) -> f64 {
    let (x, y) = (turned(point.coords.x, point.coords.y), turned(point.coords.y, -point.coords.x));
    let sides = RECTANGLES.iter().flat_map(|(a, b, _)| [x - a[0], x - b[0], y - a[1], y - b[1]]);
    sides.map(f64::abs).fold(f64::INFINITY, f64::min)
}

/// Every matcher finds the sides of both rectangles, whichever way the baseline points and however the lens bends; the
/// lines of measured depth lie on the wall and on an edge within five of their standard deviations.
#[test]
fn lines_lie_on_the_edges_for_any_baseline() {
    for name in SEGMENT_MATCHERS.names() {
        for (step, lens) in
            [([0.25, 0.0, 0.0], &[][..]), ([0.0, 0.25, 0.0], &[]), ([0.2, -0.15, 0.02], &[-0.2, 0.05, 0.001, 0.001])]
        {
            let rig = rig(step, lens);
            let found = lines(&rig, name, 0.0);
            assert!(found.len() >= 6, "{name} {step:?}: {} lines", found.len());
            assert!(found.iter().filter(|line| line.depth).count() >= 4, "{name} {step:?}");
            for line in found.iter().filter(|line| line.depth) {
                assert!(line.offsets.cholesky().is_some(), "{name}: {}", line.offsets);
                for (end, point) in line.ends.iter().enumerate() {
                    let [a, b] = [0, 1].map(|i| line.offsets[(2 * end + i, 2 * end + i)].sqrt());
                    let limit = 5.0 * a.hypot(b) + 1e-4;
                    assert!(off(point) < limit, "{name} {step:?}: {point:?} is {} off, limit {limit}", off(point));
                    assert!((point.coords.z - DEPTH).abs() < limit, "{name} {step:?}: {point:?}, limit {limit}");
                }
            }
        }
    }
}

/// The camera model's own error is added to the variance of each offset, and to nothing else.
#[test]
fn the_error_of_the_camera_model_widens_lines_alone() {
    let rig = rig([0.25, 0.0, 0.0], &[]);
    let [exact, erring] = [0.0, 0.15].map(|error| lines(&rig, "overlap-profile", error));
    assert_eq!(exact.len(), erring.len());
    for (one, other) in exact.iter().zip(&erring).filter(|(one, other)| one.depth && other.depth) {
        assert_eq!(one.ends, other.ends);
        let [one, other] = [one, other].map(|line| line.segments.expect("from images").covariance());
        assert!((other - one - nalgebra::Matrix4::identity() * 0.0225).norm() < 1e-12, "{one} {other}");
    }
}

/// The results have the same bits on one thread and on many.
#[test]
fn lines_do_not_depend_on_threads() {
    let rig = rig([0.25, 0.0, 0.0], &[]);
    let [left, right] = images(&rig);
    let front_end = front_end("overlap-profile", 0.0);
    let run = |threads| {
        let mut output = LineOutput::new(threads);
        front_end.run([&left, &right], &rig, &mut output);
        front_end.run([&left, &right], &rig, &mut output);
        output.lines
    };
    assert_eq!(run(seafix_vision::Threads::One), run(seafix_vision::Threads::Pool));
}
