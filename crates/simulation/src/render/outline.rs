//! A triangle in the image: its sides as lines, and its inverse depth as a plane.

use nalgebra::Vector3;
use seafix_geometry::Pixel;

use super::camera::{RenderCamera, Rolling};

/// Distance of the near plane (m).
const NEAR: f64 = 0.05;
/// Relative depth by which a higher layer may be deeper and still win: paint lies *in* its plate.
const LAYER_STEP: f64 = 2e-4;
/// Maximum length (px) of an edge where lines bend; longer edges are subdivided.
const LONGEST: f64 = 8.0;
/// Maximum depth of the subdivision of a triangle.
const DEEPEST: u32 = 12;

/// One side: a·u + b·v + c ≥ 0 inside, (a, b) of unit length.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Side {
    pub(super) line: [f64; 3],
    /// Half the width of a pixel across the side.
    half: f64,
    /// Slope of the intersection with row v, which lies at column step·v + start; 0 for a side along the rows.
    step: f64,
    start: f64,
    /// Half the width of a pixel along the row.
    reach: f64,
    /// Whether it is an edge of the body; otherwise it is a seam.
    pub(super) edge: bool,
}

impl Side {
    fn new(line: [f64; 3], edge: bool) -> Self {
        let [a, b, c] = line;
        let half = 0.5 * (a.abs() + b.abs());
        // Both triangles of a seam have the same numbers with opposite signs, and so the same intersections.
        let per = if a.abs() > LEVEL { 1.0 / a } else { 0.0 };
        Self { line, half, step: -b * per, start: -c * per, reach: half * per.abs(), edge }
    }
}

/// Minimum slope of a side; sides with less are parallel to the rows.
const LEVEL: f64 = 1e-12;

/// A convex piece of a triangle in the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outline {
    sides: [Side; 4],
    count: u8,
    /// Index of its triangle.
    pub(super) facet: u32,
    /// Body to which the triangle belongs.
    pub(super) body: u32,
    /// 1/Z = p·(u, v, 1).
    plane: [f64; 3],
    /// Factor of 1/Z in comparisons of depth.
    pub(super) layer: f64,
    /// First and last row, fractional.
    pub(super) rows: [f64; 2],
}

/// Corners, and whether the side that follows each is an edge.
type Corner = (Vector3<f64>, bool);

/// The triangle and the body of a piece.
#[derive(Debug, Clone, Copy)]
pub(super) struct Origin {
    pub(super) facet: u32,
    pub(super) body: u32,
    pub(super) layer: u8,
}

/// Appends the visible pieces of a triangle (frame of `camera_model`) to `out`.
pub(super) fn outline(
    corners: [Vector3<f64>; 3],
    edges: [bool; 3],
    origin: Origin,
    camera_model: &RenderCamera,
    rolling: Option<&Rolling>,
    out: &mut Vec<Outline>,
) {
    // Back faces, and triangles entirely behind the camera.
    let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
    if normal.dot(&corners[0]) >= 0.0 && camera_model.lens.is_straight() && rolling.is_none()
        || corners.iter().all(|p| p.z < NEAR)
    {
        return;
    }
    if camera_model.lens.is_straight() && rolling.is_none() {
        straight(corners, normal, edges, origin, camera_model, out);
    } else {
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = corners.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
        let away = centre.xy().norm() - camera_model.reach * centre.z;
        if away > (radius + 0.1) * (1.0 + camera_model.reach * camera_model.reach).sqrt() {
            return;
        }
        let places = corners.map(|p| camera_model.project(&p, rolling));
        curved(corners, places, edges, origin, camera_model, rolling, DEEPEST, out);
    }
}

fn straight(
    corners: [Vector3<f64>; 3],
    normal: Vector3<f64>,
    edges: [bool; 3],
    origin: Origin,
    camera_model: &RenderCamera,
    out: &mut Vec<Outline>,
) {
    let mut kept: [Corner; 4] = [(Vector3::zeros(), false); 4];
    let count = clip(corners, edges, &mut kept);
    let camera = camera_model.lens.camera();
    let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
    let mut places = [[0.0; 2]; 4];
    for (place, (p, _)) in places.iter_mut().zip(&kept[..count]) {
        *place = [fx * p.x / p.z + cx, fy * p.y / p.z + cy];
    }
    // The plane n·p = 1: 1/Z = n·(x, y, 1) on the ray (x, y, 1).
    let n = normal / normal.dot(&corners[0]);
    let plane = [n.x / fx, n.y / fy, n.z - n.x * cx / fx - n.y * cy / fy];
    let flags = kept.map(|(_, edge)| edge);
    polygon(&places[..count], &flags, plane, origin, camera.size(), out);
}

