//! Locators: where exactly a corner is.
//!
//! A detector's response peaks near a corner, not at it: 1 to 2 px inside the corner of a box. A locator
//! fits a model of the corner to the pixels around. Both images' key points are located before they are
//! described: a response may have two maxima beside one corner, and those of one image would match the
//! others of the other. What is no corner stays; the alignment between the views then replaces the right
//! place, which it finds more exactly than a second fit.

mod corner;
mod fit;
mod junction;
mod model;
mod peak;
mod start;

pub use corner::{Corner, LCorner, XCorner};
pub(crate) use corner::{SOURCE as FITTED, fit_into};
pub use fit::CornerFit;
pub use junction::Junction;
pub(crate) use model::Shape;
use nalgebra::Matrix2;
pub use peak::Peak;
use seafix_component::{Registry, entry};
use seafix_geometry::Pixel;

use crate::{Image, Keypoint, Workspace};

/// A place in an image and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainPixel {
    /// Where.
    pub at: Pixel,
    /// The covariance of (u, v) (px²).
    pub covariance: Matrix2<f64>,
}

impl UncertainPixel {
    /// A place whose two coordinates err independently by `sigma` (px).
    pub fn independent(at: Pixel, sigma: f64) -> Self {
        Self { at, covariance: Matrix2::identity() * (sigma * sigma) }
    }
}

/// A matched point: where the left image shows it, and where about the right one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// In the left image.
    pub left: UncertainPixel,
    /// In the right image.
    pub right: UncertainPixel,
}

/// Finds the exact place of corners that a detector found roughly.
pub trait Locator: Send + Sync + std::fmt::Debug {
    /// Replaces `places` by the corner at each key point, in their order; `None` where the image shows no
    /// corner of the kind that this locator knows, or not well enough to say better where it is.
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

/// All locators.
pub static LOCATORS: Registry<dyn Locator> =
    Registry::new("locator", &[entry!(Corner), entry!(Junction), entry!(LCorner), entry!(Peak), entry!(XCorner)]);
