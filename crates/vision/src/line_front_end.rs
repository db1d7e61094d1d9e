//! The stages from a pair of images to measured lines.

use std::time::Instant;

use seafix_geometry::{MeasuredLine, NormalOffset, Pinhole, StereoRig};

use crate::{
    image::Image,
    segment::{
        FitScratch, FittedSegment, LineRules, Segment, SegmentDetector, SegmentFit, SegmentMatch, SegmentMatcher,
        SegmentView, keep_distinct,
    },
    workspace::{Threads, Workspace},
};

/// The stages from a pair of images to measured lines, beside the [`FrontEnd`](crate::FrontEnd) of points.
#[derive(Debug)]
pub struct LineFrontEnd {
    /// The detector of segments.
    pub detector: Box<dyn SegmentDetector>,
    /// The fit of each segment.
    pub fit: SegmentFit,
    /// The matcher of left and right segments.
    pub matcher: Box<dyn SegmentMatcher>,
    /// The triangulation of matched segments.
    pub rules: LineRules,
    /// Standard deviation (px) of the camera model's own error, added to every offset as to the pixels of points: that of
    /// [`PointRules`](crate::PointRules).
    pub calibration_px: f64,
}

/// The lines of one pair of images, with the working memory.
#[derive(Debug, Default)]
pub struct LineOutput {
    sides: [Side; 2],
    work: Workspace,
    /// The matches of left and right segments.
    pub matches: Vec<SegmentMatch>,
    /// The measured lines.
    pub lines: Vec<MeasuredLine>,
    /// The run time (ms).
    pub time_ms: f64,
}

/// The part of one image.
#[derive(Debug, Default)]
struct Side {
    work: Workspace,
    found: Vec<Segment>,
    scratch: FitScratch,
    segments: Vec<FittedSegment>,
}

impl LineOutput {
    /// An empty output; `threads` states whether the stages share the rayon pool.
    pub fn new(threads: Threads) -> Self {
        Self { work: Workspace::new(threads), ..Self::default() }
    }

    /// The fitted segments of the left and the right image.
    pub fn segments(&self) -> [&[FittedSegment]; 2] {
        [&self.sides[0].segments, &self.sides[1].segments]
    }
}

impl LineFrontEnd {
    /// Replaces the contents of `output` by the lines of the left and the right image of a pair.
    pub fn run(&self, [left, right]: [&Image; 2], rig: &StereoRig, output: &mut LineOutput) {
        let start = Instant::now();
        let LineOutput { sides: [l, r], work, matches, lines, time_ms } = output;
        work.threads().join(|| self.side(left, rig.left(), l), || self.side(right, rig.right(), r));
        let view = |image, segments| SegmentView { image, segments };
        self.matcher.match_into(&view(left, &l.segments), &view(right, &r.segments), rig, work, matches);
        lines.clear();
        let line = |found: &SegmentMatch| {
            let [left, right] = [&l.segments[found.left], &r.segments[found.right]].map(|s| self.with_calibration(s));
            self.rules.line(rig, &left, &right)
        };
        lines.extend(matches.iter().filter_map(line));
        *time_ms = start.elapsed().as_secs_f64() * 1e3;
    }

    fn with_calibration(&self, segment: &FittedSegment) -> FittedSegment {
        let raised =
            |offset: NormalOffset| NormalOffset { sigma: libm::hypot(offset.sigma, self.calibration_px), ..offset };
        FittedSegment { offsets: segment.offsets.map(raised), ..*segment }
    }

    /// The fitted segments of one image, the longest first.
    fn side(&self, image: &Image, camera: &Pinhole, side: &mut Side) {
        let Side { work, found, scratch, segments } = side;
        self.detector.detect_into(image, camera, work, found);
        segments.clear();
        segments.extend(found.iter().filter_map(|segment| self.fit.fit(image, camera, segment, scratch)));
        keep_distinct(segments);
    }
}
