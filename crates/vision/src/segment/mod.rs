//! Straight segments: detection, fit, stereo matching and triangulation.

mod a_contrario;
mod band_descriptor;
mod chain;
mod corners;
mod detector;
mod distinct;
mod edge_drawing;
mod fit;
mod gradients;
mod half_points;
mod line;
mod matcher;
mod nfa;
mod overlap;
mod overlap_profile;
mod profile;
mod region;
mod step;
mod straight;
mod strips;
mod trace;
mod triangulate;

pub use a_contrario::AContrario;
pub use band_descriptor::BandDescriptor;
pub use corners::EdgeCorners;
pub use detector::{Segment, SegmentDetector};
pub(crate) use distinct::keep_distinct;
pub use edge_drawing::EdgeDrawing;
pub use fit::{FitScratch, FittedSegment, SegmentFit};
pub use matcher::{SegmentMatch, SegmentMatcher, SegmentView};
pub use overlap_profile::OverlapProfile;
use seafix_component::{Registry, entry};
pub use triangulate::LineRules;

/// The registry of segment detectors.
pub static SEGMENT_DETECTORS: Registry<dyn SegmentDetector> =
    Registry::new("segment-detector", &[entry!(AContrario), entry!(EdgeDrawing)]);

/// The registry of segment matchers.
pub static SEGMENT_MATCHERS: Registry<dyn SegmentMatcher> =
    Registry::new("segment-matcher", &[entry!(BandDescriptor), entry!(OverlapProfile)]);
