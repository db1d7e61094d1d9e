//! The scene: true bodies on the seabed, and the site file that describes them.

mod builtin;
mod bvh;
mod change;
mod check;
mod clutter;
mod inside;
pub(crate) mod mesh;
mod plan;
mod random;
mod rounded;
mod site_plan;
pub(crate) mod wireframe;

use nalgebra::Vector3;
use seafix_geometry::{Object, Point, Transform, World};
use seafix_referencing::Site;

pub use builtin::{BUILT_IN, built_in};
pub use change::Changes;
pub use plan::{
    BoxBody, ChequerBody, CylinderBody, GEOMETRY_FORMAT, Geometry, MaterialPlan, MeshBody, ObjectGeometry, PanelBody,
    SeabedPlan, Texture,
};
pub use random::RandomSite;

pub(crate) use bvh::Bvh;
use mesh::{Mesh, Wear};
pub(crate) use mesh::{Skin, Triangle};
pub use site_plan::SitePlan;

use crate::{
    seabed::{Mound, Seabed},
    stream::{Purpose, Stream},
    survey::{Mark, SurveyErrors, given_model, survey_marks},
};

/// A feature point at its true position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ScenePoint {
    pub(crate) at: Vector3<f64>,
    /// Outward normal of the side from which the point is visible.
    pub(crate) normal: Option<Vector3<f64>>,
}

/// One object at its true pose.
#[derive(Debug, Clone)]
pub(crate) struct SceneObject {
    /// The feature points that the site lists, in its order.
    pub(crate) points: Vec<ScenePoint>,
    /// The mean of all feature points, whether the site lists them or not: scene and route depend on it.
    centroid: Vector3<f64>,
}

impl SceneObject {
    fn new(points: Vec<ScenePoint>) -> Self {
        let centroid = points.iter().map(|p| p.at).sum::<Vector3<f64>>() / points.len() as f64;
        Self { points, centroid }
    }

    /// The mean of all feature points.
    pub(crate) fn centroid(&self) -> Vector3<f64> {
        self.centroid
    }
}

/// Everything visible, in the world.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    /// The site as a method receives it, with the errors of its survey.
    pub(crate) nominal: Site,
    /// The true poses of the nominal objects.
    pub(crate) world_from_object: Vec<Transform<World, Object>>,
    pub(crate) objects: Vec<SceneObject>,
    pub(crate) mesh: Mesh,
    pub(crate) bvh: Bvh,
    pub(crate) seabed: Seabed,
    /// Index of the seabed's skin, the last of the mesh.
    pub(crate) seabed_skin: u32,
}

