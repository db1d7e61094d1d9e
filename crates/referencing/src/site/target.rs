//! The target of one search.

use std::sync::OnceLock;

use nalgebra::{Matrix6, Vector3};
use seafix_component::Settings;
use seafix_geometry::{Camera, Covariance6, Object, Point, Transform, World};
use serde::{Deserialize, Serialize};

use super::{
    bounding_box::BoundingBox,
    congruence::{self, Congruence},
    edge::{End, ModelEdge},
    model::{ModelPoint, Site, SiteObject},
};
use crate::{
    joint::member::{Member, Placement},
    problem::{Prior, PriorBound},
};

/// The kind of target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum TargetKind {
    /// Each object by itself, in its own frame.
    #[default]
    Object,
    /// Each object by itself, in its own frame, and a joint solution afterwards.
    ///
    /// The joint solution estimates the poses and the surveyed object poses from all identified objects, those of
    /// earlier frames included.
    Joint,
    /// All points of the site at once, in the site's frame.
    Site,
}

/// The complete site as one target requires a surveyed pose of every object.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "cannot search the complete site as one target: object `{object}` has no `base_in_world`; add it, or use target = \
     \"object\""
)]
pub struct NoWorld {
    /// The object without a surveyed pose.
    pub object: String,
}

/// A target: feature points in one frame that a search looks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The name of the object, or of the site.
    pub name: String,
    /// The feature points, in the target's frame.
    pub points: Vec<ModelPoint>,
    /// The straight edges, in the target's frame.
    pub edges: Vec<ModelEdge>,
    /// The pose of the target's frame in the world; `None` without a survey.
    pub world_from_object: Option<Transform<World, Object>>,
    /// The covariance of the pose in the world; `None` without a survey.
    pub survey: Option<Covariance6<World, Object>>,
    /// The index of each object's first point, in the site's order; empty for a single object.
    firsts: Vec<usize>,
    /// Computed on demand.
    congruences: OnceLock<Vec<Congruence>>,
}

impl Target {
    /// The largest distance between two of the points (m).
    pub fn diameter(&self) -> f64 {
        diameter(&self.points)
    }

    /// The partial self-congruences of the points; computed once per target.
    pub fn congruences(&self) -> &[Congruence] {
        self.congruences.get_or_init(|| congruence::congruences(&self.points))
    }

    /// The prior pose relative to the target, from the prior pose in the world; `None` without a survey.
    ///
    /// Its covariance includes that of the survey. With T_wc = T̂_wc Exp(ξ) and T_wo = T̂_wo Exp(η): T_oc = T̂_oc Exp(ξ
    /// − Ad(T̂_co) η) to first order.
    pub fn prior(
        &self,
        world_from_camera: &Transform<World, Camera>,
        covariance: &Covariance6<World, Camera>,
    ) -> Option<Prior> {
        let object_from_camera = self.world_from_object?.inverse() * *world_from_camera;
        let adjoint = object_from_camera.inverse().adjoint();
        let survey = self.survey.map_or_else(Matrix6::zeros, |survey| survey.matrix);
        let covariance = Covariance6::new(covariance.matrix + adjoint * survey * adjoint.transpose());
        Some(Prior { object_from_camera, bound: PriorBound::Gaussian(covariance) })
    }

    /// The index in this target of a point of the site; `None` if the target excludes it.
    ///
    /// The point is given by its (object, point) indices; `index` is the target's own index among the targets of its
    /// kind.
    pub fn place_of(&self, index: usize, (object, point): (usize, usize)) -> Option<usize> {
        let place = match self.firsts.is_empty() {
            true => (object == index).then_some(point),
            false => self.firsts.get(object).map(|first| first + point),
        };
        place.filter(|&place| place < self.points.len())
    }

    /// The target as a member of a joint fix; the world is the site's frame.
    ///
    /// A target without a survey has an unknown pose, which only the images determine.
    pub fn member(&self) -> Member {
        let site_from_object = self.world_from_object.map_or_else(Transform::identity, |place| place.relabel());
        let placement = match (self.world_from_object, &self.survey) {
            (None, _) => Placement::Displaced,
            (Some(_), Some(survey)) if survey.matrix.trace() > 0.0 => {
                Placement::Surveyed(Covariance6::new(survey.matrix))
            }
            (Some(_), _) => Placement::Exact,
        };
        Member { site_from_object, placement }
    }

    /// The bounding box of the points in the target's frame.
    pub fn bounding_box(&self) -> BoundingBox<Object> {
        BoundingBox::around(self.points.iter().map(|point| point.at)).expect("a target has at least three points")
    }

    fn of(object: &SiteObject) -> Self {
        Self {
            name: object.id.clone(),
            points: object.points.clone(),
            edges: object.edges.clone(),
            world_from_object: object.world_from_object,
            survey: object.survey_covariance(),
            firsts: Vec::new(),
            congruences: OnceLock::new(),
        }
    }
}

