//! Shi and Tomasi's corner detector.

use seafix_component::{Component, Settings};
use serde::{Deserialize, Serialize};

use super::{
    corners::Corners,
    detector::Detector,
    select::{Budget, Selection},
    tensor::{Measure, Tensor, Window},
};
use crate::{image::Image, keypoint::Keypoint, workspace::Workspace};

/// Shi and Tomasi's detector of good features to track.
///
/// The response is the smaller eigenvalue of the structure tensor A = w ∗ g gᵀ of [`Harris`](super::Harris) (grey
/// levels²/px²): the information of the window about the displacement in the worse direction. It has no free constant.
///
/// Limits: nothing is detected nearer to the border than the operator reaches, 3σ + 2 px for the Gaussian; a smaller
/// image has no corner.
///
/// Source: Shi and Tomasi, *Good features to track*, CVPR 1994.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ShiTomasi {
    /// Window that integrates the structure tensor.
    pub window: Window,
    /// Standard deviation of the window (px).
    pub sigma: f64,
    /// Minimum response, relative to the strongest of the image.
    ///
    /// The response grows with the square of contrast: 0.01 admits a tenth of the strongest contrast.
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

impl Default for ShiTomasi {
    fn default() -> Self {
        Self {
            window: Window::Gaussian,
            sigma: 2.0,
            quality: 0.01,
            radius: 4,
            features: 1000,
            selection: Selection::Balanced,
            cells: 8,
        }
    }
}

impl Component for ShiTomasi {
    const NAME: &'static str = "shi-tomasi";
    const SUMMARY: &'static str = "corners by the smaller eigenvalue of the structure tensor, spread over the image";
    const SOURCE: &'static str = "Shi and Tomasi, Good features to track, CVPR 1994";

    fn check(&self) -> Result<(), String> {
        self.corners().check()
    }
}

impl ShiTomasi {
    fn corners(&self) -> Corners {
        let Self { window, sigma, quality, radius, features, selection, cells } = *self;
        let tensor = Tensor { window, sigma, measure: Measure::SmallestEigenvalue };
        Corners { tensor, quality, radius, budget: Budget { features, selection, cells } }
    }
}

impl Detector for ShiTomasi {
    fn detect_into(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        self.corners().find(image, work, found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chequerboard crossing at (20, 20) with `contrast` grey levels between its quarters.
    fn crossing(contrast: f32) -> Image {
        let side = |i: usize| (i as f32 - 20.0).clamp(-0.5, 0.5);
        let pixel = |i: usize| 128.0 + 2.0 * contrast * side(i % 41) * side(i / 41);
        Image::new(41, 41, (0..41 * 41).map(pixel).collect()).unwrap()
    }

    #[test]
    fn the_response_goes_with_the_square_of_contrast() {
        let of = |contrast| ShiTomasi::default().detect(&crossing(contrast));
        let (one, two) = (of(32.0), of(64.0));
        assert_eq!((one.len(), two.len()), (1, 1));
        assert_eq!(two[0].response, 4.0 * one[0].response);
        assert!((one[0].at.u - 20.0).abs() < 1e-6 && (one[0].at.v - 20.0).abs() < 1e-6, "{one:?}");
    }

    #[test]
    fn an_edge_is_no_corner() {
        let edge = Image::new(40, 40, (0..1600).map(|i| if i % 40 < 20 { 20.0 } else { 220.0 }).collect()).unwrap();
        assert_eq!(ShiTomasi::default().detect(&edge), []);
    }
}
