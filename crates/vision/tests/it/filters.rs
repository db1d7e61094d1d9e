//! Properties of all filters.

use seafix_component::Choice;
use seafix_vision::{FILTERS, Filter, Image, Threads, Workspace};

/// Each filter with its defaults, and with other settings that select other code.
fn filters() -> Vec<(String, Box<dyn Filter>)> {
    let mut choices: Vec<Choice> = FILTERS.names().map(Choice::named).collect();
    choices.push(Choice::named("median").with("radius", 2));
    choices.push(Choice::named("illumination").with("operation", "subtract").with("sigma", 3.0));
    choices.push(Choice::named("clahe").with("bins", 4096).with("clip", 20.0));
    choices.into_iter().map(|choice| (format!("{choice:?}"), FILTERS.build(&choice).unwrap())).collect()
}

/// Speckle over steps, 0 to 255.
fn texture(width: usize, height: usize) -> Image {
    let hash = |i: usize| (i as u32).wrapping_mul(0x9E37_79B1).rotate_left(13).wrapping_mul(0x85EB_CA77) >> 24;
    let value = |x: usize, y: usize| (0.5 * (hash(x / 9 + 31 * (y / 9)) + hash(x + 1009 * y)) as f32).min(255.0);
    Image::new(width, height, (0..width * height).map(|i| value(i % width, i / width)).collect()).unwrap()
}

/// A constant image stays constant.
///
/// Seen to fail when a mean counts one pixel too many.
#[test]
fn a_constant_image_stays_constant() {
    for (name, filter) in filters() {
        for value in [0.0, 1.0, 100.3, 254.9, 255.0] {
            for (width, height) in [(1, 1), (2, 2), (3, 90), (200, 150)] {
                let out = filter.filtered(&Image::new(width, height, vec![value; width * height]).unwrap());
                let first = out.pixels()[0];
                assert!(out.pixels().iter().all(|p| (p - first).abs() < 1e-3), "{name}, {value}, {width}×{height}");
                if !name.contains("clahe") {
                    assert!((first - value).abs() < 1e-3, "{name}: {first}, not {value}");
                }
            }
        }
    }
}

/// Results are finite and within 0 to 255.
///
/// Seen to fail when values above white are not clipped.
#[test]
fn what_comes_out_is_finite_and_within_the_range() {
    let extreme = |i: usize| [0.0, f32::MAX, -f32::MAX, 1e-40, 255.0, -1.0, 65535.0][i % 7];
    for (name, filter) in filters() {
        for (width, height) in [(1, 1), (2, 2), (1, 40), (70, 1), (9, 8), (131, 77)] {
            let out = filter.filtered(&texture(width, height));
            assert_eq!([out.width(), out.height()], [width, height]);
            assert!(out.pixels().iter().all(|p| (0.0..=255.0).contains(p)), "{name}, {width}×{height}");
            let wild = Image::new(width, height, (0..width * height).map(extreme).collect()).unwrap();
            assert!(filter.filtered(&wild).pixels().iter().all(|p| p.is_finite()), "{name}, {width}×{height}");
        }
    }
}

/// Filters commute with a shift of the image.
///
/// Seen to fail when a band of rows begins without the last row above it.
#[test]
fn an_image_shifted_is_filtered_and_shifted() {
    // The shift is cyclic, which preserves the mean of the image.
    let (width, height, across, down) = (260, 220, 5, 3);
    let image = texture(width, height);
    let pixel = |i: usize| image.row((i / width + down) % height)[(i % width + across) % width];
    let shifted = Image::new(width, height, (0..width * height).map(pixel).collect()).unwrap();
    // The tiles of CLAHE do not shift; σ = 40 px extends over the complete image.
    let local = filters().into_iter().filter(|(_, filter)| {
        let name = format!("{filter:?}");
        !name.contains("Clahe") && !name.contains("sigma: 40.0")
    });
    let reach = 20;
    for (name, filter) in local {
        let (a, b) = (filter.filtered(&image), filter.filtered(&shifted));
        for y in reach..height - reach - down {
            for x in reach..width - reach - across {
                let (expected, found) = (a.row(y + down)[x + across], b.row(y)[x]);
                assert!((expected - found).abs() < 1e-3, "{name} at {x}, {y}: {found}, not {expected}");
            }
        }
    }
}

/// Results do not depend on threads or earlier contents of the workspace.
///
/// Seen to fail when a histogram keeps earlier counts, and when a band takes the rows of the first.
#[test]
fn threads_and_memory_change_nothing() {
    let images = [texture(150, 333), texture(40, 30), texture(301, 170)];
    for (name, filter) in filters() {
        let mut used = [Workspace::new(Threads::One), Workspace::new(Threads::Pool)];
        for image in &images {
            let expected = filter.filtered(image);
            // The background under a σ wider than the image is its mean.
            assert!(image.width() < 100 || expected != *image, "{name} changes nothing");
            for work in &mut used {
                let mut copy = image.clone();
                filter.apply(&mut copy, work);
                assert!(copy == expected, "{name}, {work:?}");
            }
        }
    }
}
