//! Fast signs of tetrahedron volumes.

use nalgebra::Vector3;

use super::orientation::Sense;
use crate::problem::{Correspondence, Problem};

/// Coordinates of each vertex in model and cloud, with the exact test of orientation.
///
/// Three vertices span a plane in the model and one in the cloud. If a fourth does not lie on the same side of both,
/// the exact test decides.
#[derive(Debug)]
pub(super) struct Volumes<'a> {
    problem: &'a Problem<'a>,
    vertices: &'a [Correspondence],
    /// Coordinates in model and cloud, relative to the first vertex.
    at: Vec<[Vector3<f64>; 2]>,
    /// Product of two volumes (m⁶) below which its sign is not trusted.
    doubt: f64,
}

/// Normals of the planes of three vertices in model and cloud, and the vertices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    three: [usize; 3],
    normals: [Vector3<f64>; 2],
}

impl<'a> Volumes<'a> {
    pub(super) fn of(problem: &'a Problem<'a>, vertices: &'a [Correspondence]) -> Self {
        let place =
            |pair: &Correspondence| [problem.model[pair.model].at.coords, problem.cloud[pair.cloud].position.at.coords];
        let origin = vertices.first().map_or([Vector3::zeros(); 2], place);
        let at: Vec<_> = vertices.iter().map(place).map(|[m, c]| [m - origin[0], c - origin[1]]).collect();
        let extent = |side: usize| at.iter().map(|place: &[Vector3<f64>; 2]| place[side].amax()).fold(0.0, f64::max);
        // A volume is at most 42 extents cubed, with a rounding error of 10⁻¹³ of one.
        let doubt = 4e-12 * (extent(0) * extent(1)).powi(3);
        Self { problem, vertices, at, doubt }
    }

    pub(super) fn plane(&self, three: [usize; 3]) -> Plane {
        let [a, b, c] = three.map(|v| &self.at[v]);
        Plane { three, normals: [0, 1].map(|side| (b[side] - a[side]).cross(&(c[side] - a[side]))) }
    }

    /// Whether the plane's three vertices and `fourth` contradict the sense.
    pub(super) fn rejects(&self, sense: Sense, plane: &Plane, fourth: usize) -> bool {
        let Some(sign) = sense.sign() else { return false };
        let (a, d) = (&self.at[plane.three[0]], &self.at[fourth]);
        let product = plane.normals[0].dot(&(d[0] - a[0])) * plane.normals[1].dot(&(d[1] - a[1]));
        let [a, b, c] = plane.three;
        !(sign * product > self.doubt) && self.contradict(sense, [a, b, c, fourth])
    }

    /// Whether four vertices contradict the sense, by the exact test.
    pub(super) fn contradict(&self, sense: Sense, four: [usize; 4]) -> bool {
        sense.rejects(self.problem, four.map(|v| self.vertices[v]))
    }

    /// Product of two volumes (m⁶) below which its sign is not trusted.
    pub(super) fn doubt(&self) -> f64 {
        self.doubt
    }

    /// Coordinates of a vertex in the model, then in the cloud.
    pub(super) fn place(&self, vertex: usize) -> [f64; 6] {
        let [model, cloud] = self.at[vertex];
        [model.x, model.y, model.z, cloud.x, cloud.y, cloud.z]
    }

    /// Whether two vertices are coherent.
    pub(super) fn coherent(&self, a: usize, b: usize) -> bool {
        self.problem.coherent(self.vertices[a], self.vertices[b])
    }
}
