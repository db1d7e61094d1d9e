//! Representative samples of a cloud.

use nalgebra::Vector3;
use seafix_geometry::MeasuredPoint;

use super::coordinates::coordinates;

/// Decimates the points to at most `max`, evenly spaced by distance from their centroid, in this order.
///
/// The sample does not depend on the numbering of the points, nor on a rigid motion of the cloud, except for distances
/// equal to seven digits (sums in another order may differ in the last), which the coordinates order.
pub(crate) fn spread_sample(cloud: &[MeasuredPoint], points: &mut Vec<usize>, max: usize) {
    let place = |j: usize| coordinates(&cloud[j]);
    let centroid = points.iter().map(|&j| place(j)).sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let distance = |j: usize| (place(j) - centroid).norm_squared() as f32;
    let mut known: Vec<(f32, usize)> = points.iter().map(|&j| (distance(j), j)).collect();
    known.sort_unstable_by(|(near, i), (far, j)| {
        let coordinate = |axis: usize| place(*i)[axis].total_cmp(&place(*j)[axis]);
        near.total_cmp(far).then_with(|| coordinate(0)).then_with(|| coordinate(1)).then_with(|| coordinate(2))
    });
    let (count, left) = (known.len(), known.len().min(max));
    points.clear();
    points.extend((0..left).map(|k| known[(2 * k + 1) * count / (2 * left)].1));
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Rotation3};
    use seafix_geometry::UncertainPoint;

    use super::*;

    fn at(places: impl Iterator<Item = Vector3<f64>>) -> Vec<MeasuredPoint> {
        let covariance = Matrix3::identity();
        places
            .map(|at| MeasuredPoint { position: UncertainPoint { at: at.into(), covariance }, pixels: None })
            .collect()
    }

    #[test]
    fn it_is_spread_over_all_distances() {
        // Their centroid is the origin.
        let cloud =
            at([5.0, -5.0, 1.0, -1.0, 4.0, -4.0, 2.0, -2.0, 3.0, -3.0].map(|x| Vector3::new(x, 0.0, 0.0)).into_iter());
        let mut all: Vec<usize> = (0..10).collect();
        spread_sample(&cloud, &mut all, 10);
        assert_eq!(all, [3, 2, 7, 6, 9, 8, 5, 4, 1, 0]);
        spread_sample(&cloud, &mut all, 2);
        assert_eq!(all, [7, 4]);
        spread_sample(&cloud, &mut Vec::new(), 2);
    }

    /// Fails if the distances are from the origin.
    #[test]
    fn a_motion_of_the_cloud_leaves_it() {
        let step = |k: usize| Vector3::new(0.37 * k as f64, (k * k) as f64 * 0.011, (0.7 * k as f64).sin());
        let turn = Rotation3::from_euler_angles(0.4, -1.1, 2.0);
        let (here, there) =
            (at((0..300).map(step)), at((0..300).map(|k| turn * step(k) + Vector3::new(7.0, -3.0, 40.0))));
        let (mut some, mut moved): (Vec<usize>, Vec<usize>) = ((0..300).collect(), (0..300).rev().collect());
        spread_sample(&here, &mut some, 50);
        spread_sample(&there, &mut moved, 50);
        assert_eq!((some.len(), some), (50, moved));
    }
}
