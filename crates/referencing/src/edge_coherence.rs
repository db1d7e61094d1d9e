//! Structural coherence of edges: the angle and the distance of two edges, and the distance of a point from an edge.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use crate::space_line::SpaceLine;

/// Sine of the angle below which two edges count as parallel, so that their shortest distance is undefined.
pub(crate) const PARALLEL: f64 = 0.2;
/// Tolerances (rad, m) for the errors of the model.
pub(crate) const ANGLE_FLOOR: f64 = 0.02;
pub(crate) const DISTANCE_FLOOR: f64 = 5e-3;

/// The sine of the angle between two model edges if it and their shortest distance agree with those of the measured
/// lines, each within `sigmas` of its own standard deviations; `None` if they do not.
///
/// The directions of the lines are free. The distance of edges that are nearly parallel is not compared.
pub(crate) fn edges_agree(model: [&[Vector3<f64>; 2]; 2], lines: [&SpaceLine; 2], sigmas: f64) -> Option<f64> {
    let [one, other] = lines;
    let along = |ends: &[Vector3<f64>; 2]| (ends[1] - ends[0]).normalize();
    let known = Relation::of(model.map(|ends| &ends[0]), model.map(along));
    let seen = Relation::of([&one.ends[0], &other.ends[0]], [one.direction, other.direction]);
    let angle = angular_variance(one, other) + angular_variance(other, one);
    if !((known.angle - seen.angle).abs() <= sigmas * angle.sqrt() + ANGLE_FLOOR) {
        return None;
    }
    if known.sine > PARALLEL && seen.sine > PARALLEL {
        let normal = one.direction.cross(&other.direction) / seen.sine;
        let variance = offset_variance(one, &normal, seen.feet[0]) + offset_variance(other, &normal, seen.feet[1]);
        let distance = sigmas * variance.sqrt() + DISTANCE_FLOOR;
        return ((known.distance - seen.distance).abs() <= distance).then_some(known.sine);
    }
    Some(known.sine)
}

/// Whether the distance of a model point from a model edge agrees with that of the measured point from the measured
/// line, within `sigmas` standard deviations.
pub(crate) fn point_agrees(
    (point, edge): (&Vector3<f64>, &[Vector3<f64>; 2]),
    (place, covariance): (&Vector3<f64>, &Matrix3<f64>),
    line: &SpaceLine,
    sigmas: f64,
) -> bool {
    let across = |at: &Vector3<f64>, from: &Vector3<f64>, along: &Vector3<f64>| {
        let step = at - from;
        step - along * along.dot(&step)
    };
    let known = across(point, &edge[0], &(edge[1] - edge[0]).normalize()).norm();
    let off = across(place, &line.ends[0], &line.direction);
    let normal = off.try_normalize(1e-9).unwrap_or(line.across[0]);
    let at = line.direction.dot(&(place - line.ends[0]));
    let variance = normal.dot(&(covariance * normal)) + offset_variance(line, &normal, at);
    (known - off.norm()).abs() <= sigmas * variance.sqrt() + DISTANCE_FLOOR
}

/// The relation of two lines in space.
pub(crate) struct Relation {
    /// From 0 to π/2.
    angle: f64,
    /// The sine and the cosine of the angle between the directions.
    pub(crate) sine: f64,
    pub(crate) cosine: f64,
    /// The shortest distance of the lines, positive if the second passes on the side of d × e.
    pub(crate) signed: f64,
    /// Its magnitude.
    pub(crate) distance: f64,
    /// The places of the shortest distance, along each direction from its origin.
    pub(crate) feet: [f64; 2],
}

impl Relation {
    pub(crate) fn of([a, b]: [&Vector3<f64>; 2], [d, e]: [Vector3<f64>; 2]) -> Self {
        let normal = d.cross(&e);
        let (sine, cosine) = (normal.norm(), d.dot(&e));
        let step = b - a;
        let square = (sine * sine).max(1e-12);
        let (x, y) = (step.dot(&d), step.dot(&e));
        let signed = step.dot(&normal) / sine.max(1e-6);
        Self {
            angle: libm::atan2(sine, cosine.abs()),
            sine,
            cosine,
            signed,
            distance: signed.abs(),
            feet: [(x - cosine * y) / square, (cosine * x - y) / square],
        }
    }
}

