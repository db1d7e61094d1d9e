//! Visible flat facets and their depths, exact at pixel centres and supersampled along edges.
//!
//! Every facet is a plane, so 1/Z is linear in the image, and the depth at an image point is exactly that of its ray's
//! intersection with the plane. Pixels that no edge crosses need one sample. The others get [`SAMPLES`], distributed so
//! evenly that a straight edge in any direction is measured to about 1/100 of the pixel's area.

use nalgebra::Vector3;
use seafix_geometry::Pinhole;

use crate::render::changes;

/// Number of samples of a pixel that an edge crosses: a Fibonacci lattice.
pub(crate) const SAMPLES: usize = 34;
/// The generator of the lattice.
const LATTICE: usize = 21;
/// Distance of the near plane (m).
const NEAR: f64 = 0.05;
/// Relative depth by which a facet of a higher layer may be deeper and still win: paint lies *in* its plate.
const LAYER_STEP: f64 = 1e-4;
/// No facet.
pub(crate) const NONE: u32 = u32::MAX;

/// A flat, convex facet in the camera's frame.
#[derive(Debug, Clone)]
pub(crate) struct Facet {
    pub(crate) corners: Vec<Vector3<f64>>,
    /// Id of the surface to which it belongs.
    pub(crate) id: u32,
    /// Layer; a higher layer lies upon a lower one in the same plane.
    pub(crate) layer: u8,
    /// Whether its edges are inner edges of a larger surface with the same `id`.
    pub(crate) seamless: bool,
}

/// A part of a pixel that sees one facet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    /// The facet's `id`, or [`NONE`].
    pub(crate) id: u32,
    /// Fraction of the pixel.
    pub(crate) fraction: f32,
    /// Mean position of the part from the pixel's centre.
    pub(crate) offset: [f64; 2],
    /// 1/Z at that position.
    pub(crate) inverse_depth: f64,
}

/// The visible facets of one camera.
#[derive(Debug)]
pub(crate) struct Visibility {
    width: usize,
    ids: Vec<u32>,
    inverse_depths: Vec<f64>,
    /// Index among the crossed pixels, or [`NONE`].
    slots: Vec<u32>,
    sample_ids: Vec<[u32; SAMPLES]>,
    sample_depths: Vec<[f64; SAMPLES]>,
    /// Positions of the samples from the centre of their pixel: all u, all v.
    places: [[f64; SAMPLES]; 2],
}

/// The pixels that edges cross, row by row.
struct Crossed {
    /// Index of the first column of each row; the last entry is the end.
    starts: Vec<usize>,
    columns: Vec<u32>,
}

/// A facet in the image.
struct Outline {
    id: u32,
    layer: f64,
    seamless: bool,
    /// Lines a·u + b·v + c ≥ 0, (a, b) of unit length, and half the width of a pixel across the line.
    edges: Vec<([f64; 3], f64)>,
    /// 1/Z = p·(u, v, 1).
    plane: [f64; 3],
    rows: [f64; 2],
}

