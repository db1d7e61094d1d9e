//! The straight edges of an object's bodies, as a site lists them.

use nalgebra::{UnitQuaternion, Vector3};
use seafix_geometry::{Object, Point, Transform, World};
use seafix_referencing::{End, ModelEdge, ModelPoint};

use super::{ObjectGeometry, Scene, SitePlan};
use crate::stream::{Purpose, Stream};

/// Minimum length of a listed edge (m); a site file refuses edges below 0.02 m.
const MIN_LENGTH: f64 = 0.03;
/// Distance (m) within which an end is a model point, and two edges are one.
const SAME: f64 = 1e-4;
/// Distance (m) from an edge at which its surroundings are probed for other bodies.
const BESIDE: f64 = 2e-3;
/// Number of places at which an edge is probed; half of them must be free.
const PROBES: usize = 8;
/// Maximum number of edges; a site file refuses more than 500.
const MAX_EDGES: usize = 400;

/// A true edge, object frame.
struct Edge {
    ends: [Vector3<f64>; 2],
    faces: Vec<Vector3<f64>>,
}

/// Adds the straight edges of boxes and painted areas to the objects of a scene's nominal site.
///
/// An edge that bodies or the seabed hide in most of its length is not listed. An end at a feature point is that point;
/// another end has an error of its own, `sigma` along each axis, common to the edges that meet there. Of the edges the
/// given fraction is listed, evenly chosen.
pub(crate) fn add_edges(scene: &mut Scene, plan: &SitePlan, sigma: f64, fraction: f64, seed: u64) {
    for index in 0..scene.nominal.objects.len() {
        let described = &plan.site.objects[index];
        let Some(before) = described.world_from_object else { continue };
        let Some(shape) = plan.geometry.objects.iter().find(|shape| shape.id == described.id) else { continue };
        let mut stream = Stream::new(seed, 0, index as u64, Purpose::Edges);
        let mut places: Vec<(Vector3<f64>, Point<Object>)> = Vec::new();
        // The survey describes the object as built; a displacement since then moves the scene only.
        let nominal = &scene.nominal.objects[index];
        let truly = |point: &ModelPoint| described.points.iter().find(|other| other.id == point.id);
        let known: Vec<&ModelPoint> = nominal.points.iter().filter_map(truly).collect();
        let fit = surveyed(nominal.points.iter(), known.iter().copied(), &before, &scene.world_from_object[index]);
        let listed = |k: usize| libm::floor((k + 1) as f64 * fraction) > libm::floor(k as f64 * fraction);
        let mut edges = Vec::new();
        for (number, edge) in wireframe(shape).into_iter().enumerate() {
            if !shows(scene, &edge, &before) {
                continue;
            }
            let ends = edge.ends.map(|end| {
                if let Some(point) = known.iter().position(|p| (p.at.coords - end).norm() < SAME) {
                    return End::Point(point);
                }
                if let Some((_, at)) = places.iter().find(|(known, _)| (known - end).norm() < SAME) {
                    return End::At(*at);
                }
                let exact = fit * Point::from((before * Point::from(end)).coords);
                let at = Point::from((exact.coords + stream.normal3(sigma)).map(micrometres));
                places.push((end, at));
                End::At(at)
            });
            let turn = fit.rotation() * before.rotation();
            let faces = edge.faces.iter().map(|face| (turn * face).map(micrometres).normalize()).collect();
            let has_place = ends.iter().any(|end| matches!(end, End::At(_)));
            let sigma = if has_place { sigma } else { 0.0 };
            edges.push(ModelEdge { id: format!("edge-{number}"), ends, sigma, faces });
        }
        let chosen = edges.into_iter().enumerate().filter(|(k, _)| listed(*k)).map(|(_, edge)| edge);
        scene.nominal.objects[index].edges = chosen.take(MAX_EDGES).collect();
    }
}

/// The motion object_from_world of the surveyed model before any displacement.
fn surveyed<'a>(
    nominal: impl Iterator<Item = &'a ModelPoint> + Clone,
    described: impl Iterator<Item = &'a ModelPoint> + Clone,
    before: &Transform<World, Object>,
    now: &Transform<World, Object>,
) -> Transform<Object, World> {
    // The nominal frame differs from the described one by the errors of the survey alone.
    let off = |pose: &Transform<World, Object>| -> f64 {
        let pairs = nominal.clone().zip(described.clone());
        pairs.map(|(a, b)| (*pose * a.at).distance(&(*before * b.at)).powi(2)).sum()
    };
    if off(now) <= off(before) { now.inverse() } else { before.inverse() }
}

fn micrometres(x: f64) -> f64 {
    (x * 1e6).round() / 1e6 + 0.0
}

