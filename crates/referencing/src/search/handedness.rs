//! Handedness of points and directed edges: volumes that a mirror image reverses.

use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};
use smallvec::SmallVec;

use super::{directed_edge::DirectedEdge, orientation::Sense};
use crate::edge_coherence::{ANGLE_FLOOR, DISTANCE_FLOOR};

/// Standard deviations of the measured volume that a model volume must exceed to decide, as for four points.
const DECISIVE: f64 = 3.0;

/// A feature of a triple.
#[derive(Debug, Clone, Copy)]
pub(super) enum Feature<'a> {
    /// A model point, with its measurement and the covariance of that.
    Point(Vector3<f64>, Vector3<f64>, &'a Matrix3<f64>),
    /// An edge.
    Edge(&'a DirectedEdge),
}

/// The places of a triple: points, and lines by origin and direction.
#[derive(Debug, Clone, Default)]
struct Places {
    points: SmallVec<[Vector3<f64>; 3]>,
    lines: SmallVec<[[Vector3<f64>; 2]; 3]>,
}

impl Places {
    /// The volume that the features span, independent of places along the lines: (q − p) · (o − p) × d of two points and
    /// a line (m²), (o − p) · d × e of a point and two lines (m), d · e × f of three lines.
    ///
    /// `second` takes the origin of the second line for a point and two lines.
    fn volume(&self, second: bool) -> f64 {
        match (&self.points[..], &self.lines[..]) {
            ([p, q], [[o, d]]) => (q - p).dot(&(o - p).cross(d)),
            ([p], [[o, d], [other, e]]) => ((if second { other } else { o }) - p).dot(&d.cross(e)),
            ([], [[_, d], [_, e], [_, f]]) => d.dot(&e.cross(f)),
            _ => 0.0,
        }
    }

    /// The error of the volume that the model's errors may cause.
    fn floor(&self) -> f64 {
        match (&self.points[..], &self.lines[..]) {
            ([p, q], _) => DISTANCE_FLOOR * (q - p).norm(),
            ([_], _) => DISTANCE_FLOOR,
            _ => ANGLE_FLOOR,
        }
    }
}

/// Whether three features, one of them an edge, contradict the sense.
///
/// The model's volume exceeds three standard deviations of the measured one and the model's errors, and the measured
/// volume has the other sign.
pub(super) fn rejects(features: [Feature<'_>; 3], sense: Sense) -> bool {
    let Some(sign) = sense.sign() else { return false };
    let (mut model, mut seen) = (Places::default(), Places::default());
    let (mut points, mut edges) = (SmallVec::<[&Matrix3<f64>; 3]>::new(), SmallVec::<[&DirectedEdge; 3]>::new());
    for feature in features {
        match feature {
            Feature::Point(known, place, covariance) => {
                model.points.push(known);
                seen.points.push(place);
                points.push(covariance);
            }
            Feature::Edge(edge) => {
                model.lines.push([edge.model[0], edge.along]);
                seen.lines.push([edge.line.ends[0], edge.line.direction]);
                edges.push(edge);
            }
        }
    }
    let second = model.volume(true).abs() > model.volume(false).abs();
    let (known, measured) = (model.volume(second), seen.volume(second));
    let floor = model.floor();
    if !(known.abs() > floor) || sign * known * measured > 0.0 {
        return false;
    }
    known.abs() > DECISIVE * variance(&mut seen, (&points, &edges), second).max(0.0).sqrt() + floor
}

/// The variance of the measured volume; it is linear in each measured coordinate, so that a step of one is its derivative.
fn variance(seen: &mut Places, (points, edges): (&[&Matrix3<f64>], &[&DirectedEdge]), second: bool) -> f64 {
    let measured = seen.volume(second);
    let mut sum = 0.0;
    for (k, covariance) in points.iter().enumerate() {
        let gradient = Vector3::from_fn(|axis, _| {
            seen.points[k][axis] += 1.0;
            let moved = seen.volume(second);
            seen.points[k][axis] -= 1.0;
            moved - measured
        });
        sum += gradient.dot(&(*covariance * gradient));
    }
    for (k, edge) in edges.iter().enumerate() {
        let (line, kept) = (&edge.line, seen.lines[k]);
        let noise: &Matrix4<f64> = &line.noise;
        let gradient = Vector4::from_fn(|offset, _| {
            // The length is constant to first order.
            let step = line.across[offset % 2];
            let turn = step / line.length();
            seen.lines[k] = if offset < 2 { [kept[0] + step, kept[1] - turn] } else { [kept[0], kept[1] + turn] };
            let moved = seen.volume(second);
            seen.lines[k] = kept;
            moved - measured
        });
        sum += gradient.dot(&(noise * gradient));
    }
    sum
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;
    use seafix_geometry::{MeasuredLine, Point};

    use super::*;
    use crate::space_line::SpaceLine;

    /// Every kind of triple, and its mirror image at z = 0.
    ///
    /// Fails if the volume of a kind is zero, and if the noise is taken to be a hundred times as great.
    #[test]
    fn every_kind_of_triple_distinguishes_an_object_from_its_image() {
        let noise = Matrix3::identity() * 1e-6;
        let reflected = |p: Vector3<f64>| Vector3::new(p.x, p.y, -p.z);
        let moved = |p: Vector3<f64>| p + Vector3::new(0.0, 0.0, 3.0);
        let places = [[0.1, 0.2, 0.0], [0.9, -0.3, 0.4]].map(Vector3::from);
        let lines = [
            [[0.0, 0.0, 0.5], [1.0, 0.1, 0.6]],
            [[0.3, 0.8, 0.1], [0.2, -0.4, 0.3]],
            [[-0.5, 0.1, 0.2], [-0.4, 0.2, 0.9]],
        ];
        for mirrored in [false, true] {
            let image = |p: Vector3<f64>| moved(if mirrored { reflected(p) } else { p });
            let points = places.map(|p| (p, image(p)));
            let edges = lines.map(|ends| {
                let model = ends.map(Vector3::from);
                let ends = model.map(|end| Point::from(image(end)));
                let line = MeasuredLine { ends, offsets: Matrix4::identity() * 1e-6, segments: None, depth: true };
                DirectedEdge::of(model, SpaceLine::of(&line).expect("a line")).expect("an edge")
            });
            let point = |k: usize| Feature::Point(points[k].0, points[k].1, &noise);
            let edge = |k: usize| Feature::Edge(&edges[k]);
            for (name, triple) in [
                ("two points", [point(0), edge(0), point(1)]),
                ("one point", [edge(0), edge(1), point(1)]),
                ("three edges", [edge(0), edge(1), edge(2)]),
            ] {
                assert_eq!(rejects(triple, Sense::Proper), mirrored, "{name}");
                assert_eq!(rejects(triple, Sense::Mirrored), !mirrored, "{name}");
                assert!(!rejects(triple, Sense::Any), "{name}");
            }
        }
    }
}
