//! Which flat facet each pixel sees, and at what depth: exact at the centre of every pixel, and at
//! many places of the pixels that edges cross.
//!
//! Every facet is a plane: 1/Z is linear in the image, and a place of the image sees exactly the
//! depth at which its ray meets the plane. Pixels that no edge crosses need one sample; the others
//! get [`SAMPLES`], spread so evenly over the pixel that a straight edge in any direction is
//! measured to about 1/100 of the pixel's area.

use nalgebra::Vector3;
use seafix_geometry::Pinhole;

/// Samples of a pixel that an edge crosses: a Fibonacci lattice.
pub(crate) const SAMPLES: usize = 34;
/// The generator of the lattice.
const LATTICE: usize = 21;
/// Nothing nearer than this is drawn (m).
const NEAR: f64 = 0.05;
/// A facet of a higher layer wins although it is this much (relative) deeper: paint lies *in* its plate.
const LAYER_STEP: f64 = 1e-4;
/// No facet.
pub(crate) const NONE: u32 = u32::MAX;

/// A flat, convex facet in the camera's frame.
#[derive(Debug, Clone)]
pub(crate) struct Facet {
    pub(crate) corners: Vec<Vector3<f64>>,
    /// What it belongs to.
    pub(crate) id: u32,
    /// Higher layers lie upon lower ones in the same plane.
    pub(crate) layer: u8,
    /// Whether its edges are inner edges of a larger surface with the same `id`.
    pub(crate) seamless: bool,
}

/// What a part of a pixel sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    /// The facet's `id`, [`NONE`] where there is nothing.
    pub(crate) id: u32,
    /// Share of the pixel.
    pub(crate) share: f32,
    /// Mean place of the part, from the pixel's centre.
    pub(crate) offset: [f64; 2],
    /// 1/Z at that place.
    pub(crate) inverse_depth: f64,
}

/// What a camera sees.
#[derive(Debug)]
pub(crate) struct Visibility {
    width: usize,
    ids: Vec<u32>,
    inverse_depths: Vec<f64>,
    /// Place among the crossed pixels, or [`NONE`].
    slots: Vec<u32>,
    sample_ids: Vec<u32>,
    sample_depths: Vec<f64>,
    places: [[f64; 2]; SAMPLES],
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

    /// The columns of row `v` at which every line exceeds −`slack` times half a pixel: as a
    /// half-open range within 0..width.
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

    fn inverse_depth(&self, u: f64, v: f64) -> f64 {
        self.plane[0] * u + self.plane[1] * v + self.plane[2]
    }

    /// The rows of the image that the facet touches, pixels being squares.
    fn touched_rows(&self, height: usize) -> std::ops::Range<usize> {
        let first = (self.rows[0] - 0.5).ceil().max(0.0) as usize;
        let end = ((self.rows[1] + 0.5).floor() + 1.0).clamp(0.0, height as f64) as usize;
        first..end.max(first)
    }
}

fn cross(p: &[f64; 2], q: &[f64; 2]) -> f64 {
    p[0] * q[1] - q[0] * p[1]
}

