//! The validation of an object's edges.

use nalgebra::Vector3;
use seafix_component::{counted, number};
use seafix_geometry::Point;

use super::{
    check::{COINCIDENT, Checker, IMPOSSIBLE, SIGMAS, suggestion},
    check_faces::faults_of_faces,
    edge::{End, ModelEdge},
    file::{EdgeFile, EndFile, FORMAT, FORMAT_WITH_EDGES, ObjectFile, SiteFile},
    model::ModelPoint,
    target::diameter,
};

/// The minimum length of an edge (m).
pub(crate) const MIN_LENGTH: f64 = 0.02;
/// The length (m) above which an edge is suspicious: over longer ones a structure bends.
const LONG: f64 = 5.001;
/// The maximum ratio of an edge's length to the diameter of its object's points; beyond, their units differ.
const OF_DIAMETER: f64 = 100.0;
/// The ratio of an end's standard deviation to the diameter above which it is invalid, and to the length above which
/// the edge's direction is open.
const UNKNOWN: f64 = 0.5;
/// The maximum number of edges of an object.
pub(crate) const MAX_EDGES: usize = 500;
/// The allowed difference of a normal's length from one; files give six digits.
const UNIT: f64 = 1e-5;
/// The sine of the largest angle between parallel edges.
const PARALLEL: f64 = 0.02;

/// Adds a fault if a site of the format without edges has edges.
pub(super) fn format(check: &mut Checker<'_>, raw: &SiteFile) {
    let first = raw.objects.iter().find_map(|object| Some((object, object.edges.first()?)));
    if let Some((object, edge)) = first.filter(|_| raw.format != FORMAT_WITH_EDGES) {
        let what = format!("object `{}`: edge `{}` in a file of another format", object.id, edge.id);
        let fault = check.at(what, &["format"]).value(format!("`{FORMAT}`"));
        check.fault(fault.remedy(format!("give format = \"{FORMAT_WITH_EDGES}\"")));
    }
}

/// The edges of an object; faults and warnings go to `check`.
pub(super) fn edges(
    check: &mut Checker<'_>,
    raw: &ObjectFile,
    points: &[ModelPoint],
    of: &str,
    object: &str,
) -> Vec<ModelEdge> {
    if raw.edges.is_empty() {
        return Vec::new();
    }
    if raw.edges.len() > MAX_EDGES {
        let fault = check.at(format!("{of} has too many edges"), &["object", object]);
        let value = counted(raw.edges.len(), "edge");
        check.fault(fault.value(value).remedy(format!("give at most {MAX_EDGES}, the longest and most distinct ones")));
    }
    check.unique(&format!("{of}: edge"), raw.edges.iter().map(|edge| edge.id.as_str()), |index| {
        ["object", object, "edge", index, "id"].map(str::to_owned).to_vec()
    });
    let before = check.faults.len();
    let extent = diameter(points);
    let read: Vec<Option<ModelEdge>> = (raw.edges.iter().enumerate())
        .map(|(i, edge)| one(check, edge, (points, extent), of, object, &i.to_string()))
        .collect();
    if check.faults.len() > before {
        return Vec::new(); // a comparison of invalid edges would only repeat the faults
    }
    let edges: Vec<ModelEdge> = read.into_iter().flatten().collect();
    twice(check, &edges, points, of, object);
    parallel(check, &edges, points, of, object);
    between_points(check, &edges, of, object);
    edges
}

/// One edge of an object with these points and their diameter; `None` after a fault.
fn one(
    check: &mut Checker<'_>,
    raw: &EdgeFile,
    (points, extent): (&[ModelPoint], f64),
    of: &str,
    object: &str,
    index: &str,
) -> Option<ModelEdge> {
    let before = check.faults.len();
    let name = format!("{of}, edge `{}`", raw.id);
    let path = |key: &'static str| ["object", object, "edge", index, key];
    check.sigma(&format!("{name}: `sigma`"), raw.sigma, &path("sigma"));
    let mut end = |key: &'static str, end: &EndFile| match end {
        EndFile::At(at) => {
            check.finite(&format!("{name}: `{key}`"), at, &path(key));
            if at.iter().any(|x| x.is_finite() && x.abs() > IMPOSSIBLE[1]) {
                let fault = check.at(format!("{name}: `{key}` is out of range"), &path(key)).value(format!("{at:?}"));
                check.fault(fault.remedy(format!("give coordinates in metres, at most {:e}", IMPOSSIBLE[1])));
            }
            Some(End::At(Point::from(*at)))
        }
        EndFile::Point(id) => {
            let found = points.iter().position(|point| point.id == *id);
            if found.is_none() {
                let fault = check.at(format!("{name}: unknown point in `{key}`"), &path(key));
                let ids = points.iter().map(|point| point.id.as_str());
                check.fault(fault.value(format!("`{id}`")).remedy(suggestion(id, ids)));
            }
            found.map(End::Point)
        }
    };
    let ends = [end("from", &raw.from), end("to", &raw.to)];
    if raw.faces.len() > 2 {
        let fault = check.at(format!("{name} has too many faces"), &path("faces"));
        check.fault(fault.value(raw.faces.len()).remedy("give the outward normals of the two faces that meet there"));
    }
    for face in &raw.faces {
        check.finite(&format!("{name}: `faces`"), face, &path("faces"));
        let length = Vector3::from(*face).norm();
        if length.is_finite() && (length - 1.0).abs() > UNIT {
            let fault = check.at(format!("{name}: a face normal is not a unit vector"), &path("faces"));
            check.fault(fault.value(format!("{face:?}, of length {}", number(length))).remedy("give unit vectors"));
        }
    }
    if check.faults.len() > before {
        return None;
    }
    let [Some(from), Some(to)] = ends else { return None };
    let edge = ModelEdge {
        id: raw.id.clone(),
        ends: [from, to],
        sigma: raw.sigma,
        faces: raw.faces.iter().map(|face| Vector3::from(*face)).collect(),
    };
    let [a, b] = edge.places(points);
    let length = a.distance(&b);
    if length < MIN_LENGTH {
        let fault = check.at(format!("{name} is too short"), &path("to"));
        let remedy = format!("an edge is at least {} m long; remove it or correct its ends", number(MIN_LENGTH));
        check.fault(fault.value(format!("{} m", number(length))).remedy(remedy));
        return None;
    }
    let away = |end: &Point<_>| points.iter().map(|point| point.at.distance(end)).fold(f64::INFINITY, f64::min);
    let far = length.max(away(&a)).max(away(&b));
    if far > OF_DIAMETER * extent {
        let fault = check.at(format!("{name}: implausible units"), &path("to"));
        let how = if far > length { "from the object's points, whose" } else { "long, the object's points'" };
        let value = format!("{} m {how} diameter is {} m", number(far), number(extent));
        check.fault(fault.value(value).remedy("give coordinates in metres"));
    } else if length > LONG {
        let warning = check.at(format!("{name} is long"), &path("to"));
        let remedy = "check that the edge is straight over its whole length, or split it";
        check.warnings.push(warning.value(format!("{} m", number(length))).remedy(remedy));
    }
    if edge.has_place() {
        sigma(check, &edge, (length, extent), &name, &path("sigma"));
    }
    let [from, to] = edge.sigmas(points);
    for (what, value, remedy) in faults_of_faces(&edge, points, SIGMAS * from.hypot(to) / length) {
        let fault = check.at(format!("{name}: {what}"), &path("faces"));
        check.fault(fault.value(value).remedy(remedy));
    }
    (check.faults.len() == before).then_some(edge)
}

