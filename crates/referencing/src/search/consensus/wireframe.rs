//! The wireframe of a model, and its parallel redrawings.

use faer::Mat;
use nalgebra::Vector3;

use crate::site::{edge::ModelEdge, model::ModelPoint};

/// Distance of two places that count as one, in standard deviations of their errors; 4.5 hold 99.98 % in space.
const TOGETHER: f64 = 4.5;
/// The same, as a fraction of the shorter edge: chamfers, and ends that were measured one by one.
const CHAMFER: f64 = 0.05;
/// Standard deviation of the displacement (RMS over the vertices) by one redrawing, relative to the mean length of the
/// edges at a vertex.
///
/// A side of a box then varies by twice that, 28 % of its length: neighbours of the object, and its shadow, are about as
/// large as the object.
const SPREAD: f64 = 0.141;
/// Standard deviation of a vertex across an edge on which it stays, relative to that of the vertex alone.
const TIGHT: f64 = 1e-4;
/// Minimum cosine of the angle between two directions that count as one: 2°.
const ALONG: f64 = 0.9994;
/// Maximum cosine of the angle between two directions that count as at right angles: 2°.
const ACROSS: f64 = 0.035;

/// The corners of a model, connected by its edges.
///
/// Most structures are made of edges in three directions at right angles (Coughlan, Yuille 1999, "Manhattan world"). A
/// *parallel redrawing* (Whiteley 1996) moves the vertices so that each of these edges keeps its direction: a translation,
/// a change of scale, or, of a box, a change of its width, depth or height. The other edges, as braces, follow their
/// ends. Structures of the same kind as the object, as another box with parallel sides, are redrawings of it.
#[derive(Debug, Clone)]
pub(super) struct Wireframe {
    /// The vertices of each edge.
    pub(super) edges: Vec<[usize; 2]>,
    /// The vertex of each model point; `None` for a point on no edge.
    pub(super) points: Vec<Option<usize>>,
    /// The standard deviation (m) of the displacement of each vertex by one redrawing.
    sigmas: Vec<f64>,
    /// The connected part of each vertex, as its first vertex.
    parts: Vec<usize>,
    constraints: Vec<Constraint>,
}

/// A vertex v that stays on the line of an edge from a to b: v − (1 − t) a − t b remains parallel to the edge.
#[derive(Debug, Clone)]
struct Constraint {
    /// v, a and b with their weights.
    terms: [(usize, f64); 3],
    /// Two unit vectors across the edge; `None` if the edge may turn.
    across: Option<[Vector3<f64>; 2]>,
}

/// A place with the standard deviation of its error and the length of its first edge (m), infinite for a point.
#[derive(Debug, Clone, Copy)]
struct Vertex {
    at: Vector3<f64>,
    error: f64,
    length: f64,
}

impl Vertex {
    fn together(&self, other: &Self) -> bool {
        (self.at - other.at).norm() <= self.reach(other)
    }

    fn reach(&self, other: &Self) -> f64 {
        let length = Some(self.length.min(other.length)).filter(|length| length.is_finite());
        TOGETHER * self.error.hypot(other.error) + CHAMFER * length.unwrap_or(0.0)
    }
}

impl Wireframe {
    pub(super) fn of(points: &[ModelPoint], edges: &[ModelEdge]) -> Self {
        let mut vertices: Vec<Vertex> = Vec::new();
        let mut vertex = |new: Vertex| {
            let known = vertices.iter().position(|known| known.together(&new));
            known.unwrap_or_else(|| {
                vertices.push(new);
                vertices.len() - 1
            })
        };
        let ends = |edge: &ModelEdge| edge.places(points).map(|end| end.coords);
        let steps: Vec<Vector3<f64>> = edges.iter().map(ends).map(|[from, to]| to - from).collect();
        let of_edge = |(edge, step): (&ModelEdge, &Vector3<f64>)| {
            let (ends, errors) = (ends(edge), edge.sigmas(points));
            [0, 1].map(|k| vertex(Vertex { at: ends[k], error: errors[k], length: step.norm() }))
        };
        let of_edges: Vec<[usize; 2]> = edges.iter().zip(&steps).map(of_edge).collect();
        let of_point =
            |point: &ModelPoint| vertex(Vertex { at: point.at.coords, error: point.sigma, length: f64::INFINITY });
        let of_points: Vec<usize> = points.iter().map(of_point).collect();
        // Vertices on edges, ends first: (v, edge, t).
        let proper = |(k, [a, b]): (usize, &[usize; 2])| (a != b).then_some((*b, k, 0.0));
        let mut on: Vec<(usize, usize, f64)> = of_edges.iter().enumerate().filter_map(proper).collect();
        let proper: Vec<usize> = on.iter().map(|(_, edge, _)| *edge).collect();
        for (v, vertex) in vertices.iter().enumerate() {
            for &k in proper.iter().filter(|&&k| !of_edges[k].contains(&v)) {
                let from = vertices[of_edges[k][0]];
                let step = vertex.at - from.at;
                let t = step.dot(&steps[k]) / steps[k].norm_squared();
                if t > 0.0 && t < 1.0 && (step - steps[k] * t).norm() <= vertex.reach(&from).min(from.reach(&from)) {
                    on.push((v, k, t));
                }
            }
        }
        let parts = parts(vertices.len(), on.iter().map(|&(v, edge, _)| [v, of_edges[edge][0], of_edges[edge][1]]));
        let keeps = kept_directions(&steps, &of_edges.iter().map(|[a, _]| parts[*a]).collect::<Vec<_>>());
        let mut lengths = vec![(0.0, 0.0); vertices.len()];
        let mut constraints = Vec::with_capacity(on.len());
        for (v, edge, t) in on {
            let ([a, b], length) = (of_edges[edge], steps[edge].norm());
            let across = keeps[edge].then(|| seafix_geometry::across(&steps[edge].normalize()));
            constraints.push(Constraint { terms: [(v, 1.0), (a, t - 1.0), (b, -t)], across });
            for v in [v, a] {
                lengths[v] = (lengths[v].0 + length, lengths[v].1 + 1.0);
            }
        }
        Self {
            edges: of_edges,
            points: of_points.into_iter().map(|v| (lengths[v].1 > 0.0).then_some(v)).collect(),
            sigmas: lengths.into_iter().map(|(sum, count)| SPREAD * sum / f64::max(count, 1.0)).collect(),
            parts,
            constraints,
        }
    }

