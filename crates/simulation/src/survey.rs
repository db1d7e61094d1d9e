//! The virtual site with the errors of its survey, and its truth.

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Object, Point, Transform, World, triad};
use seafix_referencing::{ModelPoint, Site, SiteObject};

use crate::{
    blueprint::{Blueprint, ObjectPlan},
    stream::{Purpose, Stream},
    virtual_scene::{Body, VirtualScene},
};

/// Limit of distance errors between surveyed points, in standard deviations. Every sampled survey thus passes the site
/// file's own check at four.
const SURVEY_LIMIT: f64 = 3.5;

/// The survey errors of a site.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurveyErrors {
    /// Standard deviation of each coordinate of a model point (m).
    pub(crate) model: f64,
    /// Standard deviation of each surveyed world coordinate (m).
    pub(crate) survey: f64,
}

/// The site as surveyed, and the true poses of its objects.
pub(crate) fn survey(
    blueprint: &Blueprint,
    scene: &VirtualScene,
    errors: SurveyErrors,
    seed: u64,
) -> (Site, Vec<Transform<World, Object>>) {
    let sampled = blueprint.objects.iter().zip(&scene.bodies).enumerate().map(|(index, (plan, body))| {
        survey_object(plan, body, errors, &mut Stream::new(seed, 0, index as u64, Purpose::Survey))
    });
    let (objects, truth): (Vec<_>, Vec<_>) = sampled.unzip();
    let frame = blueprint.objects.iter().position(|o| o.id == blueprint.site_frame).unwrap_or(0);
    (Site { name: blueprint.name.clone(), frame, objects, warnings: Vec::new() }, truth)
}

fn survey_object(
    plan: &ObjectPlan,
    body: &Body,
    errors: SurveyErrors,
    stream: &mut Stream,
) -> (SiteObject, Transform<World, Object>) {
    let base = plan.base.each_ref().map(|id| {
        plan.points.iter().position(|p| p.id == *id).expect("the built-in base names points; a test reads all")
    });
    let marks: Vec<Mark<'_>> = plan
        .points
        .iter()
        .zip(&body.points)
        .map(|(plan, corner)| Mark { id: &plan.id, at: corner.at, normal: Some(corner.normal) })
        .collect();
    survey_marks(&plan.id, base, &marks, errors, stream)
}

/// The true position of a feature point in the world.
pub(crate) struct Mark<'a> {
    pub(crate) id: &'a str,
    pub(crate) at: Vector3<f64>,
    /// Outward normal of the side from which the point is visible.
    pub(crate) normal: Option<Vector3<f64>>,
}

