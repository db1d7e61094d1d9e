//! Detectors of key points.

use crate::{image::Image, keypoint::Keypoint, regions::Regions, workspace::Workspace};

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

    /// Replaces `found` by the image's key points, strongest first, given where an object is expected.
    fn detect_guided_into(&self, image: &Image, _regions: &Regions, work: &mut Workspace, found: &mut Vec<Keypoint>) {
        self.detect_into(image, work, found);
    }

    /// Whether the key points depend on where an object is expected.
    fn is_guided(&self) -> bool {
        false
    }

    /// The key points of one image, strongest first.
    fn detect(&self, image: &Image) -> Vec<Keypoint> {
        let mut found = Vec::new();
        self.detect_into(image, &mut Workspace::default(), &mut found);
        found
    }
}
