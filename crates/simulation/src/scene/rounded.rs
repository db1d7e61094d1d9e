//! A box with rounded edges and corners, as growth and silt leave it.

use nalgebra::Vector3;

/// Number of steps of a quarter turn.
const STEPS: usize = 4;

/// A triangle: corners, normals, and whether each side is an edge of the body.
pub(super) type Piece = ([Vector3<f64>; 3], [Vector3<f64>; 3], [bool; 3]);

/// The triangles of a box with these half extents about the origin, rounded with `radius`.
///
/// Every point is the nearest point of the inner box, displaced by the radius along the normal. The faces of a cube,
/// bent outwards, give the normals.
pub(super) fn rounded_box(half: Vector3<f64>, radius: f64) -> Vec<Piece> {
    let inner = half - Vector3::repeat(radius);
    // Along an axis: the bend up to 45°, the flat part, the bend again; as (sign, tangent).
    let bend = |k: usize| libm::tan(std::f64::consts::FRAC_PI_4 * k as f64 / (STEPS / 2) as f64);
    let mut stops: Vec<(f64, f64)> = (0..=STEPS / 2).rev().map(|k| (-1.0, -bend(k))).collect();
    stops.extend((0..=STEPS / 2).map(|k| (1.0, bend(k))));
    let mut pieces = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let vertex = |i: usize, j: usize| {
                let (a, b) = (stops[i], stops[j]);
                let (mut core, mut normal) = (Vector3::zeros(), Vector3::zeros());
                let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
                (core[axis], core[u], core[v]) = (side * inner[axis], side * a.0 * inner[u], b.0 * inner[v]);
                (normal[axis], normal[u], normal[v]) = (side, side * a.1, b.1);
                let normal: Vector3<f64> = normal.normalize();
                (core + normal * radius, normal)
            };
            for i in 0..stops.len() - 1 {
                for j in 0..stops.len() - 1 {
                    let [p, q, r, s] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
                    // Any side of a bent surface may be part of its outline.
                    for (t, edges) in [([p, q, r], [true, true, false]), ([p, r, s], [false, true, true])] {
                        if (t[1].0 - t[0].0).cross(&(t[2].0 - t[0].0)).norm() > 1e-14 {
                            pieces.push((t.map(|c| c.0), t.map(|c| c.1), edges));
                        }
                    }
                }
            }
        }
    }
    pieces
}