impl Scene {
    pub(crate) fn new(plan: &SitePlan, changes: &Changes, errors: SurveyErrors, seed: u64) -> Self {
        let geometry = &plan.geometry;
        let (mut nominal, mut truth, mut objects) = (Vec::new(), Vec::new(), Vec::new());
        let mut mounds = Vec::new();
        let mut poses = Vec::new();
        for (index, object) in plan.site.objects.iter().enumerate() {
            let number = index as u64;
            let before = object.world_from_object.expect("every object stands somewhere; plans are checked");
            let marks: Vec<Mark<'_>> = object
                .points
                .iter()
                .map(|p| Mark {
                    id: &p.id,
                    at: (before * p.at).coords,
                    normal: p.normal.map(|normal| before.rotation() * normal),
                })
                .collect();
            let mut stream = Stream::new(seed, 0, number, Purpose::Survey);
            let (mut described, fit) = match plan.given(&object.id) {
                Some(given) => given_model(given, &marks, errors, &mut stream),
                None => survey_marks(&object.id, object.base, &marks, errors, &mut stream),
            };
            described.interest.clone_from(&object.interest);
            let centre = marks.iter().map(|m| m.at).sum::<Vector3<f64>>() / marks.len() as f64;
            let concerned = changes.concern(&object.id);
            let now = if concerned { changes.moved(&before, &centre, seed, number) } else { before };
            let moved = now * before.inverse();
            let point = |p: &seafix_referencing::ModelPoint| ScenePoint {
                at: (now * p.at).coords,
                normal: p.normal.map(|normal| now.rotation() * normal),
            };
            objects.push(SceneObject::new(object.points.iter().map(point).collect()));
            if concerned && changes.silt > 0.0 {
                let reach = marks.iter().map(|m| (m.at - centre).xy().norm()).fold(0.0, f64::max);
                mounds.push(Mound { centre: [centre.x, centre.y], radius: reach + 0.5, height: changes.silt });
            }
            poses.push((now, concerned));
            truth.push(if moved == Transform::identity() { fit } else { moved * fit });
            nominal.push(described);
        }
        let seabed = Seabed::with_relief(geometry.seabed.depth, geometry.seabed.relief, seed).silted(mounds);

        let mut mesh = Mesh::default();
        let texture = Stream::new(seed, 0, 0, Purpose::Texture).bits() as u32;
        for shape in &geometry.objects {
            let Some(index) = plan.site.objects.iter().position(|o| o.id == shape.id) else { continue };
            let (pose, concerned) = &poses[index];
            let wear =
                if *concerned { Wear { rounding: changes.rounding, growth: changes.growth } } else { Wear::default() };
            mesh.add(geometry, shape, pose, wear, texture);
        }
        for (index, (object, (_, concerned))) in objects.iter().zip(&poses).enumerate() {
            let centre = object.centroid();
            let mut rocks = Stream::new(seed, 0, index as u64, Purpose::Rocks);
            clutter::rocks(&mut mesh, &seabed, &centre, geometry.seabed.rocks, &mut rocks);
            if *concerned {
                let mut stream = Stream::new(seed, 0, index as u64, Purpose::Occluders);
                clutter::occluders(&mut mesh, &seabed, &centre, changes.occluders, &mut stream);
            }
        }
        // The points that the site lists, in its order.
        for (object, (described, known)) in objects.iter_mut().zip(plan.site.objects.iter().zip(&nominal)) {
            let place = |id: &str| described.points.iter().position(|point| point.id == id);
            object.points =
                known.points.iter().filter_map(|point| place(&point.id)).map(|k| object.points[k]).collect();
        }
        let bvh = Bvh::new(&mesh.triangles);
        let seabed_skin = mesh.skins.len() as u32;
        mesh.skins.push(Skin {
            albedo: geometry.seabed.albedo as f32,
            texture: geometry.seabed.texture,
            seed: texture,
            growth: 0.0,
        });
        let nominal =
            Site { name: plan.site.name.clone(), frame: plan.site.frame, objects: nominal, warnings: Vec::new() };
        Self { nominal, world_from_object: truth, objects, mesh, bvh, seabed, seabed_skin }
    }

    /// The first t > 0 at which `from + t·along` meets a body or the seabed.
    pub(crate) fn hit(&self, from: &Vector3<f64>, along: &Vector3<f64>) -> Option<f64> {
        let body = self.bvh.hit(&self.mesh.triangles, from, along, f64::INFINITY).map(|hit| hit.t);
        body.into_iter().chain(self.seabed.hit(from, along)).min_by(f64::total_cmp)
    }

    /// Whether `to` is visible from `from`, up to a millimetre before it.
    pub(crate) fn clear(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let along = to - from;
        let before = 1.0 - 1e-3 / along.norm();
        self.bvh.hit(&self.mesh.triangles, from, &along, before).is_none()
            && self.seabed.hit(from, &along).is_none_or(|t| t >= before)
    }

    /// Whether a feature point faces `from` and is not occluded.
    pub(crate) fn sees(&self, from: &Vector3<f64>, point: &ScenePoint) -> bool {
        point.normal.is_none_or(|normal| normal.dot(&(from - point.at)) > 0.0) && self.clear(from, &point.at)
    }

    /// The distance to the nearest surface, if it is below `limit` (m).
    pub(crate) fn distance(&self, place: &Vector3<f64>, limit: f64) -> Option<f64> {
        let body = self.bvh.distance(&self.mesh.triangles, place, limit);
        // The slopes of the seabed are so small that the vertical distance is the distance.
        let seabed = self.seabed.down(place.x, place.y) - place.z;
        body.into_iter().chain((seabed < limit).then_some(seabed)).min_by(f64::total_cmp)
    }

    /// The surface point that a ray meets.
    pub(crate) fn seen(&self, from: &Vector3<f64>, along: &Vector3<f64>) -> Option<Point<World>> {
        self.hit(from, along).map(|t| Point::from(from + along * t))
    }
}

#[cfg(test)]
mod tests;
