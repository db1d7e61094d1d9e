//! Harris' corner detector.

use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    corners::Corners,
    detector::Detector,
    select::{Budget, Selection},
    tensor::{Measure, Tensor, Window},
};
use crate::{image::Image, keypoint::Keypoint, workspace::Workspace};

/// Harris' corner detector.
///
/// The gradient g (grey levels/px, Sobel's operator) gives the structure tensor A = w ∗ g gᵀ with a window w. The
/// response R = det A − k (tr A)² (grey levels⁴/px⁴) is positive at corners, negative along edges and zero in flat
/// regions. A corner is a maximum of R, with the subpixel position of the vertex of the quadratic through its nine
/// responses.
///
/// Limits: the position is repeatable, but not the intersection of the edges; the response peaks 1 to 2 px inside a
/// convex corner. Nothing is detected nearer to the border than the operator reaches, 3σ + 2 px for the Gaussian; a
/// smaller image has no corner.
///
/// Source: Harris and Stephens, *A combined corner and edge detector*, Alvey Vision Conference, 1988.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Harris {
    /// Window that integrates the structure tensor.
    pub window: Window,
    /// Standard deviation of the window (px).
    pub sigma: f64,
    /// Harris' constant k, the penalty of straight edges; 0.04 to 0.06 is common.
    pub k: f64,
    /// Minimum response, relative to the strongest of the image.
    ///
    /// The response grows with the fourth power of contrast: 1e-4 admits a tenth of the strongest contrast.
    pub quality: f64,
    /// Radius of non-maximum suppression (px).
    pub radius: usize,
    /// Maximum number of corners.
    pub features: usize,
    /// Selection of corners beyond that number.
    pub selection: Selection,
    /// Number of cells along the longer side of the image, for a balanced selection.
    pub cells: usize,
}

impl Default for Harris {
    fn default() -> Self {
        Self {
            window: Window::Gaussian,
            sigma: 1.8,
            k: 0.04,
            quality: 1e-4,
            radius: 4,
            features: 1000,
            selection: Selection::Balanced,
            cells: 8,
        }
    }
}

impl Component for Harris {
    const NAME: &'static str = "harris";
    const SUMMARY: &'static str = "corners by the structure tensor, to a fraction of a pixel, spread over the image";
    const SOURCE: &'static str =
        "Harris and Stephens, A combined corner and edge detector, Alvey Vision Conference, 1988";

    fn check(&self) -> Result<(), String> {
        // No response is positive from k = 1/4 on.
        in_range((0.0..0.25).contains(&self.k), "k", self.k, "a number from 0 to below 0.25")?;
        self.corners().check()
    }
}

impl Harris {
    fn corners(&self) -> Corners {
        let Self { window, sigma, k, quality, radius, features, selection, cells } = *self;
        let tensor = Tensor { window, sigma, measure: Measure::Harris { k: k as f32 } };
        Corners { tensor, quality, radius, budget: Budget { features, selection, cells } }
    }
}

impl Detector for Harris {
    fn detect_into(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        self.corners().find(image, work, found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::Pixel;

    /// Cells and noise of many frequencies, 8 bits.
    fn texture(width: usize, height: usize) -> Image {
        let value = |x: usize, y: usize| {
            let hash = |x: usize, y: usize| {
                let mut h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
                h ^= h >> 15;
                h = h.wrapping_mul(0x2C1B_3C6D);
                (h ^ (h >> 13)) % 200
            };
            // Cells of 7 px, with corners at the meeting points of four cells.
            hash(x / 7, y / 7) as f32 + (hash(x, y) % 5) as f32
        };
        Image::new(width, height, (0..width * height).map(|i| value(i % width, i / width)).collect()).unwrap()
    }

    /// A bright quarter of the plane, x ≥ `x` and y ≥ `y`, blurred by the area of one pixel.
    fn quadrant(x: f64, y: f64, size: usize) -> Image {
        let cover = |i: usize, edge: f64| (i as f64 + 0.5 - edge).clamp(0.0, 1.0);
        let pixel = |i: usize| 50.0 + 100.0 * cover(i % size, x) * cover(i / size, y);
        Image::new(size, size, (0..size * size).map(|i| pixel(i) as f32).collect()).unwrap()
    }

    /// Two opposite bright quarters: the corner of a chequerboard at (x, y).
    fn crossing(x: f64, y: f64, size: usize) -> Image {
        let cover = |i: usize, edge: f64| (i as f64 + 0.5 - edge).clamp(0.0, 1.0);
        let pixel = |i: usize| {
            let (a, b) = (cover(i % size, x), cover(i / size, y));
            50.0 + 100.0 * (a * b + (1.0 - a) * (1.0 - b))
        };
        Image::new(size, size, (0..size * size).map(|i| pixel(i) as f32).collect()).unwrap()
    }

    #[test]
    fn a_chessboard_corner_is_found_within_a_quarter_of_a_pixel() {
        for (x, y) in [(20.0, 20.0), (20.5, 19.5), (20.25, 20.7), (19.9, 20.3)] {
            let found = Harris::default().detect(&crossing(x, y, 41));
            assert_eq!(found.len(), 1, "{found:?}");
            assert!(found[0].at.distance(&Pixel { u: x, v: y }) < 0.25, "{:?} for {x}, {y}", found[0].at);
        }
    }

    #[test]
    fn the_response_peaks_inside_the_corner_of_a_box() {
        let found = Harris::default().detect(&quadrant(20.0, 20.0, 41));
        assert_eq!(found.len(), 1);
        let at = found[0].at;
        assert!((20.8..22.0).contains(&at.u) && (at.u - at.v).abs() < 1e-4, "{at:?}");
    }

    #[test]
    fn what_is_wider_than_the_image_and_what_is_straight_has_no_corner() {
        let vast = Harris { sigma: 1e300, radius: usize::MAX, cells: usize::MAX, ..Harris::default() };
        assert!(vast.detect(&texture(60, 50)).is_empty());
        let ramp = Image::new(64, 48, (0..64 * 48).map(|i| (i % 64) as f32).collect()).unwrap();
        assert_eq!(Harris::default().detect(&ramp), [], "a straight edge is not a corner");
    }

    #[test]
    fn the_budget_is_kept_and_the_strongest_come_first() {
        let image = texture(200, 150);
        let all = Harris { features: usize::MAX, ..Harris::default() }.detect(&image);
        assert!(all.len() > 100);
        assert!(all.windows(2).all(|w| w[0].response >= w[1].response));
        let some = Harris { features: 30, selection: Selection::Strongest, ..Harris::default() }.detect(&image);
        assert_eq!(some, all[..30]);
        assert!(Harris { features: 0, ..Harris::default() }.detect(&image).is_empty());
    }
}
