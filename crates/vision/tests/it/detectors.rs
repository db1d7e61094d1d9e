//! Properties of all detectors.

use seafix_component::Choice;
use seafix_geometry::Pixel;
use seafix_vision::{DETECTORS, Detector, Image, Keypoint, Threads, Workspace};

fn hash(x: usize, y: usize) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2C1B_3C6D);
    h ^ (h >> 13)
}

/// A patchwork of dark and bright cells of 7 px with a little noise: integer grey levels from 0 to 203.
fn patchwork(width: usize, height: usize) -> Image {
    let value = |x: usize, y: usize| (hash(x / 7, y / 7) % 200 + hash(x, y) % 5) as f32;
    Image::new(width, height, (0..width * height).map(|i| value(i % width, i / width)).collect())
        .expect("width × height pixels")
}

/// The test image of a detector: the patchwork or, for corner models, a blurred board of random cells of 11 px.
fn shown(name: &str, width: usize, height: usize) -> Image {
    if !["l-corner", "x-corner"].contains(&name) {
        return patchwork(width, height);
    }
    let cell = |x: usize, y: usize| {
        let h = hash(x, y);
        let bright = (x + y).is_multiple_of(2) ^ h.is_multiple_of(4);
        (if bright { 170 } else { 30 }) + h / 4 % 16
    };
    let sharp = |x: usize, y: usize| (cell(x / 11, y / 11) + hash(x, y) % 5) as f32;
    let row = |x: usize, y: usize| sharp(x.saturating_sub(1), y) + 2.0 * sharp(x, y) + sharp(x + 1, y);
    let value = |x: usize, y: usize| (row(x, y.saturating_sub(1)) + 2.0 * row(x, y) + row(x, y + 1)) / 16.0;
    Image::new(width, height, (0..width * height).map(|i| value(i % width, i / width)).collect())
        .expect("width × height pixels")
}