    /// The number of vertices.
    pub(super) fn count(&self) -> usize {
        self.parts.len()
    }

    /// The vertices of the parts of some vertices, ascending.
    pub(super) fn connected(&self, some: &[usize]) -> Vec<usize> {
        let seen = |v: &usize| some.iter().any(|other| self.parts[*other] == self.parts[*v]);
        (0..self.parts.len()).filter(seen).collect()
    }

    /// The information on the displacements of the vertices of some whole parts, three rows a vertex.
    ///
    /// The redrawings of a part of n vertices are u = N c, with orthonormal columns N and c ~ N(0, n s² I), s the standard
    /// deviation of `sigmas`: each moves the vertices by s (RMS).
    pub(super) fn information(&self, vertices: &[usize]) -> Mat<f64> {
        let mut information = Mat::zeros(3 * vertices.len(), 3 * vertices.len());
        for (k, v) in vertices.iter().enumerate() {
            let count = self.parts.iter().filter(|part| **part == self.parts[*v]).count() as f64;
            let own = 1.0 / (count * self.sigmas[*v].powi(2)).max(f64::MIN_POSITIVE);
            (3 * k..3 * k + 3).for_each(|k| information[(k, k)] += own);
        }
        for Constraint { terms, across } in &self.constraints {
            let tight =
                1.0 / terms.map(|(v, _)| TIGHT * self.sigmas[v]).iter().fold(f64::MAX, |a, b| a.min(*b)).powi(2);
            let places = terms.map(|(v, weight)| Some((vertices.binary_search(&v).ok()?, weight)));
            let placed =
                || places.iter().flatten().flat_map(|(k, weight)| (0..3).map(move |axis| (3 * k + axis, axis, weight)));
            for normal in across.iter().flatten() {
                for (row, i, one) in placed() {
                    for (column, j, other) in placed() {
                        information[(row, column)] += tight * one * other * normal[i] * normal[j];
                    }
                }
            }
        }
        information
    }
}

/// Whether each edge lies in one of the three directions at right angles that most edges of its part have.
fn kept_directions(steps: &[Vector3<f64>], parts: &[usize]) -> Vec<bool> {
    let directions: Vec<Option<Vector3<f64>>> = steps.iter().map(|step| step.try_normalize(0.0)).collect();
    let mut keeps = vec![false; steps.len()];
    for first in 0..steps.len() {
        if parts[..first].contains(&parts[first]) {
            continue;
        }
        let own: Vec<usize> = (first..steps.len()).filter(|&k| parts[k] == parts[first]).collect();
        let along = |axis: &Vector3<f64>, k: usize| directions[k].is_some_and(|of| of.dot(axis).abs() >= ALONG);
        let mut axes: Vec<(usize, Vector3<f64>)> = Vec::new();
        while axes.len() < 3 {
            let free = own.iter().filter_map(|&k| directions[k]);
            let free = free.filter(|of| axes.iter().all(|(_, axis)| of.dot(axis).abs() <= ACROSS));
            // The first of equals.
            let counted = free.map(|axis| (own.iter().filter(|&&k| along(&axis, k)).count(), axis));
            let best = counted.reduce(|best, next| if next.0 > best.0 { next } else { best });
            let Some(best) = best else { break };
            axes.push(best);
        }
        // One edge alone has no direction in common with others.
        let several = axes.len() > 1 || axes.first().is_some_and(|(count, _)| *count > 1);
        own.iter().for_each(|&k| keeps[k] = several && axes.iter().any(|(_, axis)| along(axis, k)));
    }
    keeps
}

