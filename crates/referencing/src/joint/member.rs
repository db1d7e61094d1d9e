//! Members of a joint fix.

use seafix_geometry::{Covariance6, Object, Transform};

use crate::observations::{Observation, Observations};

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

/// The observed points of one instant.
///
/// Each has the index of its object, and model coordinates in that object's frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjectObservations {
    /// The points.
    pub points: Vec<(usize, Observation)>,
}

impl ObjectObservations {
    /// Adds observed points of an object.
    pub fn see(&mut self, object: usize, data: &Observations<'_>) {
        self.points.extend(data.points.iter().map(|point| (object, *point)));
    }

    /// The number of observed points of an object.
    pub fn count(&self, object: usize) -> usize {
        self.points.iter().filter(|(o, _)| *o == object).count()
    }
}
