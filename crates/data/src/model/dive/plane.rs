//! The plane of the seabed.

use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

/// A plane n · p = d with the scatter of the points about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    normal: Vector3<f64>,
    offset: f64,
    /// The robust standard deviation of the points' distances (m).
    pub(super) sigma: f64,
}

/// The number of drawn planes: with a third of the points on the seabed, all draws fail once in 10⁴.
const DRAWS: usize = 250;
/// The distance (m) of a point on the seabed from its plane: ripples and stones.
const RELIEF: f64 = 0.05;
/// The factor from the median of absolute values to the standard deviation of a normal distribution.
const FROM_MEDIAN: f64 = 1.4826;

impl Plane {
    /// The plane near the largest number of points (RANSAC), fitted to them; `None` with fewer than three points.
    pub(super) fn through(points: &[Vector3<f64>]) -> Option<Self> {
        if points.len() < 3 {
            return None;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(points.len() as u64);
        let mut best: Option<(usize, Self)> = None;
        for _ in 0..DRAWS {
            let [a, b, c] = [(); 3].map(|()| points[rng.random_range(0..points.len())]);
            let Some(normal) = (b - a).cross(&(c - a)).try_normalize(1e-9) else { continue };
            let plane = Self { normal, offset: normal.dot(&a), sigma: RELIEF };
            let count = points.iter().filter(|point| plane.distance(point).abs() <= RELIEF).count();
            if best.is_none_or(|(count_before, _)| count > count_before) {
                best = Some((count, plane));
            }
        }
        let plane = best?.1;
        let near: Vec<Vector3<f64>> =
            points.iter().copied().filter(|point| plane.distance(point).abs() <= RELIEF).collect();
        Some(Self::fitted(&near))
    }

    /// The plane of the minimum squared distances.
    fn fitted(points: &[Vector3<f64>]) -> Self {
        let centre = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let scatter: Matrix3<f64> = points.iter().map(|point| (point - centre) * (point - centre).transpose()).sum();
        let eigen = scatter.symmetric_eigen();
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        let plane = Self { normal, offset: normal.dot(&centre), sigma: 0.0 };
        let mut distances: Vec<f64> = points.iter().map(|point| plane.distance(point).abs()).collect();
        distances.sort_by(f64::total_cmp);
        Self { sigma: FROM_MEDIAN * distances[distances.len() / 2], ..plane }
    }

    /// The signed distance (m).
    pub(super) fn distance(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plane_is_that_of_the_seabed_and_not_of_the_boxes_on_it() {
        let at = |k: usize| {
            let (x, y) = ((k * 37 % 100) as f64 * 0.05, (k * 61 % 100) as f64 * 0.05);
            let rises = if k.is_multiple_of(2) { 0.004 * ((k % 7) as f64 - 3.0) } else { 0.3 + 0.01 * (k % 50) as f64 };
            Vector3::new(x, y, 0.1 * x + rises)
        };
        let points: Vec<Vector3<f64>> = (0..200).map(at).collect();
        let plane = Plane::through(&points).unwrap();
        assert!(plane.distance(&Vector3::new(1.0, 1.0, 0.1)).abs() < 0.005 && plane.sigma < 0.02, "{plane:?}");
        assert!(plane.distance(&Vector3::new(1.0, 1.0, 0.5)).abs() > 0.35);
        assert!(Plane::through(&points[..2]).is_none());
    }
}