/// The largest distance between two of the points (m); 0 for fewer than two.
///
/// The points farthest from the centroid are tested first: the distance of two points is at most the sum of their
/// distances from it, so a few of thousands suffice.
pub(crate) fn diameter(points: &[ModelPoint]) -> f64 {
    let middle = points.iter().map(|point| point.at.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let mut far: Vec<(f64, &Vector3<f64>)> =
        points.iter().map(|point| ((point.at.coords - middle).norm(), &point.at.coords)).collect();
    far.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    let mut max = 0.0f64;
    for (i, (from, a)) in far.iter().enumerate() {
        // The farthest other point bounds every distance from this one.
        if from + far[0].0 <= max {
            break;
        }
        for (other, b) in &far[..i] {
            if from + other <= max {
                break;
            }
            max = max.max((*a - *b).norm());
        }
    }
    max
}

/// The two nearest points with a distance below `limit` (m): the lower index, the higher index and the distance; `None`
/// if there are none.
///
/// The points are swept along a direction whose components have no rational ratio, so that no lattice row is
/// perpendicular to it. A point farther along the sweep than the smallest distance so far is skipped.
pub(crate) fn nearest_two(points: &[ModelPoint], limit: f64) -> Option<(usize, usize, f64)> {
    let direction = Vector3::new(1.0, 2f64.sqrt(), 3f64.sqrt()).normalize();
    let mut along: Vec<(f64, usize)> =
        points.iter().enumerate().map(|(i, point)| (direction.dot(&point.at.coords), i)).collect();
    along.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut nearest: Option<(usize, usize, f64)> = None;
    for (place, &(here, i)) in along.iter().enumerate() {
        for &(there, k) in along[..place].iter().rev() {
            let max = nearest.map_or(limit, |(.., distance)| distance);
            if here - there > max || max == 0.0 {
                break;
            }
            let distance = points[i].at.distance(&points[k].at);
            if distance < max {
                nearest = Some((i.min(k), i.max(k), distance));
            }
        }
    }
    nearest
}

/// The targets of a kind; see [`Site::targets`].
pub(super) fn targets(site: &Site, kind: TargetKind) -> Result<Vec<Target>, NoWorld> {
    match kind {
        TargetKind::Object | TargetKind::Joint => Ok(site.objects.iter().map(Target::of).collect()),
        TargetKind::Site => Ok(vec![full(site)?]),
    }
}

/// All points of the site in the frame of its frame object, transformed by Eq. (1).
fn full(site: &Site) -> Result<Target, NoWorld> {
    let frame = site.frame_object();
    let (mut points, mut edges, mut firsts) = (Vec::new(), Vec::new(), Vec::new());
    for (index, object) in site.objects.iter().enumerate() {
        let own = index == site.frame;
        let site_from_object: Transform<Object, Object> = if own {
            Transform::identity() // exact, free of the survey's rounding
        } else {
            let place = |o: &SiteObject| o.world_from_object.ok_or_else(|| NoWorld { object: o.id.clone() });
            (place(frame)?.inverse() * place(object)?).relabel()
        };
        let first = points.len();
        firsts.push(first);
        // The survey cancels within the frame object. For other objects both surveys contribute, more for points
        // farther from the surveyed base.
        let spread = |survey: Option<Covariance6<World, Object>>, at: &Point<Object>| {
            survey.filter(|_| !own).map_or(0.0, |survey| survey.of_point(at).trace() / 3.0)
        };
        points.extend(object.points.iter().map(|point| {
            let at = site_from_object * point.at;
            let survey = spread(frame.survey_covariance(), &at) + spread(object.survey_covariance(), &point.at);
            ModelPoint {
                id: format!("{}/{}", object.id, point.id),
                at,
                sigma: (point.sigma * point.sigma + survey).sqrt(),
                normal: point.normal.map(|normal| site_from_object.rotation() * normal),
            }
        }));
        edges.extend(object.edges.iter().map(|edge| {
            let places = edge.places(&object.points);
            // The common error of an object's survey is that of an edge's centre.
            let centre = Point::from((places[0].coords + places[1].coords) / 2.0);
            let survey = spread(frame.survey_covariance(), &(site_from_object * centre))
                + spread(object.survey_covariance(), &centre);
            ModelEdge {
                id: format!("{}/{}", object.id, edge.id),
                ends: edge.ends.map(|end| match end {
                    End::Point(index) => End::Point(first + index),
                    End::At(place) => End::At(site_from_object * place),
                }),
                sigma: (edge.sigma * edge.sigma + survey).sqrt(),
                faces: edge.faces.iter().map(|normal| site_from_object.rotation() * normal).collect(),
            }
        }));
    }
    Ok(Target {
        name: site.name.clone(),
        points,
        edges,
        world_from_object: frame.world_from_object,
        survey: frame.survey_covariance(),
        firsts,
        congruences: OnceLock::new(),
    })
}
