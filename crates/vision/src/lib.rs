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
//! [`FrontEnd`] runs them all. [`OutlineCorners`] and [`EdgeCorners`] add corners that descriptors do not match. The
//! centre of the first pixel is (0, 0). Brightness is linear in the stored values: 0 is black and 255 is the white of an
//! 8-bit image.
//!
//! ```
//! use nalgebra::{UnitQuaternion, Vector3};
//! use seafix_component::Choice;
//! use seafix_geometry::{Pinhole, StereoRig, Transform};
//! use seafix_vision::{
//!     DESCRIPTORS, DETECTORS, FrontEnd, FrontEndOutput, Image, LOCATORS, MATCHERS, REFINEMENTS, TRIANGULATORS,
//! };
//!
//! // Two cameras side by side, 0.25 m apart, with a focal length of 500 px.
//! let camera = Pinhole::new([320, 240], [500.0, 500.0], [159.5, 119.5], &[]).unwrap();
//! let right_from_left = Transform::new(UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0));
//! let rig = StereoRig::new(camera, camera, right_from_left).unwrap();
//!
//! // A wall of random grey cells of 8 px. A disparity of 20 px puts it at a depth of 500 · 0.25 / 20 = 6.25 m.
//! let grey = |x: u32, y: u32| {
//!     let mut hash = (x / 8).wrapping_mul(0x9E37_79B1) ^ (y / 8).wrapping_mul(0x85EB_CA77);
//!     hash = (hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D);
//!     (hash >> 24) as f32
//! };
//! let view = |shift: u32| {
//!     let pixels = (0..320 * 240).map(|i| grey(i % 320 + shift, i / 320)).collect();
//!     Image::new(320, 240, pixels).unwrap()
//! };
//! let (left, right) = (view(0), view(20));
//!
//! let front_end = FrontEnd {
//!     filters: Vec::new(),
//!     detector: DETECTORS.build(&Choice::named("harris")).unwrap(),
//!     locator: LOCATORS.build(&Choice::named("corner")).unwrap(),
//!     descriptor: DESCRIPTORS.build(&Choice::named("surf")).unwrap(),
//!     matcher: MATCHERS.build(&Choice::named("epipolar-band")).unwrap(),
//!     refinement: REFINEMENTS.build(&Choice::named("direct")).unwrap(),
//!     triangulator: TRIANGULATORS.build(&Choice::named("optimal")).unwrap(),
//! };
//! let mut output = FrontEndOutput::default();
//! front_end.run(&left, &right, &rig, &mut output);
//!
//! let on_the_wall = output.cloud.iter().filter(|point| (point.position.at.coords.z - 6.25).abs() < 0.1).count();
//! assert!(on_the_wall > 20 && 10 * on_the_wall >= 9 * output.cloud.len());
//! ```

mod align;
mod describe;
mod detect;
mod epipolar_check;
mod filter;
mod front_end;
mod gaussian;
mod image;
mod keypoint;
mod line_front_end;
mod locate;
mod matching;
mod regions;
mod right_camera_rotation;
mod scale_space;
mod segment;
mod swap_check;
mod track;
mod triangulate;
mod workspace;

pub use align::{
    Direct, Expected, REFINEMENTS, Refinement, Unaligned, Unrefined, Warp, Weight, ZnccParabola, read_refinement,
};
pub use describe::{Brief, DESCRIPTORS, Descriptor, Descriptors, Orb, Sift, Surf, Table, ZnccPatch};
pub use detect::{
    DETECTORS, Detector, Dog, Fast, FastHessian, FittedCorners, GuidedCorners, Harris, Keypoint, LCorners, Selection,
    ShiTomasi, Window, XCorners,
};
pub use epipolar_check::{EpipolarCheck, matches_by_appearance};
pub use filter::{Clahe, FILTERS, Filter, Guided, Illumination, Median, Operation};
pub use front_end::{FrontEnd, FrontEndOutput, StageTimes};
pub use image::{BadImage, Image};
pub use line_front_end::{LineFrontEnd, LineOutput};
pub use locate::{
    Corner, CornerFit, CornerJunction, Junction, LCorner, LOCATORS, Locator, Pair, Peak, UncertainPixel, XCorner,
};
pub use matching::{
    CornerView, EpipolarBand, LucasKanade, MATCHERS, Match, Matcher, MutualRatio, OutlineCorners, View, ZnccBand,
};
pub use regions::{Disc, Regions};
pub use right_camera_rotation::RightCameraRotation;
pub use segment::{
    AContrario, BandDescriptor, EdgeCorners, EdgeDrawing, FitScratch, FittedSegment, LineRules, OverlapProfile,
    SEGMENT_DETECTORS, SEGMENT_MATCHERS, Segment, SegmentDetector, SegmentFit, SegmentMatch, SegmentMatcher,
    SegmentView,
};
pub use swap_check::Sides;
pub use track::{Pyramid, Track, Tracker};
pub use triangulate::{Linear, Midpoint, Optimal, PointRules, TRIANGULATORS, Triangulator, read_triangulator};
pub use workspace::{Threads, Workspace};
