//! Properties of all locators.

use seafix_component::Choice;
use seafix_geometry::Pixel;
use seafix_vision::{DETECTORS, Image, Keypoint, LOCATORS, Locator, Threads, UncertainPixel, Workspace};

const SIDE: usize = 151;

fn hash(x: usize, y: usize) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h ^ (h >> 13)
}

/// A blurred board of random cells of 12 px, with X corners, L corners and neither.
fn board(width: usize, height: usize) -> Image {
    let cell = |x: usize, y: usize| {
        let bright = (x + y).is_multiple_of(2) ^ hash(x, y).is_multiple_of(4);
        if bright { 170.0 } else { 30.0 }
    };
    let sharp = |x: usize, y: usize| cell(x / 12, y / 12) + (hash(x, y) % 5) as f32;
    let row = |x: usize, y: usize| sharp(x.saturating_sub(1), y) + 2.0 * sharp(x, y) + sharp(x + 1, y);
    let value = |x: usize, y: usize| (row(x, y.saturating_sub(1)) + 2.0 * row(x, y) + row(x, y + 1)) / 16.0;
    made(width, height, value)
}

fn made(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Image {
    Image::new(width, height, (0..width * height).map(|i| value(i % width, i / width)).collect())
        .expect("width × height pixels")
}

fn corners(image: &Image) -> Vec<Keypoint> {
    DETECTORS.build(&Choice::named("harris")).expect("the defaults").detect(image)
}

fn every(law: impl Fn(&str, &dyn Locator)) {
    for listing in LOCATORS.listings() {
        law(listing.name, &*LOCATORS.build(&Choice::named(listing.name)).expect("the defaults"));
    }
}

/// Asserts that the same key points are located, at the same positions within `tolerance` (px).
fn same(name: &str, found: &[Option<UncertainPixel>], expected: &[Option<UncertainPixel>], tolerance: f64) {
    let located = expected.iter().flatten().count();
    assert!(name == "peak" || located > 15, "{name}: {located}");
    for (found, expected) in found.iter().zip(expected) {
        match (found, expected) {
            (Some(found), Some(expected)) => {
                let off = found.at.distance(&expected.at);
                assert!(off <= tolerance, "{name}: {off} px from {:?}", expected.at);
            }
            (None, None) => {}
            other => panic!("{name}: {other:?}"),
        }
    }
}

/// The largest shift by rounding (px): fits end with a short step, about 1e-4 px from their limit.
const ROUNDING: f64 = 1e-3;

/// Positions are invariant under brightness offset and contrast.
///
/// Seen to fail when the fit's derivative by the row has the wrong sign.
#[test]
fn light_and_contrast_move_nothing() {
    let image = board(SIDE, SIDE);
    let other = made(SIDE, SIDE, |x, y| 0.75 * image.row(y)[x] + 40.0);
    let points = corners(&image);
    every(|name, locator| same(name, &locator.locate(&other, &points), &locator.locate(&image, &points), ROUNDING));
}

/// A shift of the image by integer pixels shifts the corners.
///
/// Seen to fail when a fit depends on its window's position in the image.
#[test]
fn a_shift_by_integer_pixels_shifts_the_places() {
    let image = board(SIDE, SIDE);
    let (across, down) = (5, 9);
    let shifted = made(SIDE - across, SIDE - down, |x, y| image.row(y + down)[x + across]);
    let inside = |x: f64| x > 30.0 && x < SIDE as f64 - 30.0;
    let points: Vec<_> = corners(&image).into_iter().filter(|k| inside(k.at.u) && inside(k.at.v)).collect();
    let back = |at: Pixel| Pixel { u: at.u - across as f64, v: at.v - down as f64 };
    let moved: Vec<_> = points.iter().map(|k| Keypoint { at: back(k.at), ..*k }).collect();
    every(|name, locator| {
        let expected = locator.locate(&image, &points);
        let expected: Vec<_> = expected.iter().map(|p| p.map(|p| UncertainPixel { at: back(p.at), ..p })).collect();
        same(name, &locator.locate(&shifted, &moved), &expected, ROUNDING);
    });
}

/// A quarter turn of the image turns the corners and their covariances.
///
/// Seen to fail when the junction weighs vertical gradients differently from horizontal ones.
#[test]
fn a_quarter_turn_turns_the_places() {
    let image = board(SIDE, SIDE);
    let turned = made(SIDE, SIDE, |x, y| image.row(x)[SIDE - 1 - y]);
    let points = corners(&image);
    let turn = |at: Pixel| Pixel { u: at.v, v: (SIDE - 1) as f64 - at.u };
    let there: Vec<_> = points.iter().map(|k| Keypoint { at: turn(k.at), ..*k }).collect();
    every(|name, locator| {
        let (expected, found) = (locator.locate(&image, &points), locator.locate(&turned, &there));
        let at: Vec<_> = expected.iter().map(|p| p.map(|p| UncertainPixel { at: turn(p.at), ..p })).collect();
        same(name, &found, &at, ROUNDING);
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            let (a, b) = (found.covariance, expected.covariance);
            let off = (a[(0, 0)] - b[(1, 1)]).abs() + (a[(1, 1)] - b[(0, 0)]).abs() + (a[(0, 1)] + b[(0, 1)]).abs();
            assert!(off <= 0.02 * b.trace(), "{name}: {a} for {b}");
        }
    });
}

