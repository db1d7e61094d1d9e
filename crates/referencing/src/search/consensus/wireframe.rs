//! The wireframe of a model, and its parallel redrawings.

use nalgebra::{DMatrix, DVector, Vector3};

use crate::site::{edge::ModelEdge, model::ModelPoint};

/// Standard deviations within which a place is an end of an edge, or lies on the edge.
const TOGETHER: f64 = 3.0;
/// Rounding error of a coordinate relative to the length of an edge.
const ROUNDING: f64 = 1e-6;
/// Maximum eigenvalue of a redrawing: it moves the ends of an edge by at most a hundredth of itself across the edge.
const PARALLEL: f64 = 1e-4;

/// The corners of a model, connected by its edges.
///
/// A *parallel redrawing* moves the vertices so that every edge keeps its direction (Whiteley 1996): a translation, a
/// change of scale, or, of a box, a change of its width, depth or height. Structures of the same kind as the object, as
/// another box with parallel sides, are redrawings of it.
#[derive(Debug, Clone)]
pub(super) struct Wireframe {
    /// The vertices of each edge.
    pub(super) edges: Vec<[usize; 2]>,
    /// The vertex of each model point; `None` for a point on no edge.
    pub(super) points: Vec<Option<usize>>,
    /// The part of each vertex, and its number in the part.
    pub(super) places: Vec<(usize, usize)>,
    /// An orthonormal basis of the parallel redrawings of each connected part: three rows for each vertex.
    pub(super) parts: Vec<DMatrix<f64>>,
    /// The mean length of the edges (m).
    pub(super) length: f64,
}

impl Wireframe {
    pub(super) fn of(points: &[ModelPoint], edges: &[ModelEdge]) -> Self {
        let ends: Vec<[Vector3<f64>; 2]> = edges.iter().map(|edge| edge.places(points).map(|end| end.coords)).collect();
        let length = ends.iter().map(|[a, b]| (b - a).norm()).sum::<f64>() / ends.len().max(1) as f64;
        // A vertex is a place with its standard deviation.
        let mut vertices: Vec<(Vector3<f64>, f64)> = Vec::new();
        let reach = |one: f64, other: f64| TOGETHER * one.hypot(other) + ROUNDING * length;
        let vertex = |at: &Vector3<f64>, sigma: f64, vertices: &mut Vec<(Vector3<f64>, f64)>| {
            let known = vertices.iter().position(|(known, own)| (known - at).norm() <= reach(sigma, *own));
            known.unwrap_or_else(|| {
                vertices.push((*at, sigma));
                vertices.len() - 1
            })
        };
        let of_edge = |(edge, ends): (&ModelEdge, &[Vector3<f64>; 2])| {
            let sigmas = edge.sigmas(points);
            [0, 1].map(|k| vertex(&ends[k], sigmas[k], &mut vertices))
        };
        let edges: Vec<[usize; 2]> = edges.iter().zip(&ends).map(of_edge).collect();
        let corners = vertices.len();
        let mut of_points: Vec<Option<usize>> =
            points.iter().map(|point| Some(vertex(&point.at.coords, point.sigma, &mut vertices))).collect();
        // A vertex that lies on an edge stays on it.
        let on = |v: usize, [a, b]: [usize; 2]| {
            let ((at, sigma), (from, one), (to, other)) = (vertices[v], vertices[a], vertices[b]);
            let along = to - from;
            let t = (at - from).dot(&along) / along.norm_squared();
            let within = v != a && v != b && a != b && t > 0.0 && t < 1.0;
            (within && (at - from - along * t).norm() <= reach(sigma, one.max(other))).then_some(t)
        };
        let mut constraints: Vec<(usize, [usize; 2], f64)> =
            edges.iter().filter(|[a, b]| a != b).map(|&[a, b]| (b, [a, b], 0.0)).collect();
        for v in 0..vertices.len() {
            constraints.extend(edges.iter().filter_map(|&ends| Some((v, ends, on(v, ends)?))));
        }
        for of in &mut of_points {
            let lone = |v: usize| v >= corners && constraints.iter().all(|(on, ..)| *on != v);
            *of = of.filter(|&v| !lone(v));
        }
        let (places, parts) = parts(&vertices, &constraints);
        Self { edges, points: of_points, places, parts, length }
    }
}

