//! Tests of invalid settings and their messages.

use seafix_component::{Choice, Registry};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, FILTERS, LOCATORS, MATCHERS, REFINEMENTS, SEGMENT_DETECTORS, SEGMENT_MATCHERS,
    TRIANGULATORS, Tracker,
};

const NO_NUMBERS: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

/// The error message of a registry for a choice; `None` if it is valid.
fn rejection<T: ?Sized>(registry: &Registry<T>, choice: &Choice) -> Option<String> {
    registry.build(choice).err().map(|error| error.to_string())
}

/// Asserts that the defaults are valid and that no numeric setting may be NaN or infinite.
fn numbers_must_be_numbers<T: ?Sized>(registry: &Registry<T>) {
    for listing in registry.listings() {
        registry.build(&Choice::named(listing.name)).expect("valid defaults");
        for (key, _) in listing.table.defaults.iter().filter(|(_, default)| default.is_float()) {
            for bad in NO_NUMBERS {
                let message = rejection(registry, &Choice::named(listing.name).with(key, bad)).unwrap_or_default();
                assert!(
                    message.contains(&format!("{key} = {bad}; give ")),
                    "{} {key} = {bad}: {message:?}",
                    listing.name
                );
            }
        }
    }
}

#[test]
fn no_number_is_no_setting() {
    numbers_must_be_numbers(&DETECTORS);
    numbers_must_be_numbers(&FILTERS);
    numbers_must_be_numbers(&DESCRIPTORS);
    numbers_must_be_numbers(&LOCATORS);
    numbers_must_be_numbers(&MATCHERS);
    numbers_must_be_numbers(&REFINEMENTS);
    numbers_must_be_numbers(&TRIANGULATORS);
    numbers_must_be_numbers(&SEGMENT_DETECTORS);
    numbers_must_be_numbers(&SEGMENT_MATCHERS);
}

/// Asserts that the values `inside` of a setting are accepted and those `beyond` are rejected with its name.
fn range<T: ?Sized>(registry: &Registry<T>, name: &str, key: &str, inside: &[f64], beyond: &[f64]) {
    for &value in inside {
        assert_eq!(rejection(registry, &Choice::named(name).with(key, value)), None, "{key} = {value}");
    }
    for &value in beyond {
        let message = rejection(registry, &Choice::named(name).with(key, value)).unwrap_or_default();
        assert!(message.contains(&format!("`{name}`: {key} = {value}; give ")), "{key} = {value}: {message:?}");
    }
}

#[test]
fn harris_rejects_what_finds_nothing() {
    range(&DETECTORS, "harris", "sigma", &[0.3, 100.0], &[0.0, 0.01, 0.29, -1.0, 101.0]);
    range(&DETECTORS, "harris", "k", &[0.0, 0.24], &[-0.04, 0.25]);
    range(&DETECTORS, "harris", "quality", &[0.0, 1.0], &[-0.1, 1.1]);
    assert_eq!(
        rejection(&DETECTORS, &Choice::named("harris").with("features", 0)).unwrap(),
        "detector `harris`: features = 0; give at least 1"
    );
    // Seen to fail without an upper limit of the radius: 10¹² was accepted.
    for name in ["fast", "harris", "shi-tomasi"] {
        assert_eq!(rejection(&DETECTORS, &Choice::named(name).with("radius", 1000)), None);
        let message =
            rejection(&DETECTORS, &Choice::named(name).with("radius", 1_000_000_000_000_i64)).unwrap_or_default();
        assert_eq!(message, format!("detector `{name}`: radius = 1000000000000; give at most 1000 (px)"));
    }
    assert!(rejection(&DETECTORS, &Choice::named("harris").with("radius", -1)).is_some());
    assert!(rejection(&DETECTORS, &Choice::named("harris").with("cells", 0)).unwrap().contains("give at least 1"));
}