impl Outline {
    fn new(facet: &Facet, camera: &Pinhole) -> Option<Self> {
        let corners = clipped(&facet.corners);
        if corners.len() < 3 {
            return None;
        }
        let ([fx, fy], [cx, cy]) = (camera.focal(), camera.principal());
        let places: Vec<[f64; 2]> = corners.iter().map(|p| [fx * p.x / p.z + cx, fy * p.y / p.z + cy]).collect();
        let [width, height] = camera.size().map(f64::from);
        let range = |k: usize| {
            let low = places.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
            (low, places.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max))
        };
        let ((left, right), (top, bottom)) = (range(0), range(1));
        if right < -1.0 || left > width || bottom < -1.0 || top > height {
            return None;
        }
        let next = |k: usize| (k + 1) % places.len();
        let area: f64 = (0..places.len()).map(|k| cross(&places[k], &places[next(k)])).sum();
        if area.abs() < 1e-9 {
            return None;
        }
        let edges = (0..places.len())
            .filter_map(|k| {
                let (p, q) = (places[k], places[next(k)]);
                let (a, b) = (p[1] - q[1], q[0] - p[0]);
                let length = (a * a + b * b).sqrt() * area.signum();
                let line = [a / length, b / length, cross(&p, &q) / length];
                (length != 0.0).then_some((line, 0.5 * (line[0].abs() + line[1].abs())))
            })
            .collect();
        // The plane n·p = 1 of the facet: 1/Z = n·(x, y, 1) on the ray (x, y, 1).
        let [p, q, r] = [&facet.corners[0], &facet.corners[1], &facet.corners[2]];
        let normal = (q - p).cross(&(r - p));
        let n = normal / normal.dot(p);
        let plane = [n.x / fx, n.y / fy, n.z - n.x * cx / fx - n.y * cy / fy];
        plane.iter().all(|x| x.is_finite()).then_some(Self {
            id: facet.id,
            layer: 1.0 + LAYER_STEP * f64::from(facet.layer),
            seamless: facet.seamless,
            edges,
            plane,
            rows: [top, bottom],
        })
    }

    /// The columns of row `v` at which every line exceeds −`slack` times half a pixel, as a half-open range within
    /// 0..width.
    fn span(&self, v: f64, slack: f64, width: usize) -> (usize, usize) {
        let (mut low, mut high) = (0.0, width as f64 - 1.0);
        for ([a, b, c], half) in &self.edges {
            let rest = b * v + c + slack * half;
            if *a > 1e-12 {
                low = f64::max(low, -rest / a);
            } else if *a < -1e-12 {
                high = f64::min(high, -rest / a);
            } else if rest < 0.0 {
                return (0, 0);
            }
        }
        let (low, high) = (low.ceil(), high.floor());
        if low > high { (0, 0) } else { (low as usize, high as usize + 1) }
    }

    /// The rows of the image that the facet touches; pixels are squares.
    fn touched_rows(&self, height: usize) -> std::ops::Range<usize> {
        let first = (self.rows[0] - 0.5).ceil().max(0.0) as usize;
        let end = ((self.rows[1] + 0.5).floor() + 1.0).clamp(0.0, height as f64) as usize;
        first..end.max(first)
    }
}

fn cross(p: &[f64; 2], q: &[f64; 2]) -> f64 {
    p[0] * q[1] - q[0] * p[1]
}

/// The part of a polygon in front of the near plane (Sutherland and Hodgman, 1974).
fn clipped(corners: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    if corners.iter().all(|p| p.z >= NEAR) {
        return corners.to_vec();
    }
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (k, p) in corners.iter().enumerate() {
        let q = &corners[(k + 1) % corners.len()];
        if p.z >= NEAR {
            kept.push(*p);
        }
        if (p.z >= NEAR) != (q.z >= NEAR) {
            kept.push(p + (q - p) * ((NEAR - p.z) / (q.z - p.z)));
        }
    }
    kept
}

impl Visibility {
    /// Rasterises the facets. The camera has no distortion, so edges stay straight.
    pub(crate) fn new(facets: &[Facet], camera: &Pinhole) -> Self {
        let [width, height] = camera.size().map(|n| n as usize);
        let outlines: Vec<Outline> = facets.iter().filter_map(|facet| Outline::new(facet, camera)).collect();
        let coordinate = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
        let places = [1, LATTICE].map(|step| std::array::from_fn(|k| coordinate(k * step % SAMPLES)));
        let mut seen = Self {
            width,
            ids: vec![NONE; width * height],
            inverse_depths: vec![0.0; width * height],
            slots: vec![NONE; width * height],
            sample_ids: Vec::new(),
            sample_depths: Vec::new(),
            places,
        };
        let mut crossed = vec![false; width * height];
        let mut layered = vec![0.0; width * height];
        for outline in &outlines {
            seen.draw_centres(outline, &mut layered, &mut crossed, height);
        }
        seen.cross_borders(&mut crossed);
        let crossed = seen.number(&crossed);
        seen.sample_ids = vec![[NONE; SAMPLES]; crossed.columns.len()];
        seen.sample_depths = vec![[0.0; SAMPLES]; crossed.columns.len()];
        let mut layered = vec![[0.0; SAMPLES]; crossed.columns.len()];
        for outline in &outlines {
            seen.draw_samples(outline, &mut layered, &crossed, height);
        }
        seen
    }

