//! The front end, which runs all stages from two images to a cloud.

use std::time::Instant;

use seafix_geometry::{MeasuredPoint, StereoRig, UncertainPixels};

use crate::{
    align::Refinement,
    describe::{Descriptor, Descriptors},
    detect::{Detector, Keypoint},
    filter::Filter,
    image::Image,
    locate::{Locator, Pair, UncertainPixel},
    matching::{Match, Matcher, View},
    regions::Regions,
    triangulate::Triangulator,
    workspace::{Threads, Workspace},
};

/// The stages from a pair of images to a cloud.
#[derive(Debug)]
pub struct FrontEnd {
    /// The filters, applied to each image in order; often none.
    pub filters: Vec<Box<dyn Filter>>,
    /// The detector of key points.
    pub detector: Box<dyn Detector>,
    /// The locator, which moves key points to exact corners.
    pub locator: Box<dyn Locator>,
    /// The descriptor, for matchers that compare descriptors.
    pub descriptor: Box<dyn Descriptor>,
    /// The matcher of left and right key points.
    pub matcher: Box<dyn Matcher>,
    /// The refinement of each match to a fraction of a pixel.
    pub refinement: Box<dyn Refinement>,
    /// The triangulator of the refined pairs.
    pub triangulator: Box<dyn Triangulator>,
}

/// The front end's results for one pair of images, with its working memory.
///
/// Reuse it for the next pair: it then allocates only if that pair needs more memory than all earlier ones.
#[derive(Debug, Default)]
pub struct FrontEndOutput {
    /// The parts of the left and the right image.
    sides: [SideOutput; 2],
    /// The filtered images; `None` without filters, since the stages then read the images themselves.
    filtered: [Option<Image>; 2],
    work: Workspace,
    /// The matches of left key points and their pixels in the right image.
    pub matches: Vec<Match>,
    /// The matches with the covariance of both pixels.
    pub pairs: Vec<Pair>,
    /// The refined and accepted pairs with their covariance.
    pub pixels: Vec<UncertainPixels>,
    /// The triangulated points.
    pub cloud: Vec<MeasuredPoint>,
    /// The run time of each stage.
    pub times: StageTimes,
}

/// The part of one image.
#[derive(Debug, Default)]
struct SideOutput {
    work: Workspace,
    keypoints: Vec<Keypoint>,
    located: Vec<Option<UncertainPixel>>,
    descriptors: Descriptors,
}

/// The run times of the stages (ms), both images together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageTimes {
    /// The filters' time (ms).
    pub filter_ms: f64,
    /// The detector's time (ms).
    pub detect_ms: f64,
    /// The locator's time (ms).
    pub locate_ms: f64,
    /// The descriptor's time (ms).
    pub describe_ms: f64,
    /// The matcher's time (ms).
    pub match_ms: f64,
    /// The refinement's time (ms).
    pub refine_ms: f64,
    /// The triangulator's time (ms).
    pub triangulate_ms: f64,
}

impl StageTimes {
    /// The name and the time (ms) of each stage, in order of execution.
    pub fn stages(&self) -> Vec<(&'static str, f64)> {
        let Self { filter_ms, detect_ms, locate_ms, describe_ms, match_ms, refine_ms, triangulate_ms } = *self;
        vec![
            ("filter", filter_ms),
            ("detect", detect_ms),
            ("locate", locate_ms),
            ("describe", describe_ms),
            ("match", match_ms),
            ("refine", refine_ms),
            ("triangulate", triangulate_ms),
        ]
    }
}

impl FrontEndOutput {
    /// An empty output; `threads` states whether the stages share the rayon pool.
    pub fn new(threads: Threads) -> Self {
        let side = || SideOutput { work: Workspace::new(threads), ..SideOutput::default() };
        Self { sides: [side(), side()], work: Workspace::new(threads), ..Self::default() }
    }

    /// The key points of the left and the right image.
    pub fn keypoints(&self) -> [&[Keypoint]; 2] {
        [&self.sides[0].keypoints, &self.sides[1].keypoints]
    }

    /// The corners that the locator found, in the order of the key points.
    pub fn located(&self) -> [&[Option<UncertainPixel>]; 2] {
        [&self.sides[0].located, &self.sides[1].located]
    }

    /// The descriptors in the order of the key points; meaningless if the matcher compares none.
    pub fn descriptors(&self) -> [&Descriptors; 2] {
        [&self.sides[0].descriptors, &self.sides[1].descriptors]
    }

    /// The filtered images; `None` without filters.
    pub fn filtered(&self) -> [Option<&Image>; 2] {
        [self.filtered[0].as_ref(), self.filtered[1].as_ref()]
    }
}

impl FrontEnd {
    /// Replaces the contents of `output` by the results for this pair of images.
    pub fn run(&self, left: &Image, right: &Image, rig: &StereoRig, output: &mut FrontEndOutput) {
        self.run_guided([left, right], rig, &[Regions::NONE; 2], output);
    }