#[test]
fn detectors_refuse_what_finds_nothing() {
    range(&DETECTORS, "shi-tomasi", "sigma", &[0.3, 100.0], &[0.0, 0.01, 0.29, -1.0, 101.0]);
    range(&DETECTORS, "shi-tomasi", "quality", &[0.0, 1.0], &[-0.1, 1.1]);
    range(&DETECTORS, "fast", "threshold", &[0.0, 65535.0], &[-1.0, 1e6]);
    for name in ["fast", "shi-tomasi"] {
        for key in ["features", "cells"] {
            let message = rejection(&DETECTORS, &Choice::named(name).with(key, 0)).unwrap_or_default();
            assert_eq!(message, format!("detector `{name}`: {key} = 0; give at least 1"));
        }
        for selection in ["strongest", "balanced", "adaptive"] {
            assert_eq!(rejection(&DETECTORS, &Choice::named(name).with("selection", selection)), None);
        }
        assert!(rejection(&DETECTORS, &Choice::named(name).with("selection", "best")).is_some());
    }
}

#[test]
fn surf_blobs_refuse_what_finds_nothing() {
    range(&DETECTORS, "surf", "threshold", &[0.0, 1e9], &[-1.0, 2e9]);
    for (key, inside, beyond) in [("octaves", [1, 8], [0, 9]), ("layers", [1, 10], [0, 11])] {
        for value in inside {
            assert_eq!(rejection(&DETECTORS, &Choice::named("surf").with(key, value)), None, "{key} = {value}");
        }
        for value in beyond {
            let message = rejection(&DETECTORS, &Choice::named("surf").with(key, value)).unwrap_or_default();
            assert!(message.contains(&format!("{key} = {value}; give ")), "{message:?}");
        }
    }
}

#[test]
fn descriptors_refuse_a_scale_that_is_none() {
    for name in ["brief", "orb", "surf"] {
        range(&DESCRIPTORS, name, "scale", &[0.0, 1.5, 100.0], &[-1.5, 101.0]);
    }
}

#[test]
fn filters_refuse_what_they_cannot_do() {
    range(&FILTERS, "clahe", "clip", &[1.0, 1000.0], &[0.9, -1.0, 1001.0]);
    range(&FILTERS, "guided", "sigma", &[0.01, 255.0], &[0.0, -5.0, 256.0]);
    range(&FILTERS, "illumination", "sigma", &[1.0, 1000.0], &[0.5, 1001.0]);
    range(&FILTERS, "illumination", "gain", &[1.0, 1000.0], &[0.5, 1001.0]);
    let states =
        |name: &str, key: &str, value: i64| rejection(&FILTERS, &Choice::named(name).with(key, value)).unwrap();
    assert_eq!(states("median", "radius", 3), "filter `median`: radius = 3; give 1 (3×3) or 2 (5×5)");
    assert_eq!(states("clahe", "tiles", 0), "filter `clahe`: tiles = 0; give a number from 1 to 64");
    assert_eq!(states("clahe", "bins", 15), "filter `clahe`: bins = 15; give a number from 16 to 4096");
    assert_eq!(states("guided", "radius", 1001), "filter `guided`: radius = 1001; give a number from 1 to 1000 (px)");
}

#[test]
fn dog_and_sift_refuse_what_they_cannot_do() {
    range(&DETECTORS, "dog", "contrast", &[0.01, 255.0], &[0.0, -1.0, 256.0]);
    range(&DETECTORS, "dog", "edge", &[1.0, 1e6], &[0.5, 1e7]);
    for key in ["features", "cells"] {
        let message = rejection(&DETECTORS, &Choice::named("dog").with(key, 0)).unwrap();
        assert_eq!(message, format!("detector `dog`: {key} = 0; give at least 1"));
    }
    range(&DESCRIPTORS, "sift", "scale", &[0.0, 1.5, 100.0], &[-1.5, 101.0]);
}

