//! The site: known objects, their feature points, and where they stand.
//!
//! Two levels, as in the paper: a production system (site) of objects; every object has its own
//! frame by the Fig. 2 rule, and the site's frame is that of one chosen object.

mod bounding_box;
mod check;
mod congruence;
mod file;
mod target;

use std::path::Path;

use nalgebra::{Matrix6, Vector3, Vector6};
use seafix_component::Fault;
use seafix_geometry::{Covariance6, Object, Point, Transform, World, triad};

pub use bounding_box::BoundingBox;
pub(crate) use check::{COINCIDENT, SUSPICIOUS};
pub use congruence::Congruence;
pub(crate) use congruence::congruences;
pub use target::{NoWorld, Target, TargetKind};
pub(crate) use target::{diameter, nearest_two};

/// Cosine of the angle between normal and line of sight below which a point shows its back.
const BACK: f64 = -0.1;

/// A feature point of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelPoint {
    /// Its name, unique in its object.
    pub id: String,
    /// Where it is, object frame.
    pub at: Point<Object>,
    /// Standard deviation of each of its coordinates (m).
    pub sigma: f64,
    /// Unit vector of the side from which it is seen, object frame; `None` if it is seen from everywhere.
    pub normal: Option<Vector3<f64>>,
}

impl ModelPoint {
    /// A point that is known exactly and seen from everywhere.
    pub fn exact(id: impl Into<String>, at: Point<Object>) -> Self {
        Self { id: id.into(), at, sigma: 0.0, normal: None }
    }

    /// Whether a camera there (object frame) sees it from the side from which it can be seen, or nearly: a surface and an
    /// attitude are known to some degrees.
    pub fn shows_itself(&self, camera: &Vector3<f64>) -> bool {
        self.normal.is_none_or(|normal| {
            let ray = camera - self.at.coords;
            normal.dot(&ray) > BACK * normal.norm() * ray.norm()
        })
    }

    /// The angle (rad, 0 to π) between the normal and the line of sight to a camera there (object frame); `None` if the point
    /// is seen from everywhere.
    pub fn incidence_angle(&self, camera: &Vector3<f64>) -> Option<f64> {
        self.normal.map(|normal| normal.angle(&(camera - self.at.coords)))
    }

    /// The greatest angle (rad) between normal and line of sight at which a point still shows itself.
    pub fn max_incidence_angle() -> f64 {
        libm::acos(BACK)
    }
}

/// A place worth inspecting: no feature point, but something that the vehicle goes to.
#[derive(Debug, Clone, PartialEq)]
pub struct Interest {
    /// Its name.
    pub id: String,
    /// Where it is, object frame.
    pub at: Point<Object>,
    /// Unit vector of the side from which it is looked at, object frame; `None` where none is given.
    pub normal: Option<Vector3<f64>>,
}

/// One known object.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteObject {
    /// Its name, unique in the site.
    pub id: String,
    /// Indices into `points` of P1, P2, P3 of the Fig. 2 rule.
    pub base: [usize; 3],
    /// The surveyed world coordinates of P1, P2, P3.
    pub base_in_world: Option<[Point<World>; 3]>,
    /// Standard deviation of each surveyed coordinate (m).
    pub survey_sigma: f64,
    /// Eq. (1): where the object stands, from the surveyed base; `None` where no world is known.
    pub world_from_object: Option<Transform<World, Object>>,
    /// The feature points, at least three.
    pub points: Vec<ModelPoint>,
    /// Points to inspect.
    pub interest: Vec<Interest>,
}

impl SiteObject {
    /// The min–max shell of the feature points in the object's own frame.
    pub fn bounding_box(&self) -> BoundingBox<Object> {
        BoundingBox::around(self.points.iter().map(|point| point.at)).expect("an object has at least three points")
    }

    /// The min–max shell of the feature points in the world; `None` where no world is known.
    pub fn bounding_box_in_world(&self) -> Option<BoundingBox<World>> {
        let world_from_object = self.world_from_object?;
        BoundingBox::around(self.points.iter().map(|point| world_from_object * point.at))
    }

    /// How well the survey knows where the object stands: the covariance of
    /// [`world_from_object`](Self::world_from_object), from that of the nine surveyed coordinates.
    ///
    /// Σ = Σ_c (ξ_c⁺ − ξ_c⁻)(ξ_c⁺ − ξ_c⁻)ᵀ / 4, ξ_c^± the pose's step when coordinate c is moved by ±σ. A
    /// short base turns millimetres of survey into degrees of attitude.
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
    /// When an index is out of range.
    pub fn distance(&self, i: usize, k: usize) -> f64 {
        self.points[i].at.distance(&self.points[k].at)
    }
}

/// All known objects of one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Site {
    /// Its name.
    pub name: String,
    /// Index of the object whose frame is the site's.
    pub frame: usize,
    /// The objects.
    pub objects: Vec<SiteObject>,
    /// What is suspicious in the file it came from, but no reason to refuse it.
    pub warnings: Vec<Fault>,
}

impl Site {
    /// Reads a site file (`seafix-site/1`).
    ///
    /// # Errors
    /// A file that cannot be read, or everything that is wrong with it, at once.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, Vec<Fault>> {
        let path = path.as_ref();
        let text = seafix_component::read_text(path).map_err(|fault| vec![fault])?;
        Self::parse(&text, path)
    }

    /// The site that `text`, the content of `file`, describes in `seafix-site/1`.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once: a fault a line of the file.
    pub fn parse(text: &str, file: &Path) -> Result<Self, Vec<Fault>> {
        check::site(&file::read(text, file).map_err(|fault| vec![fault])?, text, file)
    }

    /// The same site in `seafix-site/1`.
    pub fn to_toml(&self) -> String {
        file::write(self)
    }

    /// The object whose frame is the site's.
    pub fn frame_object(&self) -> &SiteObject {
        &self.objects[self.frame]
    }

    /// The object of this name.
    pub fn object(&self, id: &str) -> Option<&SiteObject> {
        self.objects.iter().find(|object| object.id == id)
    }

    /// The min–max shell of the whole site in the world; `None` unless every object's place is known.
    pub fn bounding_box_in_world(&self) -> Option<BoundingBox<World>> {
        self.objects.iter().map(SiteObject::bounding_box_in_world).reduce(|a, b| Some(a?.union(&b?)))?
    }

    /// What is searched for: each object by itself, or the whole site as one.
    ///
    /// # Errors
    /// [`NoWorld`] when the whole site is asked for and an object's place in the world is unknown.
    pub fn targets(&self, kind: TargetKind) -> Result<Vec<Target>, NoWorld> {
        target::targets(self, kind)
    }
}

#[cfg(test)]
mod tests;