/// A corner is at most 3.5 px from its key point.
///
/// Seen to fail when a fit is accepted wherever it ends.
#[test]
fn a_place_is_near_its_key_point() {
    let image = board(SIDE, SIDE);
    let beside = |k: &Keypoint, d: f64| [[d, 0.0], [0.0, d]].map(|[u, v]| Pixel { u: k.at.u + u, v: k.at.v + v });
    let points: Vec<Keypoint> = corners(&image)
        .iter()
        .flat_map(|k| (-6..=6).flat_map(|d| beside(k, f64::from(d)).map(|at| Keypoint { at, ..*k })))
        .collect();
    every(|name, locator| {
        for (place, point) in locator.locate(&image, &points).iter().zip(&points) {
            let off = place.map_or(0.0, |place| place.at.distance(&point.at));
            assert!(off <= 3.5, "{name}: {off} px");
        }
    });
}

/// Any key point of any image gives a position with a covariance, or none; a flat image gives none.
///
/// Seen to fail when windows may leave the image.
#[test]
fn any_key_point_of_any_image_is_examined() {
    let mut points = Vec::new();
    for wild in [f64::NAN, f64::INFINITY, -1e300, 1e300, -5.0, 0.0, 0.5, 7.0, 39.0, 40.0] {
        for other in [3.0, 20.5, wild] {
            let at = |u, v| Keypoint { at: Pixel { u, v }, response: 1.0, scale: 1.0 };
            points.extend([at(wild, other), at(other, wild)]);
        }
    }
    every(|name, locator| {
        for (width, height) in [(1, 1), (2, 2), (1, 40), (40, 3), (13, 13), (40, 40)] {
            for (scale, offset) in [(1.0, 0.0), (1e36, -1e38), (1e-40, 0.0), (0.0, 128.0)] {
                let shown = board(width, height);
                let image = made(width, height, |x, y| shown.row(y)[x] * scale + offset);
                let found = locator.locate(&image, &points);
                assert_eq!(found.len(), points.len(), "{name}");
                for place in found.iter().flatten() {
                    assert!(scale > 0.0, "{name}: {place:?} in a flat image");
                    let finite = place.at.u.is_finite() && place.covariance.iter().all(|c| c.is_finite());
                    assert!(finite && place.covariance.trace() >= 0.0, "{name}: {place:?}");
                }
            }
        }
        assert_eq!(locator.locate(&board(40, 40), &[]), [], "{name}");
    });
}

/// Results do not depend on threads or earlier contents of the workspace.
///
/// Seen to fail when a piece begins at the first key point, and when a fit keeps the mean of the previous window.
#[test]
fn threads_and_memory_change_no_bit() {
    let images = [board(SIDE, SIDE), board(60, 90), board(SIDE, SIDE)];
    every(|name, locator| {
        for threads in [Threads::One, Threads::Pool] {
            let (mut work, mut places) = (Workspace::new(threads), vec![None; 3]);
            for image in &images {
                let points = corners(image);
                locator.locate_into(image, &points, &mut work, &mut places);
                assert_eq!(places, locator.locate(image, &points), "{name}");
            }
        }
    });
}
