//! Properties of all descriptors.

use seafix_component::Choice;
use seafix_geometry::Pixel;
use seafix_vision::{DESCRIPTORS, Descriptor, Descriptors, Image, Keypoint, Threads, Workspace};

/// Each descriptor with its default settings, and with each Boolean setting inverted.
fn all() -> Vec<(String, Box<dyn Descriptor>)> {
    let build = |choice: &Choice| DESCRIPTORS.build(choice).expect("valid settings");
    let mut all = Vec::new();
    for listing in DESCRIPTORS.listings() {
        let flags: Vec<_> =
            listing.table.defaults.iter().filter_map(|(key, value)| Some((key, value.as_bool()?))).collect();
        for turned in 0..1_usize << flags.len() {
            let mut choice = Choice::named(listing.name);
            for (i, (key, value)) in flags.iter().enumerate() {
                choice = choice.with(key, value ^ (turned >> i & 1 == 1));
            }
            all.push((format!("{} {turned:b}", listing.name), build(&choice)));
        }
    }
    all
}

/// The descriptors with a window of the key point's scale, upright and rotated.
fn at_own_scale() -> Vec<(String, Box<dyn Descriptor>)> {
    let build = |choice: &Choice| DESCRIPTORS.build(choice).expect("valid settings");
    let mut all = Vec::new();
    for listing in DESCRIPTORS.listings().iter().filter(|listing| listing.table.defaults.contains_key("scale")) {
        let own = Choice::named(listing.name).with("scale", 0.0);
        all.push((format!("{} at its own scale", listing.name), build(&own)));
        if listing.table.defaults.contains_key("upright") {
            all.push((format!("{} turned at its own scale", listing.name), build(&own.with("upright", false))));
        }
    }
    all
}

fn image(width: usize, height: usize, f: impl Fn(f64, f64) -> f64) -> Image {
    let pixels = (0..width * height).map(|i| f((i % width) as f64, (i / width) as f64) as f32).collect();
    Image::new(width, height, pixels).expect("width × height pixels")
}

/// Waves of several lengths and directions.
fn waves(x: f64, y: f64) -> f64 {
    let wave = |a: f64, b: f64, c: f64| libm::sin(a * x + b * y + c);
    110.0
        + 35.0 * wave(0.31, 0.1, 0.0)
        + 30.0 * wave(-0.05, 0.23, 1.0)
        + 25.0 * wave(0.17, -0.21, 2.0)
        + 15.0 * wave(0.53, 0.47, 0.5)
}

fn keypoints(width: usize, height: usize) -> Vec<Keypoint> {
    let at = |u: f64, v: f64, scale: f32| Keypoint { at: Pixel { u, v }, response: 1.0, scale };
    let mut points = Vec::new();
    for i in 0..90 {
        let (x, y) = (f64::from(i) * 0.618_034 % 1.0, f64::from(i) * 0.754_878 % 1.0);
        points.push(at(x * width as f64, y * height as f64, 1.2 + (i % 5) as f32));
    }
    points.extend([at(0.0, 0.0, 1.5), at(width as f64 - 1.0, height as f64 - 1.0, 2.0), at(-3.0, 7.5, 1.5)]);
    points
}

/// The distance of two descriptors relative to their magnitude: the largest difference, or the fraction of bits.
fn apart(a: &Descriptors, b: &Descriptors, i: usize) -> f64 {
    match (a, b) {
        (Descriptors::Numbers(a), Descriptors::Numbers(b)) => {
            a.row(i).iter().zip(b.row(i)).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
        }
        (Descriptors::Bits(a), Descriptors::Bits(b)) => {
            let differ: u32 = a.row(i).iter().zip(b.row(i)).map(|(a, b)| (a ^ b).count_ones()).sum();
            f64::from(differ) / (64 * a.length()) as f64
        }
        _ => panic!("descriptors of different kinds"),
    }
}

/// Descriptors are invariant under brightness offset and contrast.
///
/// Seen to fail when a patch keeps its mean.
#[test]
fn light_and_contrast_drop_out() {
    let points = keypoints(120, 90);
    let (plain, lit) = (image(120, 90, waves), image(120, 90, |x, y| 0.5 * waves(x, y) + 64.0));
    for (name, descriptor) in all() {
        let (a, b) = (descriptor.describe(&plain, &points), descriptor.describe(&lit, &points));
        assert_eq!(a.len(), points.len(), "{name}");
        let min = if a.numbers().is_some() { 1e-5 } else { 2.0 / 256.0 };
        for (i, point) in points.iter().enumerate() {
            assert!(apart(&a, &b, i) <= min, "{name}, {:?}: {}", point, apart(&a, &b, i));
        }
    }
}

