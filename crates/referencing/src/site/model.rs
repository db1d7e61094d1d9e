//! Sites: objects and their points.

use nalgebra::{Matrix6, Vector3, Vector6};
use seafix_component::Fault;
use seafix_geometry::{Covariance6, Object, Point, Transform, World, triad};

use crate::site::{bounding_box::BoundingBox, edge::ModelEdge};

/// The cosine of the largest angle between normal and line of sight of a visible point.
pub(super) const BACK: f64 = -0.1;

/// A model point: a feature point of an object.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelPoint {
    /// The identifier, unique in the object.
    pub id: String,
    /// The position, object frame.
    pub at: Point<Object>,
    /// The standard deviation of each coordinate (m).
    pub sigma: f64,
    /// The unit normal of the visible side, object frame; `None` for a point visible from every side.
    pub normal: Option<Vector3<f64>>,
}

impl ModelPoint {
    /// A model point without uncertainty, visible from every side.
    pub fn exact(id: impl Into<String>, at: Point<Object>) -> Self {
        Self { id: id.into(), at, sigma: 0.0, normal: None }
    }

    /// Whether a camera at this position (object frame) sees the point from its visible side.
    ///
    /// The limit exceeds 90° by a few degrees, since normals and attitudes are uncertain.
    pub fn shows_itself(&self, camera: &Vector3<f64>) -> bool {
        self.normal.is_none_or(|normal| {
            let ray = camera - self.at.coords;
            normal.dot(&ray) > BACK * normal.norm() * ray.norm()
        })
    }

    /// The angle (rad, 0 to π) between normal and line of sight to a camera position.
    ///
    /// The position is in the object frame. `None` for a point visible from every side.
    pub fn incidence_angle(&self, camera: &Vector3<f64>) -> Option<f64> {
        self.normal.map(|normal| normal.angle(&(camera - self.at.coords)))
    }

    /// The largest angle (rad) between normal and line of sight of a visible point.
    pub fn max_incidence_angle() -> f64 {
        libm::acos(BACK)
    }
}

/// A point of interest: a point that the vehicle inspects and that takes no part in a fix.
#[derive(Debug, Clone, PartialEq)]
pub struct Interest {
    /// The identifier.
    pub id: String,
    /// The position, object frame.
    pub at: Point<Object>,
    /// The unit vector towards the viewer, object frame; `None` if unspecified.
    pub normal: Option<Vector3<f64>>,
}

/// A known object of a site.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteObject {
    /// The identifier, unique in the site.
    pub id: String,
    /// The indices into `points` of P1, P2, P3 of the Fig. 2 rule.
    pub base: [usize; 3],
    /// The surveyed world coordinates of P1, P2, P3.
    pub base_in_world: Option<[Point<World>; 3]>,
    /// The standard deviation of each surveyed coordinate (m).
    pub survey_sigma: f64,
    /// The object's pose in the world by Eq. (1), from the surveyed base; `None` without a survey.
    pub world_from_object: Option<Transform<World, Object>>,
    /// The feature points, at least three.
    pub points: Vec<ModelPoint>,
    /// The straight edges.
    pub edges: Vec<ModelEdge>,
    /// The points of interest.
    pub interest: Vec<Interest>,
}

impl SiteObject {
    /// The bounding box of the feature points in the object's frame.
    pub fn bounding_box(&self) -> BoundingBox<Object> {
        BoundingBox::around(self.points.iter().map(|point| point.at)).expect("an object has at least three points")
    }

    /// The bounding box of the feature points in the world; `None` without a survey.
    pub fn bounding_box_in_world(&self) -> Option<BoundingBox<World>> {
        let world_from_object = self.world_from_object?;
        BoundingBox::around(self.points.iter().map(|point| world_from_object * point.at))
    }

    /// The covariance of [`world_from_object`](Self::world_from_object) that follows from the nine surveyed
    /// coordinates.
    ///
    /// Σ = Σ_c (ξ_c⁺ − ξ_c⁻)(ξ_c⁺ − ξ_c⁻)ᵀ / 4, with ξ_c^± the change of the pose when coordinate c moves by ±σ. A
    /// short base turns millimetres of survey error into degrees of attitude.
    pub fn survey_covariance(&self) -> Option<Covariance6<World, Object>> {
        let (base, pose) = (self.base_in_world?, self.world_from_object?);
        let mut sum = Matrix6::zeros();
        for c in 0..9 {
            let moved = |step: f64| {
                let mut base = base;
                base[c / 3].coords[c % 3] += step;
                triad(&base[0], &base[1], &base[2]).map_or_else(|_| Vector6::zeros(), |moved| pose.error_to(&moved))
            };
            let xi = (moved(self.survey_sigma) - moved(-self.survey_sigma)) * 0.5;
            sum += xi * xi.transpose();
        }
        Some(Covariance6::new(sum))
    }

    /// The distance (m) between feature points `i` and `k`.
    ///
    /// # Panics
    ///
    /// If an index is out of range.
    pub fn distance(&self, i: usize, k: usize) -> f64 {
        self.points[i].at.distance(&self.points[k].at)
    }
}

/// The known objects of one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Site {
    /// The name.
    pub name: String,
    /// The index of the object whose frame is the site's.
    pub frame: usize,
    /// The objects.
    pub objects: Vec<SiteObject>,
    /// Suspicious but valid contents of the file.
    pub warnings: Vec<Fault>,
}
