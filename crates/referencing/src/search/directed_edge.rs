//! Structural coherence of edges whose directions are known.

use nalgebra::{Matrix3, Vector3};

use super::orientation::Sense;
use crate::{
    edge_candidates::OVERLAP,
    edge_coherence::{
        ANGLE_FLOOR, DISTANCE_FLOOR, PARALLEL, Relation, angular_variance, offset_variance, point_agrees,
    },
    space_line::SpaceLine,
};

/// A candidate pair of a model edge and a measured line, with one of the two directions that the edge may have.
///
/// A known direction turns angles, distances and places along the edge into signed numbers, which tell an object from
/// its mirror image and an edge from a parallel one beyond its end.
#[derive(Debug, Clone)]
pub(super) struct DirectedEdge {
    /// The ends of the model edge, object frame (m), in the direction of the line.
    pub(super) model: [Vector3<f64>; 2],
    /// The unit direction of the model edge.
    pub(super) along: Vector3<f64>,
    length: f64,
    /// The measured line.
    pub(super) line: SpaceLine,
}

impl DirectedEdge {
    /// `None` if the ends of the model edge coincide or are not finite.
    pub(super) fn of(model: [Vector3<f64>; 2], line: SpaceLine) -> Option<Self> {
        let step = model[1] - model[0];
        let length = step.norm();
        (length > 0.0 && length.is_finite()).then(|| Self { model, along: step / length, length, line })
    }

    /// Whether the line overlaps the edge if the place `known` (m) along the edge is the place `seen` along the line, up
    /// to an error `slack`.
    fn overlaps(&self, known: f64, seen: f64, slack: f64) -> bool {
        let [low, high] = slides([0.0, self.length], [0.0, self.line.length()]);
        let slide = seen - known;
        low - slack <= slide && slide <= high + slack
    }
}

/// The slides t for which the line x − t overlaps the edge y by the required fraction of the shorter one.
fn slides(y: [f64; 2], x: [f64; 2]) -> [f64; 2] {
    let enough = OVERLAP * (y[1] - y[0]).min(x[1] - x[0]);
    [x[0] - y[1] + enough, x[1] - y[0] - enough]
}

/// Whether two edges agree with two lines: their angle and their distance, within `sigmas` standard deviations, and the
/// overlap of each edge with its line.
///
/// The signed distance must be that of the object (`Proper`), that of its mirror image (`Mirrored`), or either (`Any`).
/// Edges that are nearly parallel have no sign; the distances of the middle of each from the other are compared.
pub(super) fn directed_edges_agree(a: &DirectedEdge, b: &DirectedEdge, sigmas: f64, sense: Sense) -> bool {
    let (one, other) = (&a.line, &b.line);
    let known = Relation::of([&a.model[0], &b.model[0]], [a.along, b.along]);
    let seen = Relation::of([&one.ends[0], &other.ends[0]], [one.direction, other.direction]);
    let angle = |of: &Relation| libm::atan2(of.sine, of.cosine);
    let variance = angular_variance(one, other) + angular_variance(other, one);
    if !((angle(&known) - angle(&seen)).abs() <= sigmas * variance.sqrt() + ANGLE_FLOOR) {
        return false;
    }
    if known.sine <= PARALLEL || seen.sine <= PARALLEL {
        return parallel_agree(a, b, sigmas, known.sine);
    }
    let normal = one.direction.cross(&other.direction) / seen.sine;
    let variance = offset_variance(one, &normal, seen.feet[0]) + offset_variance(other, &normal, seen.feet[1]);
    let off = match sense {
        Sense::Proper => known.signed - seen.signed,
        Sense::Mirrored => known.signed + seen.signed,
        Sense::Any => known.distance - seen.distance,
    };
    if !(off.abs() <= sigmas * variance.sqrt() + DISTANCE_FLOOR) {
        return false;
    }
    // The foot on one line moves along it with the offset of the other in their common plane.
    let slack = |line: &SpaceLine, at: f64| {
        let beside = normal.cross(&line.direction);
        (sigmas * offset_variance(line, &beside, at).sqrt() + DISTANCE_FLOOR) / seen.sine
    };
    a.overlaps(known.feet[0], seen.feet[0], slack(other, seen.feet[1]))
        && b.overlaps(known.feet[1], seen.feet[1], slack(one, seen.feet[0]))
}