/// Numbers have unit length, or are zero in a flat region.
///
/// Seen to fail when SURF is divided by the sum of the absolute values.
#[test]
fn numbers_have_unit_length_or_nothing_changes() {
    let points = keypoints(120, 90);
    for (name, descriptor) in all() {
        let described = descriptor.describe(&image(120, 90, waves), &points);
        let flat = descriptor.describe(&image(120, 90, |_, _| 137.3), &points);
        if let (Some(described), Some(flat)) = (described.numbers(), flat.numbers()) {
            for (i, point) in points.iter().enumerate() {
                let norm = described.row(i).iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>();
                assert!((norm - 1.0).abs() < 1e-5, "{name}, {:?}: {norm}", point);
                assert!(flat.row(i).iter().all(|&x| x == 0.0), "{name}, {:?}", point);
            }
        }
    }
}

/// Any key point of any image has a descriptor.
///
/// Seen to fail when pixels beyond the border are read.
#[test]
fn any_image_and_any_key_point_are_described() {
    let mut points = keypoints(3, 3);
    for wild in [f64::NAN, f64::INFINITY, -1e300, 1e300, -5.0] {
        for scale in [1.5, 0.0, -2.0, 1e-30, 1e30, f32::NAN, f32::INFINITY] {
            let at = |u, v| Keypoint { at: Pixel { u, v }, response: 1.0, scale };
            points.extend([at(wild, 1.0), at(1.0, wild), at(1.0, 1.0)]);
        }
    }
    for (name, descriptor) in all() {
        for (width, height) in [(1, 1), (2, 3), (70, 1), (9, 40)] {
            let extremes = |x: f64, _: f64| if x % 2.0 < 1.0 { f64::from(f32::MAX) } else { f64::from(f32::MIN) };
            for image in [image(width, height, waves), image(width, height, extremes)] {
                let described = descriptor.describe(&image, &points);
                assert_eq!(described.len(), points.len(), "{name}");
                if let Some(numbers) = described.numbers() {
                    assert!(numbers.values().iter().all(|x| x.is_finite()), "{name}");
                }
            }
        }
        assert!(descriptor.describe(&image(9, 9, waves), &[]).is_empty(), "{name}");
    }
}

/// Results do not depend on threads or earlier contents of the workspace.
///
/// Seen to fail when the halves of the previous image remain.
#[test]
fn the_result_is_the_same_for_any_threads_and_in_used_memory() {
    let (large, small) = (image(160, 110, waves), image(40, 50, |x, y| waves(3.0 * x, y)));
    // Windows of twice the width; from 6 px on they use the halved images.
    let wide = |points: Vec<Keypoint>| points.into_iter().map(|p| Keypoint { scale: 2.0 * p.scale, ..p }).collect();
    let (many, few): (Vec<_>, Vec<_>) = (wide(keypoints(160, 110)), wide(keypoints(40, 50)));
    for (name, descriptor) in all().into_iter().chain(at_own_scale()) {
        for threads in [Threads::One, Threads::Pool] {
            let (mut work, mut described) = (Workspace::new(threads), Descriptors::default());
            for (image, points) in [(&large, &many[..]), (&small, &few[..7]), (&large, &many)] {
                descriptor.describe_into(image, points, &mut work, &mut described);
                assert_eq!(described, descriptor.describe(image, points), "{name}, {threads:?}");
            }
        }
    }
}

/// Rotated descriptors are invariant under a quarter turn of the image.
///
/// Seen to fail when the pattern rotates in the opposite direction.
#[test]
fn what_turns_with_its_surroundings_follows_a_quarter_turn() {
    let choices = [
        Choice::named("orb"),
        Choice::named("surf").with("upright", false),
        Choice::named("surf").with("upright", false).with("extended", true),
    ];
    let (width, height) = (140, 110);
    let before = image(width, height, waves);
    // A quarter turn moves (x, y) to (y, width − 1 − x).
    let after = image(height, width, |x, y| waves((width - 1) as f64 - y, x));
    let points = keypoints(width, height);
    let turned: Vec<_> =
        points.iter().map(|p| Keypoint { at: Pixel { u: p.at.v, v: (width - 1) as f64 - p.at.u }, ..*p }).collect();
    for choice in choices {
        let descriptor = DESCRIPTORS.build(&choice).expect("valid settings");
        let (a, b) = (descriptor.describe(&before, &points), descriptor.describe(&after, &turned));
        let min = if a.numbers().is_some() { 1e-4 } else { 2.0 / 256.0 };
        for (i, point) in points.iter().enumerate() {
            assert!(apart(&a, &b, i) <= min, "{choice:?}, {:?}: {}", point, apart(&a, &b, i));
        }
    }
}