#[test]
fn zncc_patch_rejects_what_is_no_window() {
    range(&DESCRIPTORS, "zncc-patch", "step", &[0.1, 100.0], &[0.0, -1.0, 101.0]);
    range(&DESCRIPTORS, "zncc-patch", "sigma", &[0.0, 100.0], &[-1.0, 101.0]);
    for window in [1, 10, 53] {
        let message = rejection(&DESCRIPTORS, &Choice::named("zncc-patch").with("window", window)).unwrap();
        assert!(message.contains(&format!("window = {window}; give an odd number from 3 to 51")), "{message}");
    }
}

#[test]
fn epipolar_band_needs_a_band() {
    range(&MATCHERS, "epipolar-band", "epipolar-px", &[0.1, 1000.0], &[0.0, -1.0, 1001.0]);
    range(&MATCHERS, "epipolar-band", "max-hamming", &[0.1, 1.0], &[0.0, -1.0, 1.1]);
    range(&MATCHERS, "epipolar-band", "min-depth", &[0.0, 49.0], &[-0.1]);
    range(&MATCHERS, "epipolar-band", "max-depth", &[0.2], &[0.1, 0.0, -1.0]);
    assert_eq!(
        rejection(&MATCHERS, &Choice::named("epipolar-band").with("min-depth", 60.0)).unwrap(),
        "matcher `epipolar-band`: max-depth = 50; give a depth beyond min-depth = 60 (m)"
    );
    assert!(rejection(&MATCHERS, &Choice::named("epipolar-band").with("neighbours", 1001)).is_some());
}

#[test]
fn zncc_band_rejects_what_matches_nothing() {
    range(&MATCHERS, "zncc-band", "epipolar-px", &[0.1, 100.0], &[0.0, -1.0, 101.0]);
    range(&MATCHERS, "zncc-band", "ratio", &[0.1, 1.0], &[0.0, -1.0, 1.1]);
    range(&MATCHERS, "zncc-band", "min-correlation", &[-1.0, 1.0], &[-1.1, 1.1]);
    range(&MATCHERS, "zncc-band", "min-depth", &[0.1, 49.0], &[0.0, -0.1]);
    for window in [1, 10, 53] {
        let message = rejection(&MATCHERS, &Choice::named("zncc-band").with("window", window)).unwrap();
        assert!(
            message.contains(&format!("window = {window}; give an odd number of pixels from 3 to 51")),
            "{message}"
        );
    }
}

#[test]
fn fitted_corners_refuse_what_finds_nothing() {
    for name in ["l-corner", "x-corner"] {
        range(&DETECTORS, name, "sigma", &[0.3, 100.0], &[0.0, 0.01, 0.29, 101.0]);
        range(&DETECTORS, name, "quality", &[0.0, 1.0], &[-0.1, 1.1]);
        for key in ["candidates", "features", "cells"] {
            let message = rejection(&DETECTORS, &Choice::named(name).with(key, 0)).unwrap_or_default();
            assert_eq!(message, format!("detector `{name}`: {key} = 0; give at least 1"));
        }
    }
}

#[test]
fn mutual_ratio_rejects_what_matches_nothing() {
    range(&MATCHERS, "mutual-ratio", "ratio", &[0.1, 1.0], &[0.0, -1.0, 1.1]);
    range(&MATCHERS, "mutual-ratio", "max-distance", &[0.1, 2.0], &[0.0, -0.7, 2.1]);
    assert!(
        rejection(&MATCHERS, &Choice::named("mutual-ratio").with("epipolar-px", 1.0)).is_some(),
        "a setting of another matcher is accepted"
    );
}

