//! Detectors of key points.

mod corners;
mod dog;
mod extrema;
mod fast;
mod fitted;
mod harris;
mod hessian;
mod integral;
mod peaks;
mod select;
mod shi_tomasi;
mod strip;
mod surf;
mod tensor;

pub use dog::Dog;
pub use fast::Fast;
pub use fitted::{FittedCorners, LCorners, XCorners};
pub use harris::Harris;
pub(crate) use peaks::vertex;
use seafix_component::{Registry, entry};
use seafix_geometry::Pixel;
pub use select::Selection;
pub use shi_tomasi::ShiTomasi;
pub use surf::FastHessian;
pub use tensor::Window;

use crate::{Image, Workspace};

/// A key point: a pixel that can be detected again in another image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keypoint {
    /// The position (px), with subpixel resolution.
    pub at: Pixel,
    /// The strength in the detector's own measure; larger is stronger.
    pub response: f32,
    /// The size of the structure (px): the standard deviation of the Gaussian of its detection.
    pub scale: f32,
}

/// A detector of key points.
///
/// ```
/// use seafix_geometry::Pixel;
/// use seafix_vision::{Detector, Image, Keypoint, Workspace};
///
/// /// The brightest pixel as the only key point.
/// #[derive(Debug)]
/// struct Brightest;
///
/// impl Detector for Brightest {
///     fn detect_into(&self, image: &Image, _: &mut Workspace, found: &mut Vec<Keypoint>) {
///         found.clear();
///         let brightest = image.pixels().iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
///         found.extend(brightest.map(|(i, &response)| {
///             let at = Pixel { u: (i % image.width()) as f64, v: (i / image.width()) as f64 };
///             Keypoint { at, response, scale: 1.0 }
///         }));
///     }
/// }
///
/// let image = Image::new(3, 2, vec![0.0, 0.0, 0.0, 0.0, 0.0, 200.0]).unwrap();
/// assert_eq!(Brightest.detect(&image)[0].at, Pixel { u: 2.0, v: 1.0 });
/// ```
pub trait Detector: Send + Sync + std::fmt::Debug {
    /// Replaces `found` by the image's key points, strongest first.
    fn detect_into(&self, image: &Image, work: &mut Workspace, found: &mut Vec<Keypoint>);

    /// The key points of one image, strongest first.
    fn detect(&self, image: &Image) -> Vec<Keypoint> {
        let mut found = Vec::new();
        self.detect_into(image, &mut Workspace::default(), &mut found);
        found
    }
}

/// The registry of detectors.
pub static DETECTORS: Registry<dyn Detector> = Registry::new(
    "detector",
    &[
        entry!(Dog),
        entry!(Fast),
        entry!(Harris),
        entry!(LCorners),
        entry!(ShiTomasi),
        entry!(FastHessian),
        entry!(XCorners),
    ],
);
