//! Points and lines that a file lists more than once.

use std::collections::HashMap;

use seafix_geometry::{MeasuredLine, Point};

use crate::site::check::COINCIDENT;

/// For each point the index of the first point at the same place, to a micrometre.
pub(super) fn firsts<F>(points: impl Iterator<Item = Point<F>>) -> Vec<usize> {
    let mut known = HashMap::new();
    points.enumerate().map(|(index, at)| *known.entry(place(at)).or_insert(index)).collect()
}

/// For each line the index of the first line with the same ends, to a micrometre and in either order.
pub(super) fn first_lines(lines: &[MeasuredLine]) -> Vec<usize> {
    let mut known = HashMap::new();
    let ends = |line: &MeasuredLine| {
        let mut ends = line.ends.map(place);
        ends.sort_unstable();
        ends
    };
    lines.iter().enumerate().map(|(index, line)| *known.entry(ends(line)).or_insert(index)).collect()
}

fn place<F>(at: Point<F>) -> [i64; 3] {
    // A conversion of a float that is too large gives the greatest integer: such points are out of range anyway.
    [at.coords.x, at.coords.y, at.coords.z].map(|x| (x / COINCIDENT).round() as i64)
}

/// The pairs with every repeated point replaced by its first, each once.
///
/// One place has one identity: a point that is listed anew for each pair which uses it would otherwise serve many
/// points of the other side at once, and each would count as evidence.
pub(super) fn merged(
    pairs: impl Iterator<Item = (usize, usize)>,
    models: &[usize],
    clouds: &[usize],
) -> Vec<(usize, usize)> {
    let mut known = std::collections::HashSet::new();
    pairs.map(|(i, j)| (models[i], clouds[j])).filter(|pair| known.insert(*pair)).collect()
}

#[cfg(test)]
mod tests {
    use seafix_geometry::Camera;

    use super::*;

    /// Fails if a repeated point keeps its own index.
    #[test]
    fn a_repeated_point_takes_part_as_its_first() {
        let at = |x: f64| Point::<Camera>::new(x, 0.0, 3.0);
        let firsts = firsts([0.0, 1.0, -0.0, 1.0 + 1e-9, 2.0].map(at).into_iter());
        assert_eq!(firsts, [0, 1, 0, 1, 4]);
        let pairs = [(0, 0), (1, 2), (0, 2), (2, 4)];
        assert_eq!(merged(pairs.into_iter(), &[0, 1, 2], &firsts), [(0, 0), (1, 0), (2, 4)]);
    }
}
