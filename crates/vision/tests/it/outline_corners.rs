//! Corners of outlines: a plate in front of a background that differs in each image.

use nalgebra::Vector4;
use seafix_component::Choice;
use seafix_geometry::{MeasuredPoint, Pixel, StereoPixels};
use seafix_vision::{
    CornerView, DESCRIPTORS, DETECTORS, Direct, FrontEnd, FrontEndOutput, Image, Keypoint, LOCATORS, MATCHERS, Optimal,
    OutlineCorners, PointRules,
};

use crate::scenes::{hash, rig};

const SIZE: [usize; 2] = [320, 240];
/// The disparity of the plate (px): 2.5 m ahead of a rig of 0.25 m and 400 px.
const DISPARITY: f64 = 40.0;

/// The corners of the plate in the left image.
fn corners(draw: i64) -> [Pixel; 4] {
    let [x, y] = [0, 1].map(|k| 110.0 + 20.0 * (hash(draw, 900 + k) - 0.5));
    [[0.0, 0.0], [0.0, 60.0], [70.0, 0.0], [70.0, 60.0]].map(|[u, v]| Pixel { u: x + u, v: y + v - 20.0 })
}

/// Both images of the plate, whose level is 60 in the left one.
fn images(draw: i64, [first, .., last]: &[Pixel; 4], right_level: f64) -> [Image; 2] {
    [0, 1].map(|side| {
        // Blobs of a few pixels, unlike in both images.
        let blob = |x: usize, y: usize| {
            let at = |i: usize, k: usize| hash((i / 6) as i64 + 1000 * draw, (k / 6) as i64 + 500 * (side + 1));
            let [fx, fy] = [x, y].map(|a| (a % 6) as f64 / 6.0);
            let row = |k: usize| (1.0 - fx) * at(x, k) + fx * at(x + 6, k);
            (1.0 - fy) * row(y) + fy * row(y + 6)
        };
        let step = |x: f64| 0.5 * libm::erfc(-x / (0.7 * std::f64::consts::SQRT_2));
        let pixel = |i: usize| {
            let (x, y) = (i % SIZE[0], i / SIZE[0]);
            let background = 120.0 + 80.0 * blob(x, y);
            let (u, v) = (x as f64 + DISPARITY * side as f64, y as f64);
            let inside = (step(u - first.u) - step(u - last.u)) * (step(v - first.v) - step(v - last.v));
            let level = if side == 0 { 60.0 } else { right_level };
            let own = level + 0.15 * (u - first.u) + 6.0 * libm::sin(0.3 * v);
            (background + inside * (own - background)).round() as f32
        };
        Image::new(SIZE[0], SIZE[1], (0..SIZE[0] * SIZE[1]).map(pixel).collect()).expect("width × height pixels")
    })
}

/// The cloud of the default front end without and with corners of outlines.
fn clouds([left, right]: &[Image; 2]) -> [Vec<MeasuredPoint>; 2] {
    let rig = rig([0.25, 0.0, 0.0], [0.0; 3], &[]);
    let front_end = FrontEnd {
        filters: Vec::new(),
        detector: DETECTORS.build(&Choice::named("harris").with("features", 400)).expect("a valid detector"),
        locator: LOCATORS.build(&Choice::named("corner-junction")).expect("a valid locator"),
        descriptor: DESCRIPTORS.build(&Choice::named("surf")).expect("a valid descriptor"),
        matcher: MATCHERS.build(&Choice::named("epipolar-band")).expect("a valid matcher"),
        refinement: Box::new(Direct::default()),
        triangulator: Box::new(Optimal(PointRules { calibration_px: 0.0, ..PointRules::default() })),
    };
    let mut output = FrontEndOutput::default();
    front_end.run(left, right, &rig, &mut output);
    let without = output.cloud.clone();
    let mut with = output.cloud.clone();
    let ([l, r], [of_l, of_r]) = (output.keypoints(), output.located());
    let view = |image, keypoints, located| CornerView { image, keypoints, located };
    let views = [view(left, l, of_l), view(right, r, of_r)];
    OutlineCorners::default().add_to(&mut with, &views, &rig, &*front_end.triangulator);
    [without, with]
}

/// The error of a point's pixels (px), and its square normalised by the stated covariance (four degrees of freedom).
fn error(point: &MeasuredPoint, left: &Pixel) -> (f64, f64) {
    let seen = point.pixels.as_ref().expect("from images");
    let shown = StereoPixels { left: *left, right: Pixel { u: left.u - DISPARITY, v: left.v } };
    let off: Vector4<f64> = seen.at.coordinates() - shown.coordinates();
    (off.norm(), off.dot(&seen.covariance.cholesky().expect("a valid covariance").solve(&off)))
}

/// Three of five corners are found instead of two, at errors of the order of the stated ones: the background disturbs
/// a corner's edges. Seen to fail if the whole circle must be alike.
#[test]
fn corners_before_unlike_backgrounds_are_found() {
    const DRAWS: i64 = 24;
    let (mut found, mut squares) = ([0, 0], Vec::new());
    for draw in 0..DRAWS {
        let plate = corners(draw);
        let [without, with] = clouds(&images(draw, &plate, 60.0));
        for corner in &plate {
            let near = |cloud: &[MeasuredPoint]| {
                let errors = cloud.iter().map(|point| error(point, corner)).filter(|(off, _)| *off < 1.0);
                errors.min_by(|a, b| a.0.total_cmp(&b.0))
            };
            found[0] += usize::from(near(&without).is_some());
            found[1] += usize::from(near(&with).is_some());
            squares.extend(near(&with[without.len()..]).map(|(_, square)| square / 4.0));
        }
    }
    assert!(found[0] < 45 && found[1] > 52, "{found:?} of {}", 4 * DRAWS);
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((0.5..4.0).contains(&mean), "{mean}");
}

/// Plates of unlike levels share no corner, and their backgrounds hardly any. Seen to fail, with 25 corners, if a sector
/// may end anywhere and levels may differ by 0.4 of their standard deviation.
#[test]
fn unlike_plates_have_few_corners_in_common() {
    let added = |draw| {
        let [without, with] = clouds(&images(draw, &corners(draw), 110.0));
        with.len() - without.len()
    };
    let added = (0..24).map(added).sum::<usize>();
    assert!(added <= 12, "{added}");
}

/// Neither an image of one pixel nor a key point without a position gives a corner, and invalid settings are named.
#[test]
fn degenerate_input_gives_no_corner() {
    let rig = rig([0.25, 0.0, 0.0], [0.0; 3], &[]);
    let image = Image::new(1, 1, vec![7.0]).expect("one pixel");
    let nowhere = Keypoint { at: Pixel { u: f64::NAN, v: 0.0 }, response: 1.0, scale: 1.0 };
    let corner = Keypoint { at: Pixel { u: 0.0, v: 0.0 }, ..nowhere };
    for keypoints in [&[][..], &[nowhere, corner]] {
        let located = vec![None; keypoints.len()];
        let view = CornerView { image: &image, keypoints, located: &located };
        let mut cloud = Vec::new();
        OutlineCorners::default().add_to(&mut cloud, &[view; 2], &rig, &Optimal::default());
        assert_eq!(cloud.len(), 0);
    }
    let wrong = OutlineCorners { junction_sigma: -1.0, ..OutlineCorners::default() };
    assert!(wrong.check().unwrap_err().contains("junction-sigma"), "{:?}", wrong.check());
    let wrong = OutlineCorners { ratio: 0.0, ..OutlineCorners::default() };
    assert!(wrong.check().unwrap_err().contains("ratio"), "{:?}", wrong.check());
}