    /// Draws a facet at the pixel centres and marks the pixels that its edges cross.
    fn draw_centres(&mut self, outline: &Outline, layered: &mut [f64], crossed: &mut [bool], height: usize) {
        for row in outline.touched_rows(height) {
            let (v, start) = (row as f64, row * self.width);
            let (first, end) = outline.span(v, 0.0, self.width);
            if first < end {
                let here = start + first..start + end;
                let (depths, ids) = (&mut self.inverse_depths[here.clone()], &mut self.ids[here.clone()]);
                centres(outline, [first as f64, v], &mut layered[here], depths, ids);
            }
            if !outline.seamless {
                let (outer, outer_end) = outline.span(v, 1.0, self.width);
                let (inner, inner_end) = outline.span(v, -1.0, self.width);
                let crossed = &mut crossed[start..start + self.width];
                if inner >= inner_end {
                    crossed[outer..outer_end].fill(true);
                } else {
                    crossed[outer..inner.clamp(outer, outer_end)].fill(true);
                    crossed[inner_end.clamp(outer, outer_end)..outer_end].fill(true);
                }
            }
        }
    }

    /// Marks the pixels beside a change of surface, because facets that intersect have no edge there.
    fn cross_borders(&self, crossed: &mut [bool]) {
        let rows: Vec<&[u32]> = self.ids.chunks_exact(self.width).collect();
        for (row, ids) in rows.iter().enumerate() {
            let here = row * self.width;
            for column in changes(&ids[..self.width - 1], &ids[1..]) {
                crossed[here + column..here + column + 2].fill(true);
            }
            for column in rows.get(row + 1).into_iter().flat_map(|below| changes(ids, below)) {
                (crossed[here + column], crossed[here + self.width + column]) = (true, true);
            }
        }
    }

    /// Gives every crossed pixel its slot.
    fn number(&mut self, crossed: &[bool]) -> Crossed {
        let (mut starts, mut columns) = (vec![0], Vec::new());
        for (crossed, slots) in crossed.chunks_exact(self.width).zip(self.slots.chunks_exact_mut(self.width)) {
            for (column, _) in crossed.iter().enumerate().filter(|(_, crossed)| **crossed) {
                slots[column] = columns.len() as u32;
                columns.push(column as u32);
            }
            starts.push(columns.len());
        }
        Crossed { starts, columns }
    }

    /// Draws a facet at the samples of the crossed pixels.
    fn draw_samples(&mut self, outline: &Outline, layered: &mut [[f64; SAMPLES]], crossed: &Crossed, height: usize) {
        for row in outline.touched_rows(height) {
            let slots = crossed.starts[row]..crossed.starts[row + 1];
            let columns = &crossed.columns[slots.clone()];
            if columns.is_empty() {
                continue;
            }
            let v = row as f64;
            let (outer, outer_end) = outline.span(v, 1.0, self.width);
            let from = columns.partition_point(|&column| (column as usize) < outer);
            let to = columns.partition_point(|&column| (column as usize) < outer_end);
            if from >= to {
                continue;
            }
            let (inner, inner_end) = outline.span(v, -1.0, self.width);
            for (&column, slot) in columns[from..to].iter().zip(slots.start + from..) {
                let full = (inner..inner_end).contains(&(column as usize));
                let edges = if full { &[][..] } else { &outline.edges };
                let (depths, ids) = (&mut self.sample_depths[slot], &mut self.sample_ids[slot]);
                samples(outline, edges, [f64::from(column), v], &self.places, &mut layered[slot], depths, ids);
            }
        }
    }

    /// The `id` and 1/Z of the facet at a pixel's centre.
    pub(crate) fn centre(&self, column: usize, row: usize) -> (u32, f64) {
        let place = row * self.width + column;
        (self.ids[place], self.inverse_depths[place])
    }

    /// The `id` and 1/Z of a pixel that no edge crosses; `None` for a pixel with parts.
    pub(crate) fn full(&self, column: usize, row: usize) -> Option<(u32, f64)> {
        (self.slots[row * self.width + column] == NONE).then(|| self.centre(column, row))
    }

