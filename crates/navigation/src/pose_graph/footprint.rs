//! The area of the seabed that a key frame shows.

use nalgebra::Point2;
use seafix_geometry::{Camera, Point, Transform, World};

/// A footprint: the convex hull of the visible points, projected on the world's horizontal plane.
///
/// The corners are in order, with the inside to the left of every side.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint(Vec<Point2<f64>>);

/// Maximum distance of a point from the seabed, in robust standard deviations; points beyond it are outliers.
const OFF: f64 = 4.0;

impl Footprint {
    /// The footprint of points seen by a camera.
    ///
    /// The seabed's depth is the median depth of the points; points far from it are ignored.
    pub fn of(points: &[Point<Camera>], world_from_camera: &Transform<World, Camera>) -> Self {
        let seen: Vec<Point<World>> = points.iter().map(|point| *world_from_camera * *point).collect();
        let depths = seen.iter().map(|point| point.coords.z);
        let bottom = median(depths.clone());
        let spread = 1.4826 * median(depths.map(|z| (z - bottom).abs()));
        let near = seen.iter().filter(|point| (point.coords.z - bottom).abs() <= OFF * spread);
        Self(hull(near.map(|point| Point2::new(point.coords.x, point.coords.y)).collect()))
    }

    /// The area (m²).
    pub fn area(&self) -> f64 {
        let n = self.0.len();
        let twice: f64 = (0..n).map(|i| cross(&self.0[i], &self.0[(i + 1) % n])).sum();
        0.5 * twice.abs()
    }

    /// The mean of the corners; `None` without corners.
    pub fn middle(&self) -> Option<Point2<f64>> {
        let sum = self.0.iter().fold(nalgebra::Vector2::zeros(), |sum, corner| sum + corner.coords);
        (!self.0.is_empty()).then(|| Point2::from(sum / self.0.len() as f64))
    }

    /// The footprint, moved by a vector (m).
    #[must_use]
    pub fn moved(&self, by: nalgebra::Vector2<f64>) -> Self {
        Self(self.0.iter().map(|corner| corner + by).collect())
    }

    /// The fraction (0 to 1) of this footprint that the other covers, by Sutherland–Hodgman clipping.
    pub fn covered_by(&self, other: &Self) -> f64 {
        let own = self.area();
        if !(own > 0.0) || other.0.len() < 3 {
            return 0.0;
        }
        let mut left = self.0.clone();
        let n = other.0.len();
        for i in 0..n {
            let (a, b) = (other.0[i], other.0[(i + 1) % n]);
            let side = |p: &Point2<f64>| (b - a).perp(&(p - a));
            let mut kept = Vec::with_capacity(left.len() + 1);
            for j in 0..left.len() {
                let (p, q) = (left[j], left[(j + 1) % left.len()]);
                let (at_p, at_q) = (side(&p), side(&q));
                if at_p >= 0.0 {
                    kept.push(p);
                }
                if (at_p > 0.0 && at_q < 0.0) || (at_p < 0.0 && at_q > 0.0) {
                    kept.push(p + (q - p) * (at_p / (at_p - at_q)));
                }
            }
            left = kept;
        }
        (Self(left).area() / own).min(1.0)
    }
}

fn cross(a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    a.coords.perp(&b.coords)
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// The convex hull by Andrew's monotone chain, with the inside to the left of every side.
fn hull(mut points: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |points: &mut dyn Iterator<Item = &Point2<f64>>| {
        let mut chain: Vec<Point2<f64>> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp(&(point - a)) <= 0.0
            {
                chain.pop();
            }
            chain.push(*point);
        }
        chain.pop();
        chain
    };
    let mut all = half(&mut points.iter());
    all.extend(half(&mut points.iter().rev()));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64, side: f64) -> Footprint {
        let corner = |u: f64, v: f64| Point2::new(x + u * side, y + v * side);
        Footprint(hull(vec![corner(0.0, 0.0), corner(1.0, 1.0), corner(1.0, 0.0), corner(0.5, 0.5), corner(0.0, 1.0)]))
    }

    #[test]
    fn squares_that_overlap_by_a_quarter() {
        let (a, b) = (square(0.0, 0.0, 2.0), square(1.0, 1.0, 2.0));
        assert_eq!((a.area(), a.0.len()), (4.0, 4));
        assert!((a.covered_by(&b) - 0.25).abs() < 1e-15 && (b.covered_by(&a) - 0.25).abs() < 1e-15);
        assert_eq!(a.covered_by(&a), 1.0);
        assert_eq!(a.covered_by(&square(2.5, 0.0, 1.0)), 0.0);
        assert!((a.covered_by(&square(0.5, 0.5, 1.0)) - 0.25).abs() < 1e-15, "a smaller one inside");
        assert_eq!(square(0.5, 0.5, 1.0).covered_by(&a), 1.0);
        assert_eq!(a.middle(), Some(Point2::new(1.0, 1.0)));
    }

    #[test]
    fn what_is_far_off_the_bottom_does_not_count() {
        let down = Transform::<World, Camera>::identity();
        let mut points: Vec<Point<Camera>> = (0..100)
            .map(|i| Point::new(f64::from(i % 10) * 0.1, f64::from(i / 10) * 0.1, 3.0 + 0.01 * f64::from(i % 7)))
            .collect();
        let flat = Footprint::of(&points, &down).area();
        assert!((flat - 0.81).abs() < 1e-9, "{flat}");
        points.push(Point::new(40.0, 0.0, 60.0));
        assert_eq!(Footprint::of(&points, &down).area(), flat);
    }

    #[test]
    fn nothing_covers_a_line() {
        let line = Footprint(hull(vec![Point2::new(0.0, 0.0), Point2::new(1.0, 1.0), Point2::new(2.0, 2.0)]));
        assert_eq!(line.area(), 0.0);
        assert_eq!(line.covered_by(&square(0.0, 0.0, 3.0)), 0.0);
        assert_eq!(Footprint(Vec::new()).middle(), None);
    }
}