/// An object as surveyed, and the true pose of its surveyed points.
pub(crate) fn survey_marks(
    id: &str,
    base: [usize; 3],
    marks: &[Mark<'_>],
    errors: SurveyErrors,
    stream: &mut Stream,
) -> (SiteObject, Transform<World, Object>) {
    let truth: Vec<Vector3<f64>> = marks.iter().map(|mark| mark.at).collect();
    // The model is measured on the object itself, with an independent error of each point.
    let measured: Vec<Point<World>> = truth.iter().map(|p| Point::from(p + stream.normal3(errors.model))).collect();
    let [p1, p2, p3] = base.map(|k| measured[k]);
    let object_from_world =
        triad::<World, Object>(&p1, &p2, &p3).expect("the base spans a plane; sites are checked").inverse();
    let points: Vec<ModelPoint> = marks
        .iter()
        .zip(&measured)
        .map(|(mark, at)| ModelPoint {
            id: mark.id.to_owned(),
            at: Point::from((object_from_world * *at).coords.map(micrometres)),
            sigma: errors.model,
            normal: mark.normal.map(|normal| (object_from_world.rotation() * normal).map(micrometres).normalize()),
        })
        .collect();
    let base_in_world = surveyed_base(base.map(|k| truth[k]), base.map(|k| points[k].at), errors, stream);
    let [s1, s2, s3] = &base_in_world;
    let object = SiteObject {
        id: id.to_owned(),
        base,
        base_in_world: Some(base_in_world),
        survey_sigma: errors.survey,
        world_from_object: triad(s1, s2, s3).ok(),
        points,
        edges: Vec::new(),
        interest: Vec::new(),
    };
    let start = object_from_world.inverse();
    let world_from_object = best_fit(start, object.points.iter().map(|p| p.at).zip(truth));
    (object, world_from_object)
}

/// A given model of an object with surveyed base points, and its true pose: the one that fits its points best.
pub(crate) fn given_model(
    given: &SiteObject,
    marks: &[Mark<'_>],
    errors: SurveyErrors,
    stream: &mut Stream,
) -> (SiteObject, Transform<World, Object>) {
    let mark = |point: &ModelPoint| marks.iter().find(|mark| mark.id == point.id);
    let known: Vec<&Mark<'_>> =
        given.points.iter().map(|point| mark(point).expect("a plan's models have its points")).collect();
    let truth = given.base.map(|k| known[k].at);
    let [p1, p2, p3] = truth.map(Point::from);
    let start = triad(&p1, &p2, &p3).expect("the base spans a plane; sites are checked");
    let pairs = given.points.iter().map(|point| point.at).zip(known.iter().map(|mark| mark.at));
    let world_from_object: Transform<World, Object> = best_fit(start, pairs);
    let turn = world_from_object.inverse().rotation();
    let side = |mark: &Mark<'_>| mark.normal.map(|normal| (turn * normal).map(micrometres).normalize());
    let points =
        given.points.iter().zip(&known).map(|(point, mark)| ModelPoint { normal: side(mark), ..point.clone() });
    let base_in_world = surveyed_base(truth, given.base.map(|k| given.points[k].at), errors, stream);
    let [s1, s2, s3] = &base_in_world;
    let object = SiteObject {
        base_in_world: Some(base_in_world),
        survey_sigma: errors.survey,
        world_from_object: triad(s1, s2, s3).ok(),
        points: points.collect(),
        edges: Vec::new(),
        interest: Vec::new(),
        ..given.clone()
    };
    (object, world_from_object)
}

/// The world coordinates of the base points with the survey's errors.
fn surveyed_base(
    truth: [Vector3<f64>; 3],
    model: [Point<Object>; 3],
    errors: SurveyErrors,
    stream: &mut Stream,
) -> [Point<World>; 3] {
    let limit = SURVEY_LIMIT * (2.0 * (errors.survey.powi(2) + errors.model.powi(2))).sqrt() + 5e-6;
    let mut sampled = truth;
    // Nearly every sample passes. After a thousand failures the last one stands, and the site file's check reports it.
    for _ in 0..1000 {
        sampled = truth.map(|p| (p + stream.normal3(errors.survey)).map(micrometres));
        let fits =
            |i: usize, k: usize| ((sampled[i] - sampled[k]).norm() - model[i].distance(&model[k])).abs() <= limit;
        if fits(0, 1) && fits(0, 2) && fits(1, 2) {
            break;
        }
    }
    sampled.map(Point::from)
}

/// Rounded to 1 µm, which keeps the site file readable.
fn micrometres(x: f64) -> f64 {
    (x * 1e6).round() / 1e6 + 0.0
}

/// The least-squares motion from the model points to their true positions, from a nearly correct start.
///
/// The centroids are aligned first, then small rotations are iterated; with residuals of millimetres three steps reach
/// rounding error.
fn best_fit(
    start: Transform<World, Object>,
    pairs: impl Iterator<Item = (Point<Object>, Vector3<f64>)> + Clone,
) -> Transform<World, Object> {
    let n = pairs.clone().count() as f64;
    let (mut from, mut to) = (Vector3::zeros(), Vector3::zeros());
    for (p, w) in pairs.clone() {
        from += p.coords / n;
        to += w / n;
    }
    let mut rotation = start.rotation();
    for _ in 0..10 {
        let (mut normal, mut gradient) = (Matrix3::zeros(), Vector3::zeros());
        for (p, w) in pairs.clone() {
            let (a, b) = (rotation * (p.coords - from), w - to);
            let skew = seafix_geometry::so3::skew(&a);
            normal -= skew * skew;
            gradient += a.cross(&(b - a));
        }
        let Some(inverse) = normal.try_inverse() else { break };
        rotation = seafix_geometry::so3::exp(&(inverse * gradient)) * rotation;
    }
    Transform::new(rotation, to - rotation * from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(errors: SurveyErrors, seed: u64) -> (Site, Vec<Transform<World, Object>>, VirtualScene) {
        let blueprint = Blueprint::drill_centre();
        let scene = VirtualScene::new(&blueprint, seed);
        let (site, truth) = survey(&blueprint, &scene, errors, seed);
        (site, truth, scene)
    }

    #[test]
    fn an_exact_survey_is_exact() {
        let (site, truth, scene) = sampled(SurveyErrors { model: 0.0, survey: 0.0 }, 3);
        for ((object, world_from_object), body) in site.objects.iter().zip(&truth).zip(&scene.bodies) {
            for (point, corner) in object.points.iter().zip(&body.points) {
                assert!((*world_from_object * point.at).distance(&Point::from(corner.at)) < 3e-6);
                assert!((object.world_from_object.unwrap() * point.at).distance(&Point::from(corner.at)) < 2e-5);
            }
        }
    }

    #[test]
    fn the_model_is_good_to_a_millimetre_and_the_survey_to_a_centimetre() {
        let (mut model, mut survey, mut n, mut m) = (0.0, 0.0, 0.0, 0.0);
        for seed in 0..20 {
            let (site, truth, scene) = sampled(SurveyErrors { model: 0.001, survey: 0.01 }, seed);
            for ((object, world_from_object), body) in site.objects.iter().zip(&truth).zip(&scene.bodies) {
                for (point, corner) in object.points.iter().zip(&body.points) {
                    model += ((*world_from_object * point.at).coords - corner.at).norm_squared();
                    n += 3.0;
                }
                n -= 6.0; // the fit has six degrees of freedom
                for (surveyed, &k) in object.base_in_world.unwrap().iter().zip(&object.base) {
                    survey += (surveyed.coords - body.points[k].at).norm_squared();
                    m += 3.0;
                }
            }
        }
        let [model, survey]: [f64; 2] = [f64::sqrt(model / n), f64::sqrt(survey / m)];
        assert!((model / 0.001 - 1.0).abs() < 0.05, "{model}");
        assert!((survey / 0.01 - 1.0).abs() < 0.06, "{survey}");
    }

    #[test]
    fn the_site_file_holds_the_same_and_passes_its_own_check() {
        for seed in 0..10 {
            let (site, _, _) = sampled(SurveyErrors { model: 0.001, survey: 0.01 }, seed);
            let text = site.to_toml();
            let read = Site::parse(&text, std::path::Path::new("site.toml")).unwrap();
            assert_eq!(read.warnings, []);
            assert_eq!(read, site);
        }
    }
}
