//! Members of a joint fix.

use seafix_geometry::{Camera, Covariance6, Object, Transform};

use crate::{
    observations::{EdgeObservation, Observation, Observations},
    solve::likelihood::mixed::MIN_FEATURE_VALUE,
};

/// The knowledge of an object's pose in the site's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "one an object: a survey's thirty-six numbers are little beside its points"
)]
pub enum Placement {
    /// The stated pose is exact, as that of the object that defines the site's frame.
    Exact,
    /// The stated pose has this covariance of η in `site_from_object_true = site_from_object · Exp(η)`.
    Surveyed(Covariance6<Object, Object>),
    /// The pose is unknown, as of a displaced object: only the images determine it.
    Displaced,
}

/// An object of the site in a joint fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Member {
    /// The stated pose of the object's frame in the site's frame.
    pub site_from_object: Transform<Object, Object>,
    /// The uncertainty of the stated pose.
    pub placement: Placement,
}

/// The observed points and edges of one instant.
///
/// Each has the index of its object, and model coordinates in that object's frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjectObservations {
    /// The points.
    pub points: Vec<(usize, Observation)>,
    /// The edges.
    pub edges: Vec<(usize, EdgeObservation)>,
    /// The poses of objects with a fix of their own, from which the joint fix starts if the points determine none.
    pub poses: Vec<(usize, Transform<Object, Camera>)>,
}

impl ObjectObservations {
    /// Adds observed points and edges of an object.
    pub fn see(&mut self, object: usize, data: &Observations<'_>) {
        self.points.extend(data.points.iter().map(|point| (object, *point)));
        self.edges.extend(data.edges.iter().map(|edge| (object, *edge)));
    }

    /// The numbers of observed points and edges of an object.
    pub fn count(&self, object: usize) -> [usize; 2] {
        let points = self.points.iter().filter(|(o, _)| *o == object).count();
        [points, self.edges.iter().filter(|(o, _)| *o == object).count()]
    }

    /// Whether an object is observed.
    pub fn shows(&self, object: usize) -> bool {
        self.count(object) != [0, 0]
    }

    /// Whether the features of an object can determine its pose: three points, two points and an edge, or two edges.
    pub(super) fn suffices(&self, object: usize) -> bool {
        let [points, edges] = self.count(object);
        2 * points + 3 * edges >= MIN_FEATURE_VALUE
    }

    /// Removes the features of an object.
    pub(super) fn remove(&mut self, object: usize) {
        self.points.retain(|(o, _)| *o != object);
        self.edges.retain(|(o, _)| *o != object);
        self.poses.retain(|(o, _)| *o != object);
    }
}
