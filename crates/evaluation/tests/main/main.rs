//! Numbers of other programs, and of hand calculation, that this crate meets.
//!
//! `../fixtures` holds each table beside the script that made it.

#![expect(clippy::unwrap_used, reason = "a test that cannot read its table has failed")]

mod bootstrap;
mod pose;
mod probability;
mod trajectory;

/// The numbers of the line `key: …` of a table.
fn numbers(table: &str, key: &str) -> Vec<f64> {
    let line = table.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(':'));
    let line = line.unwrap_or_else(|| panic!("the table has no line {key}"));
    line.split_whitespace().map(|number| number.parse().unwrap()).collect()
}

/// What stands behind `prefix` in the keys of a table.
fn names<'a>(table: &'a str, prefix: &'a str) -> impl Iterator<Item = &'a str> {
    table.lines().filter_map(move |line| line.strip_prefix(prefix)?.split(':').next())
}

/// Every number within `tolerance` of the wanted one, relative to the largest wanted.
fn near(found: &[f64], wanted: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    let size = wanted.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    for (i, (a, b)) in found.iter().zip(wanted).enumerate() {
        assert!((a - b).abs() <= tolerance * size, "{what}, number {i}: {a}, not {b}");
    }
}
