//! Bounding boxes along the axes of a frame.

use seafix_geometry::{Frame, Point};

/// The smallest box along the axes of `F` that contains a set of points.
///
/// It is the paper's min–max shell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundingBox<F> {
    /// The corner with the smallest coordinates (m).
    pub min: Point<F>,
    /// The corner with the largest coordinates (m).
    pub max: Point<F>,
}

impl<F: Frame> BoundingBox<F> {
    /// The bounding box of the points, each face touching one; `None` without points.
    pub fn around(points: impl IntoIterator<Item = Point<F>>) -> Option<Self> {
        points.into_iter().map(|point| Self { min: point, max: point }).reduce(|a, b| a.union(&b))
    }

    /// The smallest box that contains both boxes.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: Point::from(self.min.coords.inf(&other.min.coords)),
            max: Point::from(self.max.coords.sup(&other.max.coords)),
        }
    }

    /// Whether the point lies inside or on a face.
    pub fn contains(&self, point: &Point<F>) -> bool {
        self.grown_contains(point, 0.0)
    }

    /// Whether the point lies in the box enlarged by `margin` (m) on every side.
    ///
    /// Its faces belong to the box.
    pub fn grown_contains(&self, point: &Point<F>, margin: f64) -> bool {
        (0..3).all(|axis| {
            point.coords[axis] >= self.min.coords[axis] - margin && point.coords[axis] <= self.max.coords[axis] + margin
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::World;

    #[test]
    fn the_gate_touches_its_points_and_holds_them() {
        let points = [Point::<World>::new(1.0, -2.0, 3.0), Point::new(-1.0, 5.0, 0.5), Point::new(0.0, 0.0, 9.0)];
        let bounding_box = BoundingBox::around(points).unwrap();
        assert_eq!(bounding_box, BoundingBox { min: Point::new(-1.0, -2.0, 0.5), max: Point::new(1.0, 5.0, 9.0) });
        assert!(points.iter().all(|point| bounding_box.contains(point)));
        assert!(!bounding_box.contains(&Point::new(1.0 + 1e-12, 0.0, 1.0)));
        assert!(bounding_box.grown_contains(&Point::new(1.5, 0.0, 1.0), 0.5));
        assert_eq!(BoundingBox::<World>::around([]), None);
    }
}