/// Whether most of an edge is free of other bodies and of the seabed.
fn shows(scene: &Scene, edge: &Edge, before: &Transform<World, Object>) -> bool {
    let [from, to] = edge.ends.map(|end| (*before * Point::from(end)).coords);
    if (to - from).norm() < MIN_LENGTH {
        return false;
    }
    let outside: Vector3<f64> = edge.faces.iter().map(|face| before.rotation() * face).sum::<Vector3<f64>>();
    let free = (0..PROBES).filter(|k| {
        let at = from + (to - from) * ((*k as f64 + 0.5) / PROBES as f64) + outside * BESIDE;
        at.z < scene.seabed.down(at.x, at.y) && !scene.encloses(&at)
    });
    2 * free.count() >= PROBES
}

/// The edges of boxes and painted areas, each once.
fn wireframe(shape: &ObjectGeometry) -> Vec<Edge> {
    let mut all: Vec<Edge> = Vec::new();
    let mut add = |edge: Edge| {
        let same = |a: &Vector3<f64>, b: &Vector3<f64>| (a - b).norm() < SAME;
        let [from, to] = &edge.ends;
        let known = |other: &Edge| {
            let [a, b] = &other.ends;
            (same(a, from) && same(b, to)) || (same(a, to) && same(b, from))
        };
        if !all.iter().any(known) {
            all.push(edge);
        }
    };
    for body in &shape.boxes {
        let [roll, pitch, yaw] = body.turn_deg.map(f64::to_radians);
        let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| turn * axis);
        let (centre, half) = (Vector3::from(body.centre), Vector3::from(body.size) / 2.0);
        for along in 0..3 {
            let (one, other) = ((along + 1) % 3, (along + 2) % 3);
            for (a, b) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let middle = centre + axes[one] * (a * half[one]) + axes[other] * (b * half[other]);
                let reach = axes[along] * half[along];
                add(Edge { ends: [middle - reach, middle + reach], faces: vec![axes[one] * a, axes[other] * b] });
            }
        }
    }
    for panel in &shape.panels {
        let corners: Vec<Vector3<f64>> = panel.outline.iter().map(|corner| Vector3::from(*corner)).collect();
        let [a, b, c, ..] = corners[..] else { continue };
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        for k in 0..corners.len() {
            add(Edge { ends: [corners[k], corners[(k + 1) % corners.len()]], faces: vec![normal] });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        scene::{Changes, built_in},
        survey::SurveyErrors,
    };

    /// Fails if ends are not shared, if hidden edges are listed, or if the errors of places are not `sigma`.
    #[test]
    fn the_edges_of_the_drill_centre_are_those_of_its_bodies() {
        let plan = built_in("drill-centre").expect("a built-in site");
        let errors = SurveyErrors { model: 0.001, survey: 0.01 };
        let mut scene = Scene::new(&plan, &Changes::default(), errors, 3);
        add_edges(&mut scene, &plan, 0.001, 1.0, 3);
        let (mut square, mut count, mut inside, mut at_points) = (0.0, 0.0, 0.0, 0);
        for (object, pose) in scene.nominal.objects.iter().zip(&scene.world_from_object) {
            assert!((20..=MAX_EDGES).contains(&object.edges.len()), "{}: {}", object.id, object.edges.len());
            for edge in &object.edges {
                for end in edge.ends {
                    let End::At(at) = end else {
                        at_points += 1;
                        continue;
                    };
                    // A millimetre beside the surface.
                    let off = scene.distance(&(*pose * at).coords, 1.0).unwrap_or(0.0);
                    // The lower ends of the mud mats are in the bed, and some panels end in another body.
                    if off < -0.005 {
                        inside += 1.0;
                        continue;
                    }
                    square += off * off;
                    count += 1.0;
                }
            }
        }
        assert!(at_points > 100, "{at_points}");
        assert!(10.0 * inside < count, "{inside} of {count}");
        assert!((square / count).sqrt() < 0.003, "{}", (square / count).sqrt());
        let text = scene.nominal.to_toml();
        let read = seafix_referencing::Site::parse(&text, std::path::Path::new("site.toml")).expect("a valid site");
        assert_eq!(read.objects[0].edges, scene.nominal.objects[0].edges);
        let all = scene.nominal.objects[0].edges.len();
        add_edges(&mut scene, &plan, 0.001, 1.0 / 3.0, 3);
        assert!(scene.nominal.objects[0].edges.len().abs_diff(all / 3) <= 1);
        add_edges(&mut scene, &plan, 0.001, 0.0, 3);
        assert!(scene.nominal.objects.iter().all(|object| object.edges.is_empty()));
    }
}