    /// Applies the filters alone; the rest of `output` does not change.
    pub fn filter_pair(&self, [left, right]: [&Image; 2], output: &mut FrontEndOutput) {
        let FrontEndOutput { sides: [l, r], filtered: [clear_left, clear_right], work, times, .. } = output;
        let threads = work.threads();
        times.filter_ms = timed(|| {
            if !self.filters.is_empty() {
                threads.join(
                    || self.filter(left, clear_left, &mut l.work),
                    || self.filter(right, clear_right, &mut r.work),
                );
            }
        });
    }

    /// Replaces the contents of `output` by the results for the left and the right image of a pair.
    ///
    /// A guided detector selects more key points in the `regions` of the images.
    pub fn run_guided(
        &self,
        [left, right]: [&Image; 2],
        rig: &StereoRig,
        [left_regions, right_regions]: &[Regions; 2],
        output: &mut FrontEndOutput,
    ) {
        self.filter_pair([left, right], output);
        let FrontEndOutput { sides: [l, r], filtered, work, matches, pairs, pixels, cloud, times } = output;
        let threads = work.threads();
        let [clear_left, clear_right] =
            filtered.each_ref().map(|image| image.as_ref().filter(|_| !self.filters.is_empty()));
        let (left, right) = (clear_left.unwrap_or(left), clear_right.unwrap_or(right));
        times.detect_ms = timed(|| {
            let detect = |image, regions, side: &mut SideOutput| {
                self.detector.detect_guided_into(image, regions, &mut side.work, &mut side.keypoints);
            };
            threads.join(|| detect(left, left_regions, l), || detect(right, right_regions, r));
        });
        times.locate_ms = timed(|| {
            threads.join(|| self.locate(left, l), || self.locate(right, r));
        });
        times.describe_ms = timed(|| {
            let describe = |image, side: &mut SideOutput| {
                if self.matcher.compares_descriptors() {
                    self.descriptor.describe_into(image, &side.keypoints, &mut side.work, &mut side.descriptors);
                }
            };
            threads.join(|| describe(left, l), || describe(right, r));
        });
        let left = View { image: left, keypoints: &l.keypoints, descriptors: &l.descriptors };
        let right = View { image: right, keypoints: &r.keypoints, descriptors: &r.descriptors };
        times.match_ms = timed(|| self.matcher.match_into(&left, &right, rig, work, matches));
        let (sigma, off) = (self.triangulator.rules().sigma_px, self.triangulator.rules().peak_px);
        times.refine_ms = timed(|| {
            pairs.clear();
            let pair = |found: &Match| {
                let detected = || UncertainPixel::independent(left.keypoints[found.left].at, sigma);
                let place = l.located[found.left].unwrap_or_else(detected);
                Pair { left: place, right: UncertainPixel::independent(found.right, sigma) }
            };
            pairs.extend(matches.iter().map(pair));
            self.refinement.refine_into(pairs, left.image, right.image, rig, work, pixels);
            // The refinement keeps the order of the pairs and drops some.
            let mut rest = matches.iter().zip(pairs.iter());
            for seen in pixels.iter_mut() {
                let own = rest.find(|(_, pair)| pair.left.at == seen.at.left);
                if own.is_some_and(|(found, _)| l.located[found.left].is_none()) {
                    off_alike(seen, off);
                }
            }
        });
        times.triangulate_ms = timed(|| self.triangulator.triangulate_into(pixels, rig, cloud));
    }

    /// Moves the key points of `image` to the nearest corners and merges those of one corner.
    ///
    /// The strongest key point of a corner comes first and is kept.
    fn locate(&self, image: &Image, side: &mut SideOutput) {
        let SideOutput { work, keypoints, located, .. } = side;
        self.locator.locate_into(image, keypoints, work, located);
        let mut kept = 0;
        for i in 0..keypoints.len() {
            let (mut keypoint, place) = (keypoints[i], located[i]);
            if let Some(place) = place {
                keypoint.at = place.at;
            }
            let repeats = |earlier: &Keypoint| earlier.at.distance(&keypoint.at) < SAME;
            if !(place.is_some() && keypoints[..kept].iter().any(repeats)) {
                (keypoints[kept], located[kept]) = (keypoint, place);
                kept += 1;
            }
        }
        keypoints.truncate(kept);
        located.truncate(kept);
    }

    /// The filtered `image`, written into the memory of `kept`.
    fn filter(&self, image: &Image, kept: &mut Option<Image>, work: &mut Workspace) {
        let kept = match kept {
            Some(kept) => {
                kept.copy_from(image);
                kept
            }
            None => kept.insert(image.clone()),
        };
        self.filters.iter().for_each(|filter| filter.apply(kept, work));
    }
}

/// Adds an error of standard deviation `off` (px) that is common to both images.
fn off_alike(seen: &mut UncertainPixels, off: f64) {
    for row in 0..4 {
        seen.covariance[(row, row)] += off * off;
        seen.covariance[(row, (row + 2) % 4)] += off * off;
    }
}

/// The distance (px) below which two corners are the same.
const SAME: f64 = 1.0;

fn timed(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}