/// The part of a polygon in front of the near plane. (Sutherland and Hodgman, 1974.)
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
    /// What `camera` sees of the facets. The camera has no distortion: edges stay straight.
    pub(crate) fn new(facets: &[Facet], camera: &Pinhole) -> Self {
        let [width, height] = camera.size().map(|n| n as usize);
        let outlines: Vec<Outline> = facets.iter().filter_map(|facet| Outline::new(facet, camera)).collect();
        let mut places = [[0.0; 2]; SAMPLES];
        for (k, place) in places.iter_mut().enumerate() {
            let coordinate = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
            *place = [coordinate(k), coordinate(k * LATTICE % SAMPLES)];
        }
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
        seen.cross_borders(&mut crossed, height);
        let mut count = 0;
        for (slot, crossed) in seen.slots.iter_mut().zip(&crossed) {
            if *crossed {
                *slot = count;
                count += 1;
            }
        }
        seen.sample_ids = vec![NONE; count as usize * SAMPLES];
        seen.sample_depths = vec![0.0; count as usize * SAMPLES];
        let mut layered = vec![0.0; count as usize * SAMPLES];
        for outline in &outlines {
            seen.draw_samples(outline, &mut layered, height);
        }
        seen
    }

    /// Draws a facet at the centres of the pixels and marks those that its edges cross.
    fn draw_centres(&mut self, outline: &Outline, layered: &mut [f64], crossed: &mut [bool], height: usize) {
        for row in outline.touched_rows(height) {
            let (v, start) = (row as f64, row * self.width);
            let (first, end) = outline.span(v, 0.0, self.width);
            for column in first..end {
                let inverse = outline.inverse_depth(column as f64, v);
                let place = start + column;
                if inverse * outline.layer > layered[place] {
                    layered[place] = inverse * outline.layer;
                    self.inverse_depths[place] = inverse;
                    self.ids[place] = outline.id;
                }
            }
            if !outline.seamless {
                let (outer, outer_end) = outline.span(v, 1.0, self.width);
                let (inner, inner_end) = outline.span(v, -1.0, self.width);
                for column in (outer..outer_end).filter(|c| !(inner..inner_end).contains(c)) {
                    crossed[start + column] = true;
                }
            }
        }
    }

    /// Marks the pixels beside a change of surface: where two facets pass through each other, no
    /// edge says so.
    fn cross_borders(&self, crossed: &mut [bool], height: usize) {
        for row in 0..height {
            for column in 0..self.width {
                let here = row * self.width + column;
                let right = (column + 1 < self.width).then_some(here + 1);
                let below = (row + 1 < height).then_some(here + self.width);
                for there in [right, below].into_iter().flatten() {
                    if self.ids[here] != self.ids[there] {
                        (crossed[here], crossed[there]) = (true, true);
                    }
                }
            }
        }
    }

    /// Draws a facet at the samples of the crossed pixels.
    fn draw_samples(&mut self, outline: &Outline, layered: &mut [f64], height: usize) {
        for row in outline.touched_rows(height) {
            let (v, start) = (row as f64, row * self.width);
            let (outer, outer_end) = outline.span(v, 1.0, self.width);
            let (inner, inner_end) = outline.span(v, -1.0, self.width);
            for column in outer..outer_end {
                let slot = self.slots[start + column];
                if slot == NONE {
                    continue;
                }
                let whole = (inner..inner_end).contains(&column);
                for (k, [du, dv]) in self.places.iter().enumerate() {
                    let (u, v) = (column as f64 + du, v + dv);
                    if !whole && outline.edges.iter().any(|([a, b, c], _)| a * u + b * v + c < 0.0) {
                        continue;
                    }
                    let inverse = outline.inverse_depth(u, v);
                    let place = slot as usize * SAMPLES + k;
                    if inverse * outline.layer > layered[place] {
                        layered[place] = inverse * outline.layer;
                        self.sample_depths[place] = inverse;
                        self.sample_ids[place] = outline.id;
                    }
                }
            }
        }
    }

    /// What is seen at the centre of a pixel: the `id` and 1/Z.
    pub(crate) fn centre(&self, column: usize, row: usize) -> (u32, f64) {
        let place = row * self.width + column;
        (self.ids[place], self.inverse_depths[place])
    }

    /// What a pixel sees that no edge crosses, the `id` and 1/Z; `None` of one that has parts.
    pub(crate) fn whole(&self, column: usize, row: usize) -> Option<(u32, f64)> {
        (self.slots[row * self.width + column] == NONE).then(|| self.centre(column, row))
    }

    /// Calls `visit` with each part of a pixel.
    pub(crate) fn parts(&self, column: usize, row: usize, mut visit: impl FnMut(Part)) {
        let slot = self.slots[row * self.width + column];
        if let Some((id, inverse_depth)) = self.whole(column, row) {
            return visit(Part { id, share: 1.0, offset: [0.0; 2], inverse_depth });
        }
        let samples = slot as usize * SAMPLES..(slot as usize + 1) * SAMPLES;
        let (ids, depths) = (&self.sample_ids[samples.clone()], &self.sample_depths[samples]);
        let mut done = [false; SAMPLES];
        for first in 0..SAMPLES {
            if done[first] {
                continue;
            }
            let (mut count, mut offset, mut inverse) = (0.0, [0.0; 2], 0.0);
            for k in (first..SAMPLES).filter(|&k| ids[k] == ids[first]) {
                done[k] = true;
                count += 1.0;
                offset[0] += self.places[k][0];
                offset[1] += self.places[k][1];
                inverse += depths[k];
            }
            visit(Part {
                id: ids[first],
                share: (count / SAMPLES as f64) as f32,
                offset: offset.map(|x| x / count),
                inverse_depth: inverse / count,
            });
        }
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

    fn share(seen: &Visibility, column: usize, row: usize, id: u32) -> f64 {
        let mut sum = 0.0;
        seen.parts(column, row, |part| sum += if part.id == id { f64::from(part.share) } else { 0.0 });
        sum
    }

    #[test]
    fn the_centre_of_the_first_pixel_is_zero() {
        // From −0.5 to 0.5 a facet fills the first pixel and no other.
        let seen = Visibility::new(&[upright([-0.5, 0.5], [-0.5, 0.5])], &camera());
        assert_eq!(share(&seen, 0, 0, 3), 1.0);
        assert_eq!(share(&seen, 1, 0, 3) + share(&seen, 0, 1, 3), 0.0);
    }

    #[test]
    fn an_edge_covers_its_share_of_a_pixel() {
        for cut in [10.07, 10.25, 10.5, 10.61, 10.93] {
            let seen = Visibility::new(&[upright([2.0, cut - 0.5], [4.0, 20.0])], &camera());
            assert!((share(&seen, 10, 9, 3) - (cut - 10.0)).abs() < 0.016, "{cut}");
            assert_eq!(share(&seen, 9, 9, 3), 1.0);
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
        let area: f64 =
            (0..48).flat_map(|row| (0..64).map(move |column| (column, row))).map(|(c, r)| share(&seen, c, r, 3)).sum();
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
    fn facets_that_pass_through_each_other_share_the_pixels_between() {
        // Two planes that cross at u = 20.3.
        let x = |u: f64| (u - 31.5) / 50.0;
        let flat = facet(&[[-3.0, -3.0, 2.0], [3.0, -3.0, 2.0], [3.0, 3.0, 2.0], [-3.0, 3.0, 2.0]], 1, 0);
        let at = 2.0 * x(20.3);
        let slope = |step: f64| [at + step, 2.0 + 0.4 * step];
        let [[x0, z0], [x1, z1]] = [slope(-1.0), slope(1.0)];
        let steep = facet(&[[x0, -3.0, z0], [x1, -3.0, z1], [x1, 3.0, z1], [x0, 3.0, z0]], 2, 0);
        let seen = Visibility::new(&[flat, steep], &camera());
        assert!((share(&seen, 20, 20, 2) - 0.8).abs() < 0.02);
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
