//! Straight edges of an object.

use nalgebra::Vector3;
use seafix_geometry::{Object, Point};

use super::model::{BACK, ModelPoint};

/// An end of a model edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// A model point, by its index: the edge shares the point's error.
    Point(usize),
    /// A place of its own, object frame.
    At(Point<Object>),
}

/// A model edge: a straight edge of an object between two ends.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelEdge {
    /// The identifier, unique in the object.
    pub id: String,
    /// The ends.
    pub ends: [End; 2],
    /// The standard deviation (m) of an end that is a place, along each axis.
    pub sigma: f64,
    /// The outward unit normals of the adjoining faces, at most two, object frame; empty for an edge visible from every
    /// side.
    pub faces: Vec<Vector3<f64>>,
}

impl ModelEdge {
    /// The positions of both ends, object frame.
    ///
    /// # Panics
    ///
    /// If an end is not one of the `points`.
    pub fn places(&self, points: &[ModelPoint]) -> [Point<Object>; 2] {
        self.ends.map(|end| match end {
            End::Point(index) => points[index].at,
            End::At(place) => place,
        })
    }

    /// The standard deviation of each coordinate of both ends (m).
    ///
    /// # Panics
    ///
    /// If an end is not one of the `points`.
    pub fn sigmas(&self, points: &[ModelPoint]) -> [f64; 2] {
        self.ends.map(|end| match end {
            End::Point(index) => points[index].sigma,
            End::At(_) => self.sigma,
        })
    }

    /// Whether an end is a place of its own, whose standard deviation is [`sigma`](Self::sigma).
    pub fn has_place(&self) -> bool {
        self.ends.iter().any(|end| matches!(end, End::At(_)))
    }

    /// Whether a camera at this position (object frame) sees one of the edge's faces.
    ///
    /// The limit is that of [`ModelPoint::shows_itself`].
    pub fn shows_itself(&self, points: &[ModelPoint], camera: &Vector3<f64>) -> bool {
        let [a, b] = self.places(points);
        let ray = camera - (a.coords + b.coords) / 2.0;
        let shows = |normal: &Vector3<f64>| normal.dot(&ray) > BACK * normal.norm() * ray.norm();
        self.faces.is_empty() || self.faces.iter().any(shows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_is_seen_where_one_of_its_faces_is() {
        let edge = ModelEdge {
            id: "e".to_owned(),
            ends: [End::At(Point::origin()), End::At(Point::new(1.0, 0.0, 0.0))],
            sigma: 0.0,
            faces: vec![Vector3::z(), Vector3::y()],
        };
        let seen = |at: [f64; 3]| edge.shows_itself(&[], &Vector3::from(at));
        assert!(seen([0.5, 0.0, 2.0]) && seen([0.5, 2.0, -1.0]) && !seen([0.5, -2.0, -1.0]));
        let open = ModelEdge { faces: Vec::new(), ..edge };
        assert!(open.shows_itself(&[], &Vector3::new(0.5, -2.0, -1.0)));
    }
}