/// The parts of vertices connected by constraints (v, [a, b], t): v − (1 − t) a − t b stays parallel to b − a.
fn parts(
    vertices: &[(Vector3<f64>, f64)],
    constraints: &[(usize, [usize; 2], f64)],
) -> (Vec<(usize, usize)>, Vec<DMatrix<f64>>) {
    let mut root: Vec<usize> = (0..vertices.len()).collect();
    for &(v, [a, b], _) in constraints {
        for (one, other) in [(root[v], root[a]), (root[a], root[b]), (root[v], root[b])] {
            let (low, high) = (one.min(other), one.max(other));
            root.iter_mut().filter(|of| **of == high).for_each(|of| *of = low);
        }
    }
    let (mut places, mut parts) = (vec![(0, 0); vertices.len()], Vec::new());
    for first in (0..vertices.len()).filter(|&v| root[v] == v) {
        let members: Vec<usize> = (0..vertices.len()).filter(|&v| root[v] == first).collect();
        members.iter().enumerate().for_each(|(at, &v)| places[v] = (parts.len(), at));
        let mut normal = DMatrix::zeros(3 * members.len(), 3 * members.len());
        for &(v, [a, b], t) in constraints.iter().filter(|(v, ..)| root[*v] == first) {
            let along = (vertices[b].0 - vertices[a].0).normalize();
            for across in seafix_geometry::across(&along) {
                let mut row = DVector::zeros(3 * members.len());
                for (at, weight) in [(v, 1.0), (a, t - 1.0), (b, -t)] {
                    let mut part = row.fixed_rows_mut::<3>(3 * places[at].1);
                    part += across * weight;
                }
                normal.ger(1.0, &row, &row, 1.0);
            }
        }
        let eigen = normal.symmetric_eigen();
        let free: Vec<usize> = (0..eigen.eigenvalues.len()).filter(|&k| eigen.eigenvalues[k] <= PARALLEL).collect();
        parts.push(eigen.eigenvectors.select_columns(&free));
    }
    (places, parts)
}

#[cfg(test)]
mod tests {
    use seafix_geometry::Point;

    use super::*;
    use crate::site::edge::End;

    const SIDES: [[usize; 2]; 12] =
        [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

    fn corner(k: usize) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| if k >> axis & 1 == 1 { 0.3 + 0.1 * axis as f64 } else { 0.0 })
    }

    fn edge([from, to]: [Vector3<f64>; 2]) -> ModelEdge {
        let ends = [from, to].map(|at| End::At(Point::from(at)));
        ModelEdge { id: String::new(), ends, sigma: 1e-4, faces: Vec::new() }
    }

    fn redrawings(edges: &[ModelEdge], points: &[ModelPoint]) -> Vec<usize> {
        Wireframe::of(points, edges).parts.iter().map(DMatrix::ncols).collect()
    }

    /// Whiteley 1996: a simple polyhedron has one redrawing for each face.
    #[test]
    fn a_box_has_six_redrawings() {
        let edges: Vec<ModelEdge> = SIDES.iter().map(|ends| edge(ends.map(corner))).collect();
        assert_eq!(redrawings(&edges, &[]), [6]);
        let apart = Vector3::new(2.0, 0.3, 0.1);
        let two: Vec<ModelEdge> = SIDES.iter().map(|ends| edge(ends.map(|k| corner(k) + apart))).chain(edges).collect();
        assert_eq!(redrawings(&two, &[]), [6, 6]);
        // A U of three sides: every length changes by itself.
        let open: Vec<ModelEdge> = [[2, 0], [0, 1], [1, 3]].iter().map(|ends| edge(ends.map(corner))).collect();
        assert_eq!(redrawings(&open, &[]), [6]);
        // A triangle changes its scale only.
        let triangle: Vec<ModelEdge> = [[1, 2], [2, 4], [4, 1]].iter().map(|ends| edge(ends.map(corner))).collect();
        assert_eq!(redrawings(&triangle, &[]), [4]);
    }

    #[test]
    fn a_point_at_a_corner_is_the_corner_and_a_point_on_an_edge_slides() {
        let edges: Vec<ModelEdge> = SIDES.iter().map(|ends| edge(ends.map(corner))).collect();
        let at = |place: Vector3<f64>| ModelPoint::exact("", Point::from(place));
        let points = [at(corner(5)), at((corner(0) + corner(1)) / 2.0), at(Vector3::new(0.1, 0.1, 0.9))];
        let wireframe = Wireframe::of(&points, &edges);
        assert_eq!(
            wireframe.points[0],
            wireframe.edges.iter().flatten().copied().find(|&v| Some(v) == wireframe.points[0])
        );
        assert!(wireframe.points[1].is_some() && wireframe.points[2].is_none(), "{:?}", wireframe.points);
        assert_eq!(redrawings(&edges, &points)[0], 7);
    }
}
