//! The validation of an edge's faces.

use seafix_component::number;

use super::{
    edge::ModelEdge,
    model::{BACK, ModelPoint},
};

/// The maximum cosine of the angle between an edge and a face normal: what visibility tolerates of an error of normals.
const ALONG: f64 = -BACK;
/// The minimum sine of the angle between the two normals of an edge, one degree; a flatter ridge is no visible edge.
const DISTINCT: f64 = 0.02;

/// A fault of a face: what is wrong, the value and the remedy.
pub(super) type FaceFault = (String, String, &'static str);

/// The faults of normals that are not at right angles to the edge, and of two normals of one plane.
///
/// A face contains its edge, so that its normal is at right angles to it. The tolerance is [`ALONG`], and `error` (rad),
/// that of the edge's direction.
pub(super) fn faults_of_faces(edge: &ModelEdge, points: &[ModelPoint], error: f64) -> Vec<FaceFault> {
    let [from, to] = edge.places(points);
    let along = (to - from).normalize();
    let mut faults = Vec::new();
    for face in &edge.faces {
        let cosine = face.dot(&along).abs();
        if cosine > ALONG + error {
            let value = format!("{:?}, at {:.0}° to it", face.as_slice(), libm::acos(cosine.min(1.0)).to_degrees());
            let what = "a face normal is not at right angles to the edge".to_owned();
            faults.push((what, value, "a face contains its edge; correct the normal or the ends"));
        }
    }
    if let [one, other] = &edge.faces[..]
        && one.cross(other).norm() < DISTINCT
    {
        let (which, remedy) = match one.dot(other) > 0.0 {
            true => ("equal", "give one of them, or that of the other face"),
            false => ("opposite", "correct one, or omit `faces` of a thin plate: its edge is visible from every side"),
        };
        let value = format!("{}° between them", number(one.angle(other).to_degrees()));
        faults.push((format!("the two face normals are {which}"), value, remedy));
    }
    faults
}