/// The test of nearly parallel edges: distances of their middles, and one slide at which both overlap their lines.
fn parallel_agree(a: &DirectedEdge, b: &DirectedEdge, sigmas: f64, sine: f64) -> bool {
    let middle = |ends: &[Vector3<f64>; 2]| (ends[0] + ends[1]) / 2.0;
    let off = |at: Vector3<f64>, from: &Vector3<f64>, along: &Vector3<f64>| {
        let step = at - from;
        step - along * along.dot(&step)
    };
    let distance_agrees = |one: &DirectedEdge, other: &DirectedEdge| {
        let known = off(middle(&other.model), &one.model[0], &one.along).norm();
        let at = middle(&other.line.ends);
        let gap = off(at, &one.line.ends[0], &one.line.direction);
        let normal = gap.try_normalize(1e-9).unwrap_or(one.line.across[0]);
        let place = one.line.direction.dot(&(at - one.line.ends[0]));
        let variance = offset_variance(&one.line, &normal, place)
            + offset_variance(&other.line, &normal, other.line.length() / 2.0);
        // The middles of an edge and of its line may be different places.
        let slope = sine * (other.length + other.line.length()) / 2.0;
        (known - gap.norm()).abs() <= sigmas * variance.sqrt() + DISTANCE_FLOOR + slope
    };
    if !distance_agrees(a, b) || !distance_agrees(b, a) {
        return false;
    }
    let interval = |ends: &[Vector3<f64>; 2], from: &Vector3<f64>, along: &Vector3<f64>| {
        let [p, q] = ends.each_ref().map(|end| along.dot(&(end - from)));
        [p.min(q), p.max(q)]
    };
    let of = |edge: &DirectedEdge| {
        slides(
            interval(&edge.model, &a.model[0], &a.along),
            interval(&edge.line.ends, &a.line.ends[0], &a.line.direction),
        )
    };
    let ([low, high], [from, to]) = (of(a), of(b));
    low.max(from) <= high.min(to) + DISTANCE_FLOOR + sine * (a.length + b.length)
}

/// Whether a point agrees with an edge: its distance from the line within `sigmas` standard deviations, and the overlap
/// of edge and line if the point is in its place along them.
pub(super) fn point_agrees_along(
    point: &Vector3<f64>,
    (place, covariance): (&Vector3<f64>, &Matrix3<f64>),
    edge: &DirectedEdge,
    sigmas: f64,
) -> bool {
    let DirectedEdge { model, along, line, .. } = edge;
    if !point_agrees((point, model), (place, covariance), line, sigmas) {
        return false;
    }
    let known = along.dot(&(point - model[0]));
    let seen = line.direction.dot(&(place - line.ends[0]));
    let variance = line.direction.dot(&(covariance * line.direction));
    edge.overlaps(known, seen, sigmas * variance.max(0.0).sqrt() + DISTANCE_FLOOR)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, Vector6};
    use seafix_geometry::{Camera, MeasuredLine, Object, Point, Transform};

    use super::*;

    const EDGES: [[[f64; 3]; 2]; 3] =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0.2, 0.3, 0.4], [0.2, 1.1, 0.4]], [[0.0, 0.5, 0.0], [1.0, 0.5, 0.0]]];

    fn pose() -> Transform<Camera, Object> {
        Transform::exp(&Vector6::new(0.3, -0.6, 1.0, 0.1, 0.2, 3.0))
    }

    /// Edge k with the part from `from` to `to` (fractions) seen, in a mirrored scene or in the true one.
    fn pair(k: usize, [from, to]: [f64; 2], mirrored: bool) -> DirectedEdge {
        let model = EDGES[k].map(Vector3::from);
        let seen = |t: f64| {
            let at = model[0] + (model[1] - model[0]) * t;
            pose() * Point::new(at.x, at.y, if mirrored { -at.z } else { at.z })
        };
        let ends = [seen(from), seen(to)];
        let line = MeasuredLine { ends, offsets: Matrix4::identity() * 1e-6, segments: None, depth: true };
        DirectedEdge::of(model, SpaceLine::of(&line).expect("a line")).expect("an edge")
    }

    /// Fails if the sign of the distance is not compared.
    #[test]
    fn skew_edges_have_a_sense() {
        for (mirrored, of) in [(false, Sense::Proper), (true, Sense::Mirrored)] {
            let [a, b] = [0, 1].map(|k| pair(k, [0.1, 0.9], mirrored));
            for sense in [Sense::Proper, Sense::Mirrored, Sense::Any] {
                assert_eq!(
                    directed_edges_agree(&a, &b, 3.0, sense),
                    sense == of || sense == Sense::Any,
                    "{of:?} {sense:?}"
                );
            }
        }
    }

    /// A part of each edge is seen. Fails if the distance of parallel edges, or the places along them, are not compared.
    #[test]
    fn parallel_edges_have_a_distance_and_a_common_slide() {
        let [a, b] = [0, 2].map(|k| pair(k, [0.1, 0.9], false));
        assert!(directed_edges_agree(&a, &b, 3.0, Sense::Proper));
        // The same edge twice: the lines coincide and the edges do not.
        let twice = DirectedEdge { line: a.line, ..b.clone() };
        assert!(!directed_edges_agree(&a, &twice, 3.0, Sense::Proper));
        // Lines that overlap their edges at no common slide: the ends of one, and a part 1.5 m further of the other.
        let beyond = pair(2, [1.6, 2.4], false);
        assert!(!directed_edges_agree(&a, &beyond, 3.0, Sense::Proper));
        assert!(directed_edges_agree(&a, &pair(2, [0.6, 1.4], false), 3.0, Sense::Proper));
    }

    /// Fails if the place along the edge is not compared.
    #[test]
    fn a_point_distinguishes_an_edge_from_another_place_on_its_line() {
        let at = Vector3::new(0.4, 0.2, 0.1);
        let (place, noise) = ((pose() * Point::from(at)).coords, Matrix3::identity() * 1e-6);
        let agrees = |part| point_agrees_along(&at, (&place, &noise), &pair(0, part, false), 3.0);
        assert!(agrees([0.1, 0.9]) && agrees([0.7, 1.3]));
        assert!(!agrees([1.1, 1.9]) && !agrees([-0.9, -0.1]));
    }
}
