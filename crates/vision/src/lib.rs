//! The stereo front end: from a pair of images to a cloud of measured points.
//!
//! The stages, in order:
//!
//! 1. [`Filter`]s prepare the images (optional).
//! 2. A [`Detector`] finds key points in each image.
//! 3. A [`Locator`] moves them to exact corners.
//! 4. A [`Descriptor`] describes their surroundings.
//! 5. A [`Matcher`] pairs left key points with right ones.
//! 6. A [`Refinement`] aligns each pair to a fraction of a pixel and rejects pairs that do not align.
//! 7. A [`Triangulator`] turns the pairs that pass the epipolar test into
//!    [`MeasuredPoint`](seafix_geometry::MeasuredPoint)s.
//!
//! [`FrontEnd`] runs them all. The centre of the first pixel is (0, 0). Brightness is linear in the stored values: 0 is
//! black and 255 is the white of an 8-bit image.

mod align;
mod describe;
mod detect;
mod epipolar_check;
mod filter;
mod front_end;
mod gaussian;
mod image;
mod locate;
mod matching;
mod right_camera_rotation;
mod scale_space;
mod stages;
mod swap_check;
mod track;
mod triangulate;
mod workspace;

pub use align::{
    Direct, Expected, REFINEMENTS, Refinement, Unaligned, Unrefined, Warp, Weight, ZnccParabola, read_refinement,
};
pub use describe::{Brief, DESCRIPTORS, Descriptor, Descriptors, Orb, Sift, Surf, Table, ZnccPatch};
pub use detect::{
    DETECTORS, Detector, Dog, Fast, FastHessian, FittedCorners, Harris, Keypoint, LCorners, Selection, ShiTomasi,
    Window, XCorners,
};
pub use epipolar_check::{EpipolarCheck, repeated_patterns};
pub use filter::{Clahe, FILTERS, Filter, Guided, Illumination, Median, Operation};
pub use front_end::{FrontEnd, FrontEndOutput, StageTimes};
pub use image::{BadImage, Image};
pub use locate::{Corner, CornerFit, Junction, LCorner, LOCATORS, Locator, Pair, Peak, UncertainPixel, XCorner};
pub use matching::{EpipolarBand, LucasKanade, MATCHERS, Match, Matcher, MutualRatio, View, ZnccBand};
pub use right_camera_rotation::RightCameraRotation;
pub use stages::{InvalidStage, StageChoices};
pub use swap_check::Sides;
pub use track::{Pyramid, Track, Tracker};
pub use triangulate::{Linear, Midpoint, Optimal, PointRules, TRIANGULATORS, Triangulator, read_triangulator};
pub use workspace::{Threads, Workspace};
