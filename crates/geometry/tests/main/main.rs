//! Comparison of this crate with other programs and with hand calculation.
//!
//! `../fixtures` holds each table beside the script that made it.

#![expect(clippy::unwrap_used, reason = "a test that cannot read its table has failed")]

mod fisheye;
mod lens;
mod motion;
mod rig;
mod rotation;

/// The numbers of the line `key: …` of a table.
fn numbers(table: &str, key: &str) -> Vec<f64> {
    let line = table.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(':'));
    let line = line.unwrap_or_else(|| panic!("the table has no line {key}"));
    line.split_whitespace().map(|number| number.parse().unwrap()).collect()
}

/// The rest of each key that begins with `prefix`.
fn names<'a>(table: &'a str, prefix: &'a str) -> impl Iterator<Item = &'a str> {
    table.lines().filter_map(move |line| line.strip_prefix(prefix)?.split(':').next())
}

/// Asserts that every number is within `tolerance` of its expected value, relative to the largest expected one.
fn near(found: &[f64], wanted: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    let size = wanted.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    for (i, (a, b)) in found.iter().zip(wanted).enumerate() {
        assert!((a - b).abs() <= tolerance * size, "{what}, number {i}: {a}, expected {b}");
    }
}
