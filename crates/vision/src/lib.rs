//! From two images to a cloud of measured points.
//!
//! A [`Detector`] finds corners in each image, a [`Descriptor`] describes their surroundings, a
//! [`Matcher`] pairs left with right, and [`triangulate`] turns the pairs that pass
//! the epipolar test into [`MeasuredPoint`](seafix_geometry::MeasuredPoint)s.
//!
//! The centre of the first pixel is (0, 0); brightness is linear in the stored values, 0 is black
//! and 255 the white of an 8-bit image.

mod cloud;
mod describe;
mod detect;
mod gaussian;
mod image;
mod matching;
mod refine;

pub use cloud::{Triangulator, triangulate};
pub use describe::{DESCRIPTORS, Descriptor, Descriptors, Surf};
pub use detect::{DETECTORS, Detector, Harris, Keypoint};
pub use image::{BadImage, Image};
pub use matching::{MATCHERS, Match, Matcher, MutualRatio, View};
pub use refine::{Refine, stereo_pixels};