    /// Calls `visit` with each part of a pixel.
    pub(crate) fn parts(&self, column: usize, row: usize, mut visit: impl FnMut(Part)) {
        let slot = self.slots[row * self.width + column];
        if let Some((id, inverse_depth)) = self.full(column, row) {
            return visit(Part { id, fraction: 1.0, offset: [0.0; 2], inverse_depth });
        }
        let (ids, depths) = (&self.sample_ids[slot as usize], &self.sample_depths[slot as usize]);
        let mut done = [false; SAMPLES];
        for first in 0..SAMPLES {
            if done[first] {
                continue;
            }
            let (mut count, mut offset, mut inverse) = (0.0, [0.0; 2], 0.0);
            for k in (first..SAMPLES).filter(|&k| ids[k] == ids[first]) {
                done[k] = true;
                count += 1.0;
                offset[0] += self.places[0][k];
                offset[1] += self.places[1][k];
                inverse += depths[k];
            }
            visit(Part {
                id: ids[first],
                fraction: (count / SAMPLES as f64) as f32,
                offset: offset.map(|x| x / count),
                inverse_depth: inverse / count,
            });
        }
    }
}

/// Assigns pixels from (u, v) on to an outline where it is nearer (1/Z) than the present facet. `layered` holds the
/// depths that decide.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn centres(outline: &Outline, [u, v]: [f64; 2], layered: &mut [f64], depths: &mut [f64], ids: &mut [u32]) {
    let n = layered.len();
    let (depths, ids) = (&mut depths[..n], &mut ids[..n]);
    let ([a, b, c], layer, id) = (outline.plane, outline.layer, outline.id);
    for k in 0..n {
        let inverse = a * (u + f64::from(k as i32)) + b * v + c;
        let nearer = inverse * layer > layered[k];
        layered[k] = if nearer { inverse * layer } else { layered[k] };
        depths[k] = if nearer { inverse } else { depths[k] };
        ids[k] = if nearer { id } else { ids[k] };
    }
}