/// The part of a triangle in front of the near plane (Sutherland and Hodgman, 1974).
fn clip(corners: [Vector3<f64>; 3], edges: [bool; 3], kept: &mut [Corner; 4]) -> usize {
    let mut count = 0;
    for k in 0..3 {
        let (p, q) = (corners[k], corners[(k + 1) % 3]);
        let (here, there) = (p.z >= NEAR, q.z >= NEAR);
        if here {
            kept[count] = (p, edges[k]);
            count += 1;
        }
        if here != there {
            // The cut is no edge; the side that re-enters keeps its own flag.
            kept[count] = (p + (q - p) * ((NEAR - p.z) / (q.z - p.z)), there && edges[k]);
            count += 1;
        }
    }
    count
}

/// A triangle whose sides may bend, subdivided until they are straight to 1/50 px. A side is divided by its own length
/// alone, so that the triangles on both of its sides stay joined.
#[expect(clippy::too_many_arguments, reason = "a recursion passes its arguments on")]
fn curved(
    corners: [Vector3<f64>; 3],
    places: [Option<Pixel>; 3],
    edges: [bool; 3],
    origin: Origin,
    camera_model: &RenderCamera,
    rolling: Option<&Rolling>,
    left: u32,
    out: &mut Vec<Outline>,
) {
    let size = camera_model.lens.camera().size();
    if let [Some(p), Some(q), Some(r)] = places {
        let outside = |value: fn(&Pixel) -> f64, n: u32| {
            let (low, high) = (
                [p, q, r].iter().map(value).fold(f64::MAX, f64::min),
                [p, q, r].iter().map(value).fold(f64::MIN, f64::max),
            );
            // A margin for sides that bend inwards.
            let margin = 2.0 + 0.1 * (high - low);
            high < -margin || low > f64::from(n) + margin
        };
        if outside(|p| p.u, size[0]) || outside(|p| p.v, size[1]) {
            return;
        }
    } else if corners.iter().all(|p| p.z < NEAR) {
        return;
    }
    let long = |a: usize, b: usize| match (places[a], places[b]) {
        (Some(p), Some(q)) => p.distance(&q) > LONGEST,
        _ => (corners[a] - corners[b]).norm() > 0.05,
    };
    let cut = [left > 0 && long(0, 1), left > 0 && long(1, 2), left > 0 && long(2, 0)];
    if cut == [false; 3] {
        let [Some(p), Some(q), Some(r)] = places else { return };
        let at = [p, q, r].map(|p| [p.u, p.v]);
        let plane = nalgebra::Matrix3::from_fn(|i, j| if j < 2 { at[i][j] } else { 1.0 })
            .try_inverse()
            .map(|m| m * Vector3::from_fn(|i, _| 1.0 / corners[i].z));
        if let Some(plane) = plane {
            let flags = [edges[0], edges[1], edges[2], false];
            // A back face has the opposite orientation.
            let area = (at[1][0] - at[0][0]) * (at[2][1] - at[0][1]) - (at[1][1] - at[0][1]) * (at[2][0] - at[0][0]);
            if area < 0.0 {
                polygon(&at, &flags, plane.into(), origin, size, out);
            }
        }
        return;
    }
    let middle = |a: usize, b: usize| {
        let p = (corners[a] + corners[b]) * 0.5;
        (p, camera_model.project(&p, rolling))
    };
    let corner = |k: usize| (corners[k], places[k]);
    let mut part = |a: (Vector3<f64>, Option<Pixel>), b: (Vector3<f64>, _), c: (Vector3<f64>, _), e: [bool; 3]| {
        curved([a.0, b.0, c.0], [a.1, b.1, c.1], e, origin, camera_model, rolling, left - 1, out);
    };
    let turned = |k: usize| {
        (corner(k), corner((k + 1) % 3), corner((k + 2) % 3), [edges[k], edges[(k + 1) % 3], edges[(k + 2) % 3]])
    };
    match cut.iter().filter(|c| **c).count() {
        3 => {
            let (ab, bc, ca) = (middle(0, 1), middle(1, 2), middle(2, 0));
            part(corner(0), ab, ca, [edges[0], false, edges[2]]);
            part(corner(1), bc, ab, [edges[1], false, edges[0]]);
            part(corner(2), ca, bc, [edges[2], false, edges[1]]);
            part(ab, bc, ca, [false; 3]);
        }
        2 => {
            // Begins with a side that is not divided.
            let k = cut.iter().position(|c| !c).unwrap_or(0);
            let (a, b, c, e) = turned(k);
            let (bc, ca) = (middle((k + 1) % 3, (k + 2) % 3), middle((k + 2) % 3, k));
            part(a, b, bc, [e[0], e[1], false]);
            part(a, bc, ca, [false, false, e[2]]);
            part(c, ca, bc, [e[2], false, e[1]]);
        }
        _ => {
            let k = cut.iter().position(|c| *c).unwrap_or(0);
            let (a, b, c, e) = turned(k);
            let ab = middle(k, (k + 1) % 3);
            part(a, ab, c, [e[0], false, e[2]]);
            part(ab, b, c, [e[0], e[1], false]);
        }
    }
}

