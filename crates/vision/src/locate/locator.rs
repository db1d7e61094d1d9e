//! Locators of key points.

use nalgebra::Matrix2;
use seafix_geometry::Pixel;

use crate::{image::Image, keypoint::Keypoint, workspace::Workspace};

/// A pixel position with its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainPixel {
    /// The position (px).
    pub at: Pixel,
    /// The covariance of (u, v) (px²).
    pub covariance: Matrix2<f64>,
}

impl UncertainPixel {
    /// A position with independent errors of standard deviation `sigma` (px) in both coordinates.
    pub fn independent(at: Pixel, sigma: f64) -> Self {
        Self { at, covariance: Matrix2::identity() * (sigma * sigma) }
    }
}

/// A matched pair of uncertain pixels; the right one is approximate until it is refined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// The pixel in the left image.
    pub left: UncertainPixel,
    /// The pixel in the right image.
    pub right: UncertainPixel,
}

/// A locator: moves key points to exact corners.
///
/// ```
/// use seafix_geometry::Pixel;
/// use seafix_vision::{Image, Keypoint, Locator, UncertainPixel, Workspace};
///
/// /// The nearest pixel centre, with the standard deviation of rounding, 1/√12 px.
/// #[derive(Debug)]
/// struct Rounded;
///
/// impl Locator for Rounded {
///     fn locate_into(
///         &self,
///         _: &Image,
///         keypoints: &[Keypoint],
///         _: &mut Workspace,
///         places: &mut Vec<Option<UncertainPixel>>,
///     ) {
///         places.clear();
///         places.extend(keypoints.iter().map(|keypoint| {
///             let at = Pixel { u: keypoint.at.u.round(), v: keypoint.at.v.round() };
///             Some(UncertainPixel::independent(at, 1.0 / 12f64.sqrt()))
///         }));
///     }
/// }
///
/// let image = Image::new(16, 16, vec![0.0; 256]).unwrap();
/// let keypoint = Keypoint { at: Pixel { u: 10.3, v: 6.8 }, response: 1.0, scale: 1.0 };
/// let places = Rounded.locate(&image, &[keypoint]);
/// assert_eq!(places[0].unwrap().at, Pixel { u: 10.0, v: 7.0 });
/// ```
pub trait Locator: Send + Sync + std::fmt::Debug {
    /// Replaces `places` by the corner at each key point, in their order.
    ///
    /// `None` marks a key point without a corner of this locator's kind, or with a corner whose place the fit
    /// determines no better than the detector did.
    fn locate_into(
        &self,
        image: &Image,
        keypoints: &[Keypoint],
        work: &mut Workspace,
        places: &mut Vec<Option<UncertainPixel>>,
    );

    /// The corner at each key point.
    fn locate(&self, image: &Image, keypoints: &[Keypoint]) -> Vec<Option<UncertainPixel>> {
        let mut places = Vec::new();
        self.locate_into(image, keypoints, &mut Workspace::default(), &mut places);
        places
    }
}