/// The part of each vertex: some triples are connected.
fn parts(count: usize, connected: impl Iterator<Item = [usize; 3]>) -> Vec<usize> {
    let mut parts: Vec<usize> = (0..count).collect();
    for [v, a, b] in connected {
        for [one, other] in [[v, a], [a, b]] {
            let (low, high) = (parts[one].min(parts[other]), parts[one].max(parts[other]));
            parts.iter_mut().filter(|part| **part == high).for_each(|part| *part = low);
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use faer::Side;
    use seafix_geometry::Point;

    use super::*;
    use crate::site::edge::End;

    const SIDES: [[usize; 2]; 12] =
        [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

    fn corner(k: usize) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| if k >> axis & 1 == 1 { 0.3 + 0.1 * axis as f64 } else { 0.0 })
    }

    fn edges(sides: &[[usize; 2]], at: Vector3<f64>) -> Vec<ModelEdge> {
        let edge = |ends: &[usize; 2]| ModelEdge {
            id: String::new(),
            ends: ends.map(|k| End::At(Point::from(corner(k) + at))),
            sigma: 1e-4,
            faces: Vec::new(),
        };
        sides.iter().map(edge).collect()
    }

    /// The number of redrawings of all parts: directions in which the vertices move freely.
    fn redrawings(edges: &[ModelEdge], points: &[ModelPoint]) -> usize {
        let wireframe = Wireframe::of(points, edges);
        let vertices: Vec<usize> = (0..wireframe.parts.len()).collect();
        let free = wireframe.sigmas.iter().fold(f64::INFINITY, |a, b| a.min(*b)).powi(-2) / TIGHT;
        let eigenvalues = wireframe.information(&vertices).self_adjoint_eigenvalues(Side::Lower).expect("symmetric");
        eigenvalues.iter().filter(|value| **value < free).count()
    }

    /// Whiteley 1996: a simple polyhedron has one redrawing for each face.
    #[test]
    fn a_box_has_six_redrawings() {
        let at = Vector3::zeros();
        assert_eq!(redrawings(&edges(&SIDES, at), &[]), 6);
        let apart = edges(&SIDES, Vector3::new(2.0, 0.3, 0.1));
        assert_eq!(redrawings(&[edges(&SIDES, at), apart].concat(), &[]), 12);
        // A U of three sides: every length changes by itself.
        assert_eq!(redrawings(&edges(&[[2, 0], [0, 1], [1, 3]], at), &[]), 6);
        // Braces follow their ends, and the corners of a triangle without right angles are free.
        assert_eq!(redrawings(&[edges(&SIDES, at), edges(&[[0, 3], [1, 7], [4, 7]], at)].concat(), &[]), 6);
        assert_eq!(redrawings(&edges(&[[1, 2], [2, 4], [4, 1]], at), &[]), 9);
    }

    /// Chamfered corners are corners: ends up to a twentieth of the shorter edge apart.
    #[test]
    fn ends_near_each_other_are_one_corner() {
        let mut all = edges(&SIDES, Vector3::zeros());
        for edge in &mut all {
            let [from, to] = edge.places(&[]).map(|end| end.coords);
            let gap = (to - from) * 0.02;
            edge.ends = [End::At(Point::from(from + gap)), End::At(Point::from(to - gap))];
        }
        assert_eq!(redrawings(&all, &[]), 6);
    }

    /// A lattice of 6 × 6 × 5 vertices has the spacings between its fourteen pairs of planes, and three translations.
    #[test]
    fn a_large_lattice_has_its_spacings() {
        let count = [6, 6, 5];
        let places = || (0..count.iter().product()).map(|k: usize| [k / 30, k / 5 % 6, k % 5]);
        let at = |k: [usize; 3]| End::At(Point::from(Vector3::from(k.map(|k| 0.3 * k as f64))));
        let beside = |k: [usize; 3], axis: usize| {
            let mut next = k;
            next[axis] += 1;
            (next[axis] < count[axis]).then(|| ModelEdge {
                id: String::new(),
                ends: [at(k), at(next)],
                sigma: 0.0,
                faces: Vec::new(),
            })
        };
        let edges: Vec<ModelEdge> = places().flat_map(|k| (0..3).filter_map(move |axis| beside(k, axis))).collect();
        assert_eq!(redrawings(&edges, &[]), 17);
        let wireframe = Wireframe::of(&[], &edges);
        assert!(wireframe.information(&(0..180).collect::<Vec<_>>()).llt(Side::Lower).is_ok());
    }

    #[test]
    fn a_point_at_a_corner_is_the_corner_and_a_point_on_an_edge_slides() {
        let edges = edges(&SIDES, Vector3::zeros());
        let at = |place: Vector3<f64>| ModelPoint::exact("", Point::from(place));
        let points = [at(corner(5)), at((corner(0) + corner(1)) / 2.0), at(Vector3::new(0.1, 0.1, 0.9))];
        let wireframe = Wireframe::of(&points, &edges);
        assert_eq!(wireframe.points[0], Some(wireframe.edges[2][1]));
        assert!(wireframe.points[1].is_some() && wireframe.points[2].is_none(), "{:?}", wireframe.points);
        // Six of the box, one of the point that slides.
        assert_eq!(redrawings(&edges, &points[..2]), 7);
    }
}
