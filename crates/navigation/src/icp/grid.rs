//! Nearest-neighbour search in a voxel grid.

use std::collections::HashMap;

use nalgebra::Vector3;

/// Points in cubic voxels with the reach as edge length; neighbours lie in the same or an adjacent voxel.
#[derive(Debug)]
pub(super) struct Grid {
    points: Vec<Vector3<f64>>,
    side: f64,
    cubes: HashMap<[i64; 3], Vec<usize>>,
}

impl Grid {
    /// A grid for queries within `reach` (m).
    pub(super) fn new(points: Vec<Vector3<f64>>, reach: f64) -> Self {
        let mut cubes: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
        for (index, at) in points.iter().enumerate() {
            cubes.entry(cube(at, reach)).or_default().push(index);
        }
        Self { points, side: reach, cubes }
    }

    /// All points within `reach` with their squared distances; `reach` must not exceed that of the grid.
    ///
    /// The order depends on the cloud alone.
    pub(super) fn within(&self, at: &Vector3<f64>, reach: f64) -> impl Iterator<Item = (usize, f64)> {
        let [x, y, z] = cube(at, self.side);
        let (at, max) = (*at, reach * reach);
        let around =
            (-1..=1).flat_map(move |i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [x + i, y + j, z + k])));
        around
            .filter_map(|cube| self.cubes.get(&cube))
            .flatten()
            .map(move |&index| (index, (self.points[index] - at).norm_squared()))
            .filter(move |(_, far)| *far <= max)
    }

    /// The nearest point within `reach`; the first one of equally near points.
    pub(super) fn nearest(&self, at: &Vector3<f64>, reach: f64) -> Option<(usize, f64)> {
        self.within(at, reach).min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
    }
}

fn cube(at: &Vector3<f64>, side: f64) -> [i64; 3] {
    [at.x, at.y, at.z].map(|x| (x / side).floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_is_that_of_all() {
        // Queries between and outside the points of a spiral.
        let spiral = |k: f64| Vector3::new(libm::cos(k), libm::sin(k), 0.05 * k) * (1.0 + 0.02 * k);
        let points: Vec<Vector3<f64>> = (0..200).map(|k| spiral(0.37 * f64::from(k))).collect();
        let grid = Grid::new(points.clone(), 0.5);
        for k in 0..300 {
            let at = spiral(0.21 * f64::from(k)) + Vector3::new(0.1, -0.07, 0.03);
            for reach in [0.5, 0.2] {
                let all = points.iter().map(|p| (p - at).norm_squared()).enumerate();
                let expected = all.filter(|(_, far)| *far <= reach * reach).min_by(|a, b| a.1.total_cmp(&b.1));
                assert_eq!(grid.nearest(&at, reach), expected);
            }
        }
    }
}
