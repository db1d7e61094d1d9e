//! The parts of an object that may be displaced against the rest.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

/// Maximum number of points at which a set is cut after every point.
const EVERY_CUT: usize = 13;
/// The cuts of a larger set, in twelfths of its points.
const CUTS: [usize; 5] = [4, 5, 6, 7, 8];
/// Points whose positions along a direction differ by less than this fraction of their extent are not separated.
const SAME: f64 = 1e-6;

/// The parts on one side of a plane across the points, as ascending lists of indices.
///
/// The normals are the principal axes of the points, their diagonals in pairs and their diagonals in threes: thirteen
/// directions, no direction in space farther than 28° from one of them. A part has at least two points and at most two
/// thirds; beyond that the rest would be the part. A single displaced point is a wrong match, which solution separation
/// covers. Sets of more than [`EVERY_CUT`] points are cut at [`CUTS`]: a bend that a slightly different plane divides
/// is found by most of its points.
pub(super) fn parts(points: &[Vector3<f64>]) -> Vec<Vec<usize>> {
    let n = points.len();
    let max = n - n.div_ceil(3);
    let cuts: Vec<usize> = match n {
        0..=EVERY_CUT => (1..n).collect(),
        _ => CUTS.iter().map(|twelfths| (n * twelfths + 6) / 12).collect(),
    };
    let centre = points.iter().sum::<Vector3<f64>>() / n.max(1) as f64;
    let moments: Matrix3<f64> = points.iter().map(|at| (at - centre) * (at - centre).transpose()).sum();
    if !moments.iter().all(|x| x.is_finite()) {
        return Vec::new();
    }
    let extent = moments.trace().sqrt();
    let axes = moments.symmetric_eigen().eigenvectors;
    let mut all = BTreeSet::new();
    for direction in directions() {
        let normal = axes * direction;
        let mut along: Vec<(f64, usize)> =
            points.iter().enumerate().map(|(k, at)| ((at - centre).dot(&normal), k)).collect();
        along.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for &cut in &cuts {
            if !(along[cut].0 - along[cut - 1].0 > SAME * extent) {
                continue;
            }
            let (below, above) = along.split_at(cut);
            for side in [below, above].into_iter().filter(|side| (2..=max).contains(&side.len())) {
                let mut part: Vec<usize> = side.iter().map(|(_, k)| *k).collect();
                part.sort_unstable();
                all.insert(part);
            }
        }
    }
    all.into_iter().collect()
}

/// The thirteen directions of a cube: faces, edges and corners, one of each opposite two.
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let steps = || [-1.0, 0.0, 1.0].into_iter();
    let all = steps().flat_map(move |x| steps().flat_map(move |y| steps().map(move |z| Vector3::new(x, y, z))));
    all.filter(|v| (v.x, v.y, v.z) > (0.0, 0.0, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_sides_of_planes_of_two_points_to_two_thirds() {
        assert_eq!(directions().count(), 13);
        let at = |k: usize| Vector3::new((k as f64 * 1.3).sin(), (k as f64 * 0.7).cos(), 0.1 * (k * k % 7) as f64);
        for n in [4, 5, 8, 13, 14, 50] {
            let points: Vec<_> = (0..n).map(at).collect();
            let all = parts(&points);
            assert!(all.len() >= 3, "{n}: {}", all.len());
            for part in &all {
                assert!(part.len() >= 2 && 3 * part.len() <= 2 * n, "{n}: {part:?}");
                assert!(part.windows(2).all(|two| two[0] < two[1]));
            }
        }
        // Beyond thirteen points: two sides of five cuts in thirteen directions at most.
        assert!(parts(&(0..50).map(at).collect::<Vec<_>>()).len() <= 130);
    }

    /// Points of a plane: a direction normal to it separates none of them.
    ///
    /// Seen to fail if the tolerance is relative to the extent along the direction.
    #[test]
    fn a_plane_is_not_divided_by_its_rounding() {
        let at = |k: usize| Vector3::new((k % 3) as f64, (k / 3) as f64, 1e-12 * (k * k % 5) as f64);
        let points: Vec<_> = (0..9).map(at).collect();
        let all = parts(&points);
        assert!(!all.is_empty());
        for part in all {
            // A side of a line: no point of the rest lies within the convex hull of the part's columns in every row.
            let rows: Vec<Vec<usize>> =
                (0..3).map(|row| part.iter().filter(|k| *k / 3 == row).map(|k| k % 3).collect()).collect();
            assert!(rows.iter().all(|row| row.windows(2).all(|two| two[1] == two[0] + 1)), "{part:?}");
        }
    }

    #[test]
    fn few_or_coincident_points_have_none() {
        for n in 0..3 {
            assert!(parts(&vec![Vector3::x(); n]).is_empty(), "{n}");
        }
        assert!(parts(&[Vector3::zeros(); 8]).is_empty());
        assert!(parts(&[Vector3::new(f64::NAN, 0.0, 0.0); 8]).is_empty());
    }
}
