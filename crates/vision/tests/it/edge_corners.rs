//! Corners where edges meet, in rendered images of two rectangles.

use nalgebra::Vector4;
use seafix_geometry::{Camera, MeasuredPoint, Point, StereoRig};
use seafix_vision::{EdgeCorners, Image, Optimal, PointRules};

use super::{
    lines::{DEPTH, RECTANGLES, measured, rig, views},
    scenes::hash,
};

fn corners(images: &[Image; 2], rig: &StereoRig, settings: &EdgeCorners) -> Vec<MeasuredPoint> {
    let triangulator = Optimal(PointRules { calibration_px: 0.0, ..PointRules::default() });
    let mut cloud = Vec::new();
    let lines = measured(images, rig, "overlap-profile", 0.0);
    settings.add_to(&mut cloud, lines.segments(), &lines.matches, rig, &triangulator);
    cloud
}

/// The true corners of both rectangles, the second one at depth `second`.
fn truth(second: f64) -> Vec<Point<Camera>> {
    let of = |([x0, y0], [x1, y1], _): &([f64; 2], [f64; 2], f64), depth| {
        let (c, s) = (libm::cos(0.2), libm::sin(0.2));
        [[*x0, *y0], [*x0, *y1], [*x1, *y0], [*x1, *y1]].map(|[x, y]| Point::new(c * x - s * y, s * x + c * y, depth))
    };
    [of(&RECTANGLES[0], DEPTH), of(&RECTANGLES[1], second)].concat()
}

/// The error of the pixels of a corner, and its square normalised by the stated covariance (four degrees of freedom).
fn error(rig: &StereoRig, found: &MeasuredPoint, true_at: &Point<Camera>) -> (f64, f64) {
    let (seen, shown) = (found.pixels.expect("from images"), rig.project(true_at).expect("in view"));
    let off: Vector4<f64> = seen.at.coordinates() - shown.coordinates();
    let root = seen.covariance.cholesky().expect("a valid covariance");
    (off.norm(), off.dot(&root.solve(&off)))
}

/// Every corner of a rectangle is the intersection of its sides, whichever way the baseline points and however the
/// lens bends.
#[test]
fn sides_meet_in_corners() {
    for (step, lens) in
        [([0.25, 0.0, 0.0], &[][..]), ([0.0, 0.25, 0.0], &[]), ([0.2, -0.15, 0.02], &[-0.2, 0.05, 0.001, 0.001])]
    {
        let rig = rig(step, lens);
        let found = corners(&views(&rig, DEPTH, |_| 0.0), &rig, &EdgeCorners::default());
        for corner in truth(DEPTH) {
            let nearest = found.iter().map(|one| error(&rig, one, &corner).0).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.1, "{step:?}: {corner:?} is {nearest} px off");
        }
    }
}

/// Edges at different depths meet in no point, though they cross in both images: each corner is one of a rectangle.
///
/// Without the test of the epipolar distance, their crossings were corners.
#[test]
fn edges_at_different_depths_make_no_corner() {
    let rig = rig([0.25, 0.0, 0.0], &[]);
    let images = views(&rig, 2.4, |_| 0.0);
    let stray = |settings: &EdgeCorners| {
        let found = corners(&images, &rig, settings);
        let on = |one: &&MeasuredPoint| truth(2.4).iter().any(|corner| error(&rig, one, corner).0 < 0.2);
        (found.iter().filter(on).count(), found.len() - found.iter().filter(on).count())
    };
    let (own, strays) = stray(&EdgeCorners::default());
    assert!(own >= 7 && strays <= 1, "{own} corners, {strays} others");
    let (_, crossings) = stray(&EdgeCorners { confidence: 1.0, ..EdgeCorners::default() });
    assert!(crossings > strays, "{crossings} crossings without the test");
}

/// In noisy images the mean of the normalised squared error is that of its four degrees of freedom.
#[test]
fn corners_have_the_stated_error() {
    let rig = rig([0.25, 0.0, 0.0], &[]);
    let mut squares = Vec::new();
    for draw in 0..6 {
        let mut pixels = 0;
        let images = views(&rig, DEPTH, |_| {
            pixels += 1;
            8.0 * (2.0 * hash(pixels, draw) - 1.0)
        });
        let found = corners(&images, &rig, &EdgeCorners::default());
        for corner in truth(DEPTH) {
            let near = found.iter().map(|one| error(&rig, one, &corner)).min_by(|a, b| a.0.total_cmp(&b.0));
            squares.extend(near.filter(|(off, _)| *off < 1.0).map(|(_, square)| square / 4.0));
        }
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!(squares.len() > 40, "{}", squares.len());
    assert!((0.5..2.0).contains(&mean), "{mean}");
}