fn cut(image: &Image, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> Image {
    let pixels = (0..height).flat_map(|y| image.row(top + y)[left..left + width].iter().copied()).collect();
    Image::new(width, height, pixels).expect("width × height pixels")
}

/// Applies the property to each detector, with the settings changed that it has.
///
/// There is no maximum number and no threshold relative to the strongest response, so the property does not depend on
/// the order of equals, on the position of a grid's lines, or on other parts of the image.
fn every(window: &str, law: impl Fn(&str, &dyn Detector)) {
    for listing in DETECTORS.listings() {
        let mut choice = Choice::named(listing.name);
        let has = |key: &str| listing.table.defaults.contains_key(key);
        if has("features") {
            choice = choice.with("features", 1_000_000);
        }
        if has("candidates") {
            choice = choice.with("candidates", 1_000_000);
        }
        if has("quality") {
            choice = choice.with("quality", 0.0);
        }
        if has("window") {
            choice = choice.with("window", window);
        }
        law(listing.name, &*DETECTORS.build(&choice).expect("valid defaults"));
    }
}

/// The largest shift of a point by rounding (px) in a brighter or rotated image.
///
/// Sums of f32 are rounded differently then; a response changes by about 1e-6 of itself, and its vertex by that over
/// the curvature. Differences of integer grey levels, and their sums in a box, are exact.
fn rounding(name: &str, turned: bool) -> f64 {
    match name {
        "fast" => 1e-9,
        "harris" | "shi-tomasi" if !turned => 1e-9,
        _ => 1e-3,
    }
}

/// Asserts that each point of `a` has one of `b` within `tolerance` (px).
fn within(name: &str, a: &[Keypoint], b: &[Keypoint], tolerance: f64) {
    for point in a {
        let nearest = b.iter().map(|other| other.at.distance(&point.at)).fold(f64::INFINITY, f64::min);
        assert!(nearest <= tolerance, "{name}: the nearest to {point:?} is {nearest} px away");
    }
}

fn same(name: &str, a: &[Keypoint], b: &[Keypoint], tolerance: f64) {
    assert!(a.len() > 20, "{name}: only {}", a.len());
    assert_eq!(a.len(), b.len(), "{name}");
    within(name, a, b, tolerance);
}

/// P55. A quarter turn of the image turns the key points.
///
/// Sides are 16 n + 1 px, so that a pyramid or a coarser grid samples the same pixels; 16 n px for detectors that bin
/// pixels. Seen to fail when the vertical gradient counts a tenth more than the horizontal one.
#[test]
fn a_quarter_turn_of_the_image_turns_the_points() {
    for (width, height) in [(161, 129), (160, 128)] {
        turn(width, height, |name| (name == "surf") == (width == 160));
    }
}

fn turn(width: usize, height: usize, concerns: impl Fn(&str) -> bool) {
    for window in ["gaussian", "box"] {
        every(window, |name, detector| {
            let mut image = shown(name, width, height);
            if window == "gaussian" {
                // The first of equals counts and changes with the rotation, so no two values may be equal.
                let pixels = image.pixels_mut().iter_mut().enumerate();
                pixels.for_each(|(i, pixel)| *pixel += (hash(i, 1) % 1024) as f32 / 1024.0);
            }
            // A quarter turn to the left moves (x, y) to (y, width − 1 − x).
            let turned = (0..width * height).map(|i| image.row(i % height)[width - 1 - i / height]).collect();
            let turned = Image::new(height, width, turned).expect("width × height pixels");
            let tolerance = match (window, name) {
                ("box", "harris" | "shi-tomasi") => 1e-9,
                ("box", _) => return,
                _ if !concerns(name) => return,
                _ => rounding(name, true),
            };
            let mut points = detector.detect(&image);
            points.iter_mut().for_each(|p| p.at = Pixel { u: p.at.v, v: (width - 1) as f64 - p.at.u });
            same(name, &points, &detector.detect(&turned), tolerance);
        });
    }
}

/// P55. A shift of the image by integer pixels shifts the key points away from the border.
///
/// Their surroundings of ten times the scale lie in both images. Seen to fail when the kept rows of a response are
/// moved by one.
#[test]
fn a_shift_by_integer_pixels_shifts_the_points() {
    // The vertical shift differs from the number of rows in a block.
    let (size, shift) = ([193, 177], [32, 16]);
    every("gaussian", |name, detector| {
        let big = shown(name, 225, 193);
        let (one, other) = (cut(&big, [0, 0], size), cut(&big, shift, size));
        let mut all = detector.detect(&one);
        all.iter_mut().for_each(|p| p.at = Pixel { u: p.at.u - shift[0] as f64, v: p.at.v - shift[1] as f64 });
        let shared = [size[0] - shift[0], size[1] - shift[1]].map(|n| n as f64);
        let inner = |p: &&Keypoint| {
            let margin = 10.0 * f64::from(p.scale) + 3.0;
            let inside = |x: f64, n: f64| x > margin && x < n - margin;
            inside(p.at.u, shared[0]) && inside(p.at.v, shared[1])
        };
        let found = detector.detect(&other);
        let (a, b): (Vec<_>, Vec<_>) = (all.iter().filter(inner).collect(), found.iter().filter(inner).collect());
        assert!(a.len() > 15, "{name}: only {}", a.len());
        let copied = |points: Vec<&Keypoint>| points.into_iter().copied().collect::<Vec<_>>();
        within(name, &copied(a), &found, rounding(name, false));
        within(name, &copied(b), &all, rounding(name, false));
    });
}

/// P56. An offset of 40 grey levels without clipping changes nothing.
///
/// Seen to fail when one pixel of the gradient's six counts a thousandth more.
#[test]
fn more_light_everywhere_changes_nothing() {
    every("gaussian", |name, detector| {
        let image = shown(name, 129, 97);
        let brighter = image.pixels().iter().map(|p| p + 40.0).collect();
        let brighter = Image::new(129, 97, brighter).unwrap();
        same(name, &detector.detect(&image), &detector.detect(&brighter), rounding(name, false));
    });
}

/// P57. A flat image has no key points.
///
/// Seen to fail when the size of the image is not compared with the operator's.
#[test]
fn an_image_without_structure_has_no_point() {
    every("gaussian", |name, detector| {
        for (width, height) in [(1, 1), (2, 2), (1, 50), (50, 2), (64, 48), (300, 3)] {
            for level in [0.0, 128.0, 255.0, 65535.0] {
                let flat = Image::new(width, height, vec![level; width * height]).unwrap();
                assert_eq!(detector.detect(&flat), [], "{name} {width}×{height} of {level}");
            }
        }
    });
}

/// Any size and any finite values are valid.
///
/// Seen to fail when an image may be as small as one margin of the operator.
#[test]
fn any_size_and_any_finite_values_are_an_image() {
    every("gaussian", |name, detector| {
        for (width, height) in (1..24).flat_map(|n| [(n, n), (n, 40), (90, n)]) {
            for (scale, offset) in [(1.0, 0.0), (1e36, -1e38), (1e-40, 0.0)] {
                let pixels = shown(name, width, height).pixels().iter().map(|p| p * scale + offset).collect();
                for point in detector.detect(&Image::new(width, height, pixels).unwrap()) {
                    let inside = |x: f64, n: usize| x > -1.0 && x < n as f64;
                    assert!(inside(point.at.u, width) && inside(point.at.v, height), "{name}: {point:?}");
                }
            }
        }
    });
}

/// Results do not depend on threads or on earlier images, brighter or darker.
///
/// Seen to fail when the strongest response of the previous image remains, and when rows are not moved.
#[test]
fn threads_and_memory_change_no_bit() {
    for listing in DETECTORS.listings() {
        let sizes = [(190, 150), (40, 90), (5, 5), (190, 150), (300, 70)];
        let mut images = sizes.map(|(width, height)| shown(listing.name, width, height));
        images[1].pixels_mut().iter_mut().for_each(|pixel| *pixel *= 0.3);
        let detector = DETECTORS.build(&Choice::named(listing.name)).unwrap();
        for threads in [Threads::One, Threads::Pool] {
            let (mut work, mut found) = (Workspace::new(threads), Vec::new());
            for image in &images {
                detector.detect_into(image, &mut work, &mut found);
                assert_eq!(found, detector.detect(image), "{}", listing.name);
                assert!(found.windows(2).all(|w| w[0].response >= w[1].response), "{}", listing.name);
            }
        }
    }
}

/// The maximum number of key points is respected.
///
/// Seen to fail when one more is kept.
#[test]
fn the_budget_is_kept() {
    for listing in DETECTORS.listings().iter().filter(|listing| listing.table.defaults.contains_key("features")) {
        let image = shown(listing.name, 190, 150);
        for features in [1, 17, 40] {
            let detector = DETECTORS.build(&Choice::named(listing.name).with("features", features)).unwrap();
            assert_eq!(detector.detect(&image).len(), features as usize, "{}", listing.name);
        }
    }
}