/// Appends a convex polygon of the image.
fn polygon(
    places: &[[f64; 2]],
    edges: &[bool; 4],
    plane: [f64; 3],
    origin: Origin,
    size: [u32; 2],
    out: &mut Vec<Outline>,
) {
    let [width, height] = size.map(f64::from);
    let range = |k: usize| {
        let low = places.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
        (low, places.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max))
    };
    let ((left, right), (top, bottom)) = (range(0), range(1));
    if places.len() < 3 || right < -1.0 || left > width || bottom < -1.0 || top > height {
        return;
    }
    let next = |k: usize| (k + 1) % places.len();
    let area: f64 = (0..places.len()).map(|k| cross(&places[k], &places[next(k)], &places[0])).sum();
    if !(area.abs() > 1e-9) || !plane.iter().all(|x| x.is_finite()) {
        return;
    }
    let mut sides = [Side::default(); 4];
    let mut count = 0;
    for k in 0..places.len() {
        let (p, q) = (places[k], places[next(k)]);
        let (a, b) = (p[1] - q[1], q[0] - p[0]);
        let length = (a * a + b * b).sqrt() * area.signum();
        if length != 0.0 {
            let line = [a / length, b / length, (p[0] * q[1] - q[0] * p[1]) / length];
            sides[count] = Side::new(line, edges[k]);
            count += 1;
        }
    }
    let Origin { facet, body, layer } = origin;
    let layer = 1.0 + LAYER_STEP * f64::from(layer);
    out.push(Outline { sides, count: count as u8, facet, body, plane, layer, rows: [top, bottom] });
}

fn cross(p: &[f64; 2], q: &[f64; 2], from: &[f64; 2]) -> f64 {
    (p[0] - from[0]) * (q[1] - from[1]) - (q[0] - from[0]) * (p[1] - from[1])
}

impl Outline {
    pub(super) fn sides(&self) -> &[Side] {
        &self.sides[..usize::from(self.count)]
    }

    /// 1/Z at an image point.
    #[inline]
    pub(super) fn inverse_depth(&self, u: f64, v: f64) -> f64 {
        self.plane[0] * u + self.plane[1] * v + self.plane[2]
    }

    /// The step of 1/Z from one column to the next, and from one row to the next.
    #[inline]
    pub(super) fn slope(&self) -> [f64; 2] {
        [self.plane[0], self.plane[1]]
    }

    /// The columns of row `v` at which every side exceeds −`slack` half pixels, as a half-open range. With `edges_only`
    /// seams are ignored.
    pub(super) fn span(&self, v: f64, slack: f64, width: usize, edges_only: bool) -> (usize, usize) {
        let (mut low, mut high) = (0.0, width as f64 - 1.0);
        for side in self.sides().iter().filter(|side| side.edge || !edges_only) {
            let [a, b, c] = side.line;
            if a > LEVEL {
                low = f64::max(low, side.step * v + side.start - slack * side.reach);
            } else if a < -LEVEL {
                high = f64::min(high, side.step * v + side.start + slack * side.reach);
            } else if b * v + c + slack * side.half < 0.0 {
                return (0, 0);
            }
        }
        // Casts beyond the image saturate.
        let first = low.max(0.0);
        let first = first as usize + usize::from(first > (first as usize) as f64);
        if low > high || high < 0.0 { (0, 0) } else { (first, (high as usize + 1).max(first)) }
    }

    /// Whether any side is an edge of the body.
    pub(super) fn has_edges(&self) -> bool {
        self.sides().iter().any(|side| side.edge)
    }

    /// The rows of the image that it touches; pixels are squares.
    pub(super) fn touched(&self, height: usize) -> std::ops::Range<usize> {
        let first = (self.rows[0] - 0.5).ceil().max(0.0) as usize;
        let end = ((self.rows[1] + 0.5).floor() + 1.0).clamp(0.0, height as f64) as usize;
        first..end.max(first)
    }
}
