//! Locators: where exactly a corner is.
//!
//! A detector's response peaks near a corner, not at it: 1 to 2 px inside the corner of a box. A locator
//! fits a model of the corner to the pixels around. Only the left places of matched key points are
//! located; the alignment between the views then finds the same place in the right image, more exactly
//! than a second fit would.

mod corner;
mod fit;
mod junction;
mod model;
mod peak;
mod start;

pub use corner::{Corner, LCorner, XCorner};
pub use fit::CornerFit;
pub use junction::Junction;
use nalgebra::Matrix2;
pub use peak::Peak;
use seafix_component::{Registry, entry};
use seafix_geometry::Pixel;

use crate::{Image, Keypoint, Match, Workspace};

/// A place in an image and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Where.
    pub at: Pixel,
    /// The covariance of (u, v) (px²).
    pub covariance: Matrix2<f64>,
}

impl Place {
    /// A place whose two coordinates err independently by `sigma` (px).
    pub fn independent(at: Pixel, sigma: f64) -> Self {
        Self { at, covariance: Matrix2::identity() * (sigma * sigma) }
    }
}

/// A matched point: where exactly the left image shows it, and where about the right one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// In the left image.
    pub left: Place,
    /// In the right image, as far from the matcher's place as the left is from the detector's.
    pub right: Place,
}

impl Pair {
    /// The pair of a match of `keypoint`; both places err by `sigma` (px, each coordinate) but for the left
    /// if it is `located`.
    pub fn new(keypoint: &Keypoint, found: &Match, located: Option<Place>, sigma: f64) -> Self {
        let left = located.unwrap_or(Place::independent(keypoint.at, sigma));
        let (u, v) = (left.at.u - keypoint.at.u, left.at.v - keypoint.at.v);
        let right = Pixel { u: found.right.u + u, v: found.right.v + v };
        Self { left, right: Place::independent(right, sigma) }
    }
}

/// Finds the exact place of corners that a detector found roughly.
pub trait Locator: Send + Sync + std::fmt::Debug {
    /// Replaces `places` by the corner at each key point, in their order; `None` where the image shows no
    /// corner of the kind that this locator knows, or not well enough to say better where it is.
    fn locate_into(&self, image: &Image, keypoints: &[Keypoint], work: &mut Workspace, places: &mut Vec<Option<Place>>);

    /// The corner at each key point.
    fn locate(&self, image: &Image, keypoints: &[Keypoint]) -> Vec<Option<Place>> {
        let mut places = Vec::new();
        self.locate_into(image, keypoints, &mut Workspace::default(), &mut places);
        places
    }
}

/// All locators.
pub static LOCATORS: Registry<dyn Locator> =
    Registry::new("locator", &[entry!(Corner), entry!(Junction), entry!(LCorner), entry!(Peak), entry!(XCorner)]);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_right_place_moves_with_the_left() {
        let keypoint = Keypoint { at: Pixel { u: 10.0, v: 20.0 }, response: 1.0, scale: 2.0 };
        let found = Match { left: 0, right: Pixel { u: 4.5, v: 20.5 }, distance: 0.0 };
        let left = Place::independent(Pixel { u: 9.0, v: 18.5 }, 0.01);
        let pair = Pair::new(&keypoint, &found, Some(left), 0.5);
        assert_eq!(pair, Pair { left, right: Place::independent(Pixel { u: 3.5, v: 19.0 }, 0.5) });
        let stays = Pair::new(&keypoint, &found, None, 0.5);
        assert_eq!((stays.left.at, stays.right.at), (keypoint.at, found.right));
        assert_eq!(stays.left.covariance, Matrix2::identity() * 0.25);
    }
}