#[test]
fn lucas_kanade_rejects_what_follows_nothing() {
    range(&MATCHERS, "lucas-kanade", "epipolar-px", &[0.1, 1000.0], &[0.0, -1.0, 1001.0]);
    range(&MATCHERS, "lucas-kanade", "min-depth", &[0.1, 49.0], &[0.0, -0.1]);
    range(&MATCHERS, "lucas-kanade", "max-depth", &[0.2], &[0.1, 0.0]);
    assert!(rejection(&MATCHERS, &Choice::named("lucas-kanade").with("places", 0)).is_some());
    for (tracker, key) in [
        (Tracker { window: 4, ..Tracker::default() }, "window"),
        (Tracker { levels: 0, ..Tracker::default() }, "levels"),
        (Tracker { reach: f64::NAN, ..Tracker::default() }, "reach"),
        (Tracker { min_correlation: 1.5, ..Tracker::default() }, "min-correlation"),
        (Tracker { return_px: -1.0, ..Tracker::default() }, "return-px"),
        (Tracker { iterations: 0, ..Tracker::default() }, "iterations"),
    ] {
        let message = tracker.check().expect_err(key);
        assert!(message.starts_with(&format!("{key} = ")), "{message:?}");
    }
}

#[test]
fn refinements_refuse_what_refines_nothing() {
    range(&REFINEMENTS, "direct", "reach", &[0.1, 100.0], &[0.0, -2.0, 101.0]);
    range(&REFINEMENTS, "zncc-parabola", "floor-px", &[0.0, 10.0], &[-0.1, 11.0]);
    let states = |name: &str, key: &str, value: i64| rejection(&REFINEMENTS, &Choice::named(name).with(key, value));
    for (name, max) in [("direct", 201), ("zncc-parabola", 51)] {
        range(&REFINEMENTS, name, "min-correlation", &[-1.0, 1.0], &[-2.0, 101.0]);
        for window in [0, 1, 10, max + 2] {
            let message = states(name, "window", window).unwrap_or_default();
            assert!(
                message.contains(&format!("`{name}`: window = {window}; give an odd number of pixels")),
                "{message:?}"
            );
        }
        for window in [3, max] {
            assert_eq!(states(name, "window", window), None);
        }
        let choice = Choice::named(name).with("unaligned", "keep");
        assert_eq!(rejection(&REFINEMENTS, &choice), None);
    }
    assert!(states("direct", "iterations", 0).unwrap_or_default().contains("iterations = 0; give "));
    for reach in [0, 8] {
        let message = states("zncc-parabola", "reach", reach).unwrap_or_default();
        assert!(message.contains(&format!("reach = {reach}; give a number from 1 to 7 (px)")), "{message:?}");
    }
    assert!(states("none", "window", 11).is_some());
}

#[test]
fn triangulators_refuse_what_gives_no_point() {
    for name in TRIANGULATORS.names() {
        range(&TRIANGULATORS, name, "sigma-px", &[0.01, 100.0], &[0.0, -1.0, 101.0]);
        range(&TRIANGULATORS, name, "calibration-px", &[0.0, 100.0], &[-1.0, 101.0]);
        range(&TRIANGULATORS, name, "epipolar-px", &[0.1, 1000.0], &[0.0, -1.0, 1001.0]);
        range(&TRIANGULATORS, name, "confidence", &[0.5, 1.0], &[0.0, -1.0, 1.1]);
        range(&TRIANGULATORS, name, "max-depth", &[0.5, 1e4], &[0.0, -1.0]);
    }
}

#[test]
fn junction_rejects_a_window_that_is_none() {
    range(&LOCATORS, "junction", "sigma", &[0.3, 100.0], &[0.0, 0.01, 0.29, -2.5, 101.0]);
}

#[test]
fn fits_of_corners_refuse_what_cannot_be_fitted() {
    for name in ["corner", "l-corner", "x-corner"] {
        range(&LOCATORS, name, "reach", &[0.1, 10.0], &[0.0, 10.1]);
        range(&LOCATORS, name, "contrast", &[0.0, 255.0], &[-1.0, 256.0]);
        range(&LOCATORS, name, "explained", &[0.0, 1.0], &[-0.1, 1.1]);
        for window in [5, 12, 33] {
            let message = rejection(&LOCATORS, &Choice::named(name).with("window", window)).unwrap_or_default();
            assert!(message.contains(&format!("`{name}`: window = {window}; give an odd number")), "{message:?}");
        }
    }
}
