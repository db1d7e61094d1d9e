//! The straight coordinates of an image's places.

use nalgebra::Vector2;
use seafix_geometry::{Pinhole, Pixel};

/// The map from the places of a gradient field to undistorted pixels, in which straight edges are straight.
///
/// Undistorted pixels are directions times the focal lengths. The map is exact without lens distortion and bilinear
/// between nodes otherwise, which suffices for detection.
#[derive(Debug, Default)]
pub(super) struct Straight {
    of: Option<(Pinhole, usize)>,
    columns: usize,
    /// The undistorted pixel of the first place and the step from place to place, without lens distortion.
    even: Option<([f32; 2], f32)>,
    nodes: Vec<Option<[f32; 2]>>,
}

/// The distance between nodes (places). The curvature of a distortion k₁ = −0.3 then displaces by 0.02 px at most.
const STEP: usize = 8;

impl Straight {
    /// Prepares the map for a field of `width` × `height` places.
    pub(super) fn fill(&mut self, camera: &Pinhole, binning: usize, width: usize, height: usize) {
        if self.of == Some((*camera, binning)) {
            return;
        }
        self.of = Some((*camera, binning));
        self.columns = width / STEP + 2;
        let rows = height / STEP + 2;
        let [fx, fy] = camera.focal();
        let coordinate = |node: usize| super::gradients::Gradients::image_coordinate((node * STEP) as f32, binning);
        self.nodes.clear();
        self.even = None;
        if camera.distortion().shortest().is_empty() {
            let [cx, cy] = camera.principal();
            let first = coordinate(0);
            self.even = Some(([(first - cx) as f32, (first - cy) as f32], binning as f32));
            return;
        }
        self.nodes.extend((0..rows * self.columns).map(|i| {
            let at = Pixel { u: coordinate(i % self.columns), v: coordinate(i / self.columns) };
            camera.normalize(&at).map(|n| [(n.x * fx) as f32, (n.y * fy) as f32])
        }));
    }

    /// The undistorted pixel of place (x, y); `None` outside the range of the lens model.
    pub(super) fn at(&self, x: f32, y: f32) -> Option<[f32; 2]> {
        if let Some((first, step)) = self.even {
            return Some([first[0] + step * x, first[1] + step * y]);
        }
        let step = STEP as f32;
        let (column, row) = ((x.max(0.0) / step) as usize, (y.max(0.0) / step) as usize);
        let (s, t) = (x / step - column as f32, y / step - row as f32);
        let node = row * self.columns + column;
        let [a, b] = [self.nodes[node]?, self.nodes[node + 1]?];
        let [c, d] = [self.nodes[node + self.columns]?, self.nodes[node + self.columns + 1]?];
        let mix = |i: usize| (1.0 - t) * ((1.0 - s) * a[i] + s * b[i]) + t * ((1.0 - s) * c[i] + s * d[i]);
        Some([mix(0), mix(1)])
    }

    /// The unit gradient `g` of place (x, y) in undistorted pixels.
    pub(super) fn turned(&self, x: f32, y: f32, g: [f32; 2]) -> Option<[f32; 2]> {
        if self.even.is_some() {
            return Some(g);
        }
        // The edge, across the gradient, maps as a vector by differences of the map; the gradient is across its image.
        let (back, to) = (self.at(x + 0.5 * g[1], y - 0.5 * g[0])?, self.at(x - 0.5 * g[1], y + 0.5 * g[0])?);
        let d = [to[0] - back[0], to[1] - back[1]];
        let length = (d[0] * d[0] + d[1] * d[1]).sqrt();
        (length > 0.0).then(|| [d[1] / length, -d[0] / length])
    }

    /// The direction (X/Z, Y/Z) of an undistorted pixel.
    pub(super) fn direction(&self, at: [f64; 2]) -> Vector2<f64> {
        let (camera, _) = self.of.as_ref().expect("filled before");
        let [fx, fy] = camera.focal();
        Vector2::new(at[0] / fx, at[1] / fy)
    }
}
