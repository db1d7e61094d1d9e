//! The validation of an edge's faces.

use seafix_component::number;

use super::{
    check::{Checker, SIGMAS},
    edge::ModelEdge,
    model::{BACK, ModelPoint},
};

/// The maximum cosine of the angle between an edge and a face normal: what visibility tolerates of an error of normals.
const ALONG: f64 = -BACK;
/// The minimum sine of the angle between the two normals of an edge, one degree; a flatter ridge is no visible edge.
const DISTINCT: f64 = 0.02;

/// Adds a fault for a normal that is not at right angles to the edge, and for two normals of one plane.
///
/// A face contains its edge, so that its normal is at right angles to it. The tolerance is [`ALONG`], and four standard
/// deviations of the edge's direction.
pub(super) fn faces(check: &mut Checker<'_>, edge: &ModelEdge, points: &[ModelPoint], name: &str, path: &[&str]) {
    let [from, to] = edge.places(points);
    let [a, b] = edge.sigmas(points);
    let along = to - from;
    let allowed = ALONG + SIGMAS * a.hypot(b) / along.norm();
    for face in &edge.faces {
        let cosine = face.dot(&along.normalize()).abs();
        if cosine > allowed {
            let fault = check.at(format!("{name}: a face normal is not at right angles to the edge"), path);
            let value = format!("{:?}, at {:.0}° to it", face.as_slice(), libm::acos(cosine.min(1.0)).to_degrees());
            check.fault(fault.value(value).remedy("a face contains its edge; correct the normal or the ends"));
        }
    }
    if let [one, other] = &edge.faces[..]
        && one.cross(other).norm() < DISTINCT
    {
        let (which, remedy) = match one.dot(other) > 0.0 {
            true => ("equal", "give one of them, or that of the other face"),
            false => ("opposite", "correct one, or omit `faces` of a thin plate: its edge is visible from every side"),
        };
        let fault = check.at(format!("{name}: the two face normals are {which}"), path);
        let degrees = number(one.angle(other).to_degrees());
        check.fault(fault.value(format!("{degrees}° between them")).remedy(remedy));
    }
}