fn block(line: &SpaceLine, i: usize, k: usize) -> Matrix2<f64> {
    line.noise.fixed_view::<2, 2>(2 * i, 2 * k).into_owned()
}

/// The variance (rad²) of a line's direction in the plane that it spans with another.
pub(crate) fn angular_variance(line: &SpaceLine, other: &SpaceLine) -> f64 {
    let in_plane = other.direction - line.direction * line.direction.dot(&other.direction);
    let toward = in_plane.try_normalize(1e-6).unwrap_or(line.across[0]);
    let u = Vector2::new(line.across[0].dot(&toward), line.across[1].dot(&toward));
    let spread = block(line, 0, 0) + block(line, 1, 1) - block(line, 0, 1) - block(line, 1, 0);
    u.dot(&(spread * u)).max(0.0) / line.length().powi(2)
}

/// The variance (m²) of a line's offset along a normal at a distance (m) from its first end.
pub(crate) fn offset_variance(line: &SpaceLine, normal: &Vector3<f64>, at: f64) -> f64 {
    let s = at / line.length();
    let u = Vector2::new(line.across[0].dot(normal), line.across[1].dot(normal));
    let mixed = block(line, 0, 1) + block(line, 1, 0);
    let spread = block(line, 0, 0) * (1.0 - s).powi(2) + block(line, 1, 1) * s * s + mixed * (s * (1.0 - s));
    u.dot(&(spread * u)).max(0.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, Vector6};
    use seafix_geometry::{Camera, MeasuredLine, Object, Point, Transform};

    use super::*;

    const EDGES: [[[f64; 3]; 2]; 3] =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0.2, 0.3, 0.4], [0.2, 1.1, 0.4]], [[0.0, 0.5, 0.0], [1.0, 0.5, 0.0]]];

    fn model(k: usize) -> [Vector3<f64>; 2] {
        EDGES[k].map(Vector3::from)
    }

    fn seen(k: usize, off: Vector3<f64>) -> SpaceLine {
        let pose = Transform::<Camera, Object>::exp(&Vector6::new(0.3, -0.6, 1.0, 0.1, 0.2, 3.0));
        let ends = model(k).map(|end| Point::from((pose * Point::from(end)).coords + off));
        let line =
            MeasuredLine { ends: [ends[1], ends[0]], offsets: Matrix4::identity() * 1e-6, segments: None, depth: true };
        SpaceLine::of(&line).expect("a line")
    }

    #[test]
    fn edges_of_one_object_agree_and_others_do_not() {
        let none = Vector3::zeros();
        for (i, k, sine) in [(0, 1, 1.0), (0, 2, 0.0), (1, 2, 1.0)] {
            let agree = edges_agree([&model(i), &model(k)], [&seen(i, none), &seen(k, none)], 3.0);
            assert!(agree.is_some_and(|found| (found - sine).abs() < 1e-12), "{i} {k}: {agree:?}");
        }
        // Another distance, and another angle.
        let normal = seen(0, none).direction.cross(&seen(1, none).direction);
        assert_eq!(edges_agree([&model(0), &model(1)], [&seen(0, none), &seen(1, normal * 0.02)], 3.0), None);
        assert_eq!(edges_agree([&model(0), &model(2)], [&seen(0, none), &seen(1, none)], 3.0), None);
    }

    #[test]
    fn a_point_agrees_at_its_distance_from_an_edge() {
        let pose = Transform::<Camera, Object>::exp(&Vector6::new(0.3, -0.6, 1.0, 0.1, 0.2, 3.0));
        let (at, line, noise) = (Vector3::new(0.4, 0.2, 0.1), seen(0, Vector3::zeros()), Matrix3::identity() * 1e-6);
        let place = (pose * Point::from(at)).coords;
        assert!(point_agrees((&at, &model(0)), (&place, &noise), &line, 3.0));
        let beside = Vector3::new(0.4, 0.25, 0.1);
        assert!(!point_agrees((&beside, &model(0)), (&place, &noise), &line, 3.0));
    }
}
