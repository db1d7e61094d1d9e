//! Signs of many tetrahedra quickly.

use nalgebra::Vector3;

use super::orientation::Sense;
use crate::{Correspondence, Problem};

/// Where each vertex is in model and cloud, side by side, and the exact test behind it.
///
/// Three vertices span a plane in the model and one in the cloud; a fourth lies on the same side of both, or is
/// looked at closely.
#[derive(Debug)]
pub(super) struct Volumes<'a> {
    problem: &'a Problem<'a>,
    vertices: &'a [Correspondence],
    /// Places in model and cloud, from those of the first vertex.
    at: Vec<[Vector3<f64>; 2]>,
    /// A product of two volumes nearer to zero than this (m⁶) is not trusted to have the right sign.
    doubt: f64,
}

/// Normals of the planes of three vertices in model and cloud, and the vertex they start from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    three: [usize; 3],
    normals: [Vector3<f64>; 2],
}

/// Places of some vertices in model and cloud, axis by axis.
#[derive(Debug)]
pub(super) struct Columns([Vec<f64>; 6]);

impl<'a> Volumes<'a> {
    pub(super) fn of(problem: &'a Problem<'a>, vertices: &'a [Correspondence]) -> Self {
        let place =
            |pair: &Correspondence| [problem.model[pair.model].at.coords, problem.cloud[pair.cloud].position.at.coords];
        let origin = vertices.first().map_or([Vector3::zeros(); 2], place);
        let at: Vec<_> = vertices.iter().map(place).map(|[m, c]| [m - origin[0], c - origin[1]]).collect();
        let extent = |side: usize| at.iter().map(|place: &[Vector3<f64>; 2]| place[side].amax()).fold(0.0, f64::max);
        // A volume is no greater than 42 extents cubed and rounded by 10⁻¹³ of one.
        let doubt = 4e-12 * (extent(0) * extent(1)).powi(3);
        Self { problem, vertices, at, doubt }
    }

    pub(super) fn plane(&self, three: [usize; 3]) -> Plane {
        let [a, b, c] = three.map(|v| &self.at[v]);
        Plane { three, normals: [0, 1].map(|side| (b[side] - a[side]).cross(&(c[side] - a[side]))) }
    }

    pub(super) fn columns(&self, of: &[usize]) -> Columns {
        Columns(std::array::from_fn(|axis| of.iter().map(|&v| self.at[v][axis / 3][axis % 3]).collect()))
    }

    /// Whether the plane's three and one of `others` contradict the sense; `columns` begin with the others.
    pub(super) fn refuses_one(&self, sense: Sense, plane: &Plane, others: &[usize], columns: &Columns) -> bool {
        if sense == Sense::Any {
            return false;
        }
        let sign = if sense == Sense::Proper { 1.0 } else { -1.0 };
        let columns = columns.0.each_ref().map(|column| &column[..others.len()]);
        // Nearly always all are clear.
        !all_clear(&columns, &self.at[plane.three[0]], &plane.normals, sign, self.doubt)
            && others.iter().any(|&d| self.refuses(sense, plane, d))
    }

    /// Whether the plane's three and `fourth` contradict the sense.
    pub(super) fn refuses(&self, sense: Sense, plane: &Plane, fourth: usize) -> bool {
        let (a, d) = (&self.at[plane.three[0]], &self.at[fourth]);
        let product = plane.normals[0].dot(&(d[0] - a[0])) * plane.normals[1].dot(&(d[1] - a[1]));
        let clear = match sense {
            Sense::Any => true,
            Sense::Proper => product > self.doubt,
            Sense::Mirrored => product < -self.doubt,
        };
        let [a, b, c] = plane.three;
        !clear && sense.refuses(self.problem, [a, b, c, fourth].map(|v| self.vertices[v]))
    }
}

/// Whether all points lie on the same side (`sign` 1) or on the other (-1) of both planes, beyond doubt; the planes have these
/// normals and a point each.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn all_clear(
    columns: &[&[f64]; 6],
    from: &[Vector3<f64>; 2],
    normals: &[Vector3<f64>; 2],
    sign: f64,
    doubt: f64,
) -> bool {
    let [mx, my, mz, cx, cy, cz] = *columns;
    let ([m, c], [u, v]) = (from, normals);
    let places = mx.iter().zip(my).zip(mz).zip(cx).zip(cy).zip(cz);
    // Nothing is decided before the last was looked at, so that several are at a time.
    let unclear = places.fold(0u64, |unclear, (((((mx, my), mz), cx), cy), cz)| {
        let known = u.x * (mx - m.x) + u.y * (my - m.y) + u.z * (mz - m.z);
        let measured = v.x * (cx - c.x) + v.y * (cy - c.y) + v.z * (cz - c.z);
        unclear | u64::from(!(sign * (known * measured) > doubt))
    });
    unclear == 0
}