/// Assigns the samples of one pixel that lie inside these edges, by the same comparison.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn samples(
    outline: &Outline,
    edges: &[([f64; 3], f64)],
    [u, v]: [f64; 2],
    places: &[[f64; SAMPLES]; 2],
    layered: &mut [f64; SAMPLES],
    depths: &mut [f64; SAMPLES],
    ids: &mut [u32; SAMPLES],
) {
    let mut min = [0.0; SAMPLES];
    for ([a, b, c], _) in edges {
        for k in 0..SAMPLES {
            let inside = a * (u + places[0][k]) + b * (v + places[1][k]) + c;
            min[k] = if inside < min[k] { inside } else { min[k] };
        }
    }
    let ([a, b, c], layer, id) = (outline.plane, outline.layer, outline.id);
    for k in 0..SAMPLES {
        let inverse = a * (u + places[0][k]) + b * (v + places[1][k]) + c;
        let nearer = (inverse * layer > layered[k]) & (min[k] >= 0.0);
        layered[k] = if nearer { inverse * layer } else { layered[k] };
        depths[k] = if nearer { inverse } else { depths[k] };
        ids[k] = if nearer { id } else { ids[k] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Pinhole {
        Pinhole::new([64, 48], [50.0, 50.0], [31.5, 23.5], &[]).unwrap()
    }

    fn facet(corners: &[[f64; 3]], id: u32, layer: u8) -> Facet {
        Facet { corners: corners.iter().map(|c| Vector3::from(*c)).collect(), id, layer, seamless: false }
    }

    /// A rectangle of the image at depth 2.
    fn upright(u: [f64; 2], v: [f64; 2]) -> Facet {
        let x = u.map(|u| (u - 31.5) / 25.0);
        let y = v.map(|v| (v - 23.5) / 25.0);
        facet(&[[x[0], y[0], 2.0], [x[1], y[0], 2.0], [x[1], y[1], 2.0], [x[0], y[1], 2.0]], 3, 0)
    }

    fn fraction(seen: &Visibility, column: usize, row: usize, id: u32) -> f64 {
        let mut sum = 0.0;
        seen.parts(column, row, |part| sum += if part.id == id { f64::from(part.fraction) } else { 0.0 });
        sum
    }

    #[test]
    fn the_centre_of_the_first_pixel_is_zero() {
        // From −0.5 to 0.5 a facet fills the first pixel and no other.
        let seen = Visibility::new(&[upright([-0.5, 0.5], [-0.5, 0.5])], &camera());
        assert_eq!(fraction(&seen, 0, 0, 3), 1.0);
        assert_eq!(fraction(&seen, 1, 0, 3) + fraction(&seen, 0, 1, 3), 0.0);
    }

    #[test]
    fn an_edge_covers_its_fraction_of_a_pixel() {
        for cut in [10.07, 10.25, 10.5, 10.61, 10.93] {
            let seen = Visibility::new(&[upright([2.0, cut - 0.5], [4.0, 20.0])], &camera());
            assert!((fraction(&seen, 10, 9, 3) - (cut - 10.0)).abs() < 0.016, "{cut}");
            assert_eq!(fraction(&seen, 9, 9, 3), 1.0);
        }
    }

    #[test]
    fn an_oblique_edge_has_its_area() {
        let square = upright([20.2, 33.7], [10.4, 30.9]);
        let (sine, cosine) = libm::sincos(0.3);
        let turned: Vec<_> = square
            .corners
            .iter()
            .map(|c| Vector3::new(cosine * c.x - sine * c.y, sine * c.x + cosine * c.y, c.z))
            .collect();
        let seen = Visibility::new(&[Facet { corners: turned, ..square }], &camera());
        let area: f64 = (0..48)
            .flat_map(|row| (0..64).map(move |column| (column, row)))
            .map(|(c, r)| fraction(&seen, c, r, 3))
            .sum();
        assert!((area - 13.5 * 20.5).abs() < 0.05, "{area}");
    }

    #[test]
    fn the_nearer_facet_hides_the_farther_whatever_the_order() {
        let near = facet(&[[-1.0, -1.0, 1.5], [1.0, -1.0, 1.5], [1.0, 1.0, 1.5], [-1.0, 1.0, 1.5]], 1, 0);
        let far = facet(&[[-4.0, -4.0, 4.0], [4.0, -4.0, 4.0], [4.0, 4.0, 4.0], [-4.0, 4.0, 4.0]], 2, 0);
        for facets in [[near.clone(), far.clone()], [far, near]] {
            assert_eq!(Visibility::new(&facets, &camera()).centre(31, 23).0, 1);
        }
    }

    #[test]
    fn paint_lies_upon_its_plate() {
        let plate = facet(&[[-1.0, -1.0, 2.0], [1.0, -1.0, 2.3], [1.0, 1.0, 2.3], [-1.0, 1.0, 2.0]], 1, 0);
        let paint = facet(&[[-0.5, -0.5, 2.075], [0.5, -0.5, 2.225], [0.5, 0.5, 2.225], [-0.5, 0.5, 2.075]], 2, 1);
        for facets in [[plate.clone(), paint.clone()], [paint, plate]] {
            let seen = Visibility::new(&facets, &camera());
            assert_eq!(seen.centre(31, 23).0, 2);
            assert_eq!(seen.centre(12, 23).0, 1);
        }
    }

    #[test]
    fn facets_that_pass_through_each_other_divide_the_pixels() {
        // Two planes that intersect at u = 20.3.
        let x = |u: f64| (u - 31.5) / 50.0;
        let flat = facet(&[[-3.0, -3.0, 2.0], [3.0, -3.0, 2.0], [3.0, 3.0, 2.0], [-3.0, 3.0, 2.0]], 1, 0);
        let at = 2.0 * x(20.3);
        let slope = |step: f64| [at + step, 2.0 + 0.4 * step];
        let [[x0, z0], [x1, z1]] = [slope(-1.0), slope(1.0)];
        let steep = facet(&[[x0, -3.0, z0], [x1, -3.0, z1], [x1, 3.0, z1], [x0, 3.0, z0]], 2, 0);
        let seen = Visibility::new(&[flat, steep], &camera());
        assert!((fraction(&seen, 20, 20, 2) - 0.8).abs() < 0.02);
    }

    #[test]
    fn a_facet_that_reaches_behind_the_camera_is_cut() {
        let floor = facet(&[[-1.0, 0.5, -3.0], [1.0, 0.5, -3.0], [1.0, 0.5, 30.0], [-1.0, 0.5, 30.0]], 4, 0);
        let seen = Visibility::new(&[floor], &camera());
        let (id, inverse) = seen.centre(31, 40);
        assert_eq!(id, 4);
        assert!((1.0 / inverse - 0.5 * 50.0 / 16.5).abs() < 1e-9);
        assert_eq!(seen.centre(31, 10).0, NONE);
    }
}