/// Adds a fault if the `sigma` of an edge leaves its place open, and a warning if it leaves its direction open.
fn sigma(check: &mut Checker<'_>, edge: &ModelEdge, (length, extent): (f64, f64), name: &str, path: &[&str]) {
    let at = |check: &Checker<'_>, what: &str, of: String| {
        check.at(format!("{name}: {what}"), path).value(format!("{} m, {of}", number(edge.sigma)))
    };
    if edge.sigma > UNKNOWN * extent {
        let fault = at(check, "`sigma` is out of range", format!("the object's diameter is {} m", number(extent)));
        check.fault(fault.remedy("give metres, at most half of the diameter"));
    } else if edge.sigma > UNKNOWN * length {
        let warning = at(check, "`sigma` leaves its direction open", format!("its length is {} m", number(length)));
        check.warnings.push(warning.remedy("give the standard deviation of its ends in metres, or remove the edge"));
    }
}

/// Warns of a `sigma` of edges whose ends are both points: they have the standard deviations of these.
fn between_points(check: &mut Checker<'_>, edges: &[ModelEdge], of: &str, object: &str) {
    let all: Vec<usize> = (0..edges.len()).filter(|&i| !edges[i].has_place() && edges[i].sigma > 0.0).collect();
    let Some(first) = all.first() else { return };
    let path = ["object", object, "edge", &first.to_string(), "sigma"];
    let warning = check.at(format!("{of}: `sigma` of edges between points has no effect"), &path);
    let value = format!("{}, e.g. `{}`", counted(all.len(), "edge"), edges[*first].id);
    check.warnings.push(warning.value(value).remedy("remove it, and give the `sigma` of the points"));
}

/// Adds a fault for every two edges whose ends coincide, and a warning if they do within two standard deviations.
fn twice(check: &mut Checker<'_>, edges: &[ModelEdge], points: &[ModelPoint], of: &str, object: &str) {
    for (i, one) in edges.iter().enumerate() {
        let ([a, b], [sa, sb]) = (one.places(points), one.sigmas(points));
        for other in &edges[..i] {
            let ([c, d], [sc, sd]) = (other.places(points), other.sigmas(points));
            let within = |sigmas: f64| {
                let near =
                    |p: &Point<_>, s: f64, q: &Point<_>, t: f64| p.distance(q) <= (sigmas * s.hypot(t)).max(COINCIDENT);
                (near(&a, sa, &c, sc) && near(&b, sb, &d, sd)) || (near(&a, sa, &d, sd) && near(&b, sb, &c, sc))
            };
            let path = ["object", object, "edge", &i.to_string()];
            let value = format!("`{}` and `{}`", other.id, one.id);
            if within(0.0) {
                let fault = check.at(format!("{of}: the same edge twice"), &path);
                check.fault(fault.value(value).remedy("remove one"));
            } else if within(2.0) {
                let warning = check.at(format!("{of}: two edges coincide within their errors"), &path);
                check.warnings.push(warning.value(value).remedy("remove one, or state a smaller `sigma`"));
            }
        }
    }
}

/// Warns if all edges have one direction: they leave a shift along it open.
fn parallel(check: &mut Checker<'_>, edges: &[ModelEdge], points: &[ModelPoint], of: &str, object: &str) {
    let direction = |edge: &ModelEdge| {
        let [a, b] = edge.places(points);
        (b - a).normalize()
    };
    let Some(first) = edges.first().map(direction) else { return };
    if edges.len() > 1 && edges.iter().all(|edge| direction(edge).cross(&first).norm() < PARALLEL) {
        let warning = check.at(format!("{of}: all edges are parallel"), &["object", object, "edge", "0"]);
        let remedy = "add edges of another direction; parallel edges do not measure a shift along them";
        check.warnings.push(warning.value(counted(edges.len(), "edge")).remedy(remedy));
    }
}
