//! Marks that contradict each other.

use std::{collections::BTreeMap, path::Path};

use seafix_component::Fault;

use super::{
    find::Found,
    settle::{Key, Settled},
    start::Marked,
};

/// The distance (px) below which two features have one place in an image.
const ONE_PLACE: f64 = 1.0;

/// The faults of marks: two features at one place, and two places of one feature.
pub(super) fn contradictions(
    marked: &[Marked],
    seen: &BTreeMap<Key, Found>,
    settled: &Settled<'_>,
    file: &Path,
) -> Vec<Fault> {
    let mut faults: Vec<Fault> = Vec::new();
    for (index, feature) in marked.iter().enumerate() {
        for (before, other) in marked[..index].iter().enumerate() {
            if are_one(seen, before, index) {
                let lines = [&other, &feature].map(|feature| feature.marks[0].mark.mark.line);
                faults.push(
                    Fault::new("two names of one place", file)
                        .on_line(lines[1])
                        .value(format!("`{}` and `{}` of line {}", feature.id, other.id, lines[0]))
                        .remedy("delete the wrong one of the two lines"),
                );
            }
        }
        for mark in &feature.marks[1..] {
            let first = &feature.marks[0];
            let contradicted = |pair: usize| settled.contradicting.contains_key(&(pair, index));
            if contradicted(mark.pair) || contradicted(first.pair) {
                faults.push(
                    Fault::new("two places of one point", file)
                        .on_line(mark.mark.mark.line)
                        .value(format!("`{}`, also marked on line {}", feature.id, first.mark.mark.line))
                        .remedy("mark the same feature in both pairs, or delete one of the lines"),
                );
            }
        }
    }
    faults
}

/// Whether two features lie at one place in at least half of the pairs that show both.
fn are_one(seen: &BTreeMap<Key, Found>, a: usize, b: usize) -> bool {
    let places = seen.iter().filter(|(key, _)| key.1 == a);
    let both = places.filter_map(|((pair, _), found)| Some((found, seen.get(&(*pair, b))?)));
    let distances: Vec<f64> = both.map(|(one, other)| one.pixels.at.left.distance(&other.pixels.at.left)).collect();
    let near = distances.iter().filter(|distance| **distance < ONE_PLACE).count();
    near > 0 && 2 * near >= distances.len()
}
