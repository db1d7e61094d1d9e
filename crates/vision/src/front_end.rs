//! From two images to a cloud, one line a stage.

use std::time::Instant;

use seafix_geometry::{MeasuredPoint, StereoRig, UncertainPixels};

use crate::{
    Descriptor, Descriptors, Detector, Filter, Image, Keypoint, Locator, Match, Matcher, Pair, Refinement, Threads,
    Triangulator, UncertainPixel, View, Workspace,
};

/// The stages between two images and a cloud.
#[derive(Debug)]
pub struct FrontEnd {
    /// Prepare the images, one after the other; often none.
    pub filters: Vec<Box<dyn Filter>>,
    /// Finds key points in each image.
    pub detector: Box<dyn Detector>,
    /// Says where exactly the corners are.
    pub locator: Box<dyn Locator>,
    /// Describes their surroundings, if the matcher compares that.
    pub descriptor: Box<dyn Descriptor>,
    /// Pairs left with right.
    pub matcher: Box<dyn Matcher>,
    /// Says more exactly where the right image shows each left place.
    pub refinement: Box<dyn Refinement>,
    /// Turns pairs into points.
    pub triangulator: Box<dyn Triangulator>,
}

/// What the front end made of one pair of images, and the memory it made it in.
///
/// Used again for the next pair it allocates nothing that an earlier pair did not need.
#[derive(Debug, Default)]
pub struct FrontEndOutput {
    /// Left and right.
    sides: [SideOutput; 2],
    /// The images as the filters leave them; where there is no filter the images are looked at themselves.
    filtered: [Option<Image>; 2],
    work: Workspace,
    /// Left key points and where the right image shows them.
    pub matches: Vec<Match>,
    /// The same, with how well each place is known.
    pub pairs: Vec<Pair>,
    /// Those of them that are kept, aligned, with their covariance.
    pub pixels: Vec<UncertainPixels>,
    /// The cloud.
    pub cloud: Vec<MeasuredPoint>,
    /// How long each stage took.
    pub times: StageTimes,
}

/// One image's part.
#[derive(Debug, Default)]
struct SideOutput {
    work: Workspace,
    keypoints: Vec<Keypoint>,
    located: Vec<Option<UncertainPixel>>,
    descriptors: Descriptors,
}

/// Milliseconds that each stage took, both images together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageTimes {
    /// Filters.
    pub filter_ms: f64,
    /// Key points.
    pub detect_ms: f64,
    /// Exact corners.
    pub locate_ms: f64,
    /// Descriptors.
    pub describe_ms: f64,
    /// Matches.
    pub match_ms: f64,
    /// Alignment between the views.
    pub refine_ms: f64,
    /// Triangulation.
    pub triangulate_ms: f64,
}

impl StageTimes {
    /// Each stage by its name, in the order of the work.
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
    /// An empty one; `threads` says who works.
    pub fn new(threads: Threads) -> Self {
        let side = || SideOutput { work: Workspace::new(threads), ..SideOutput::default() };
        Self { sides: [side(), side()], work: Workspace::new(threads), ..Self::default() }
    }

    /// The key points of the left and of the right image.
    pub fn keypoints(&self) -> [&[Keypoint]; 2] {
        [&self.sides[0].keypoints, &self.sides[1].keypoints]
    }

    /// Their descriptors, in the same order; of no meaning where the matcher compares none.
    pub fn descriptors(&self) -> [&Descriptors; 2] {
        [&self.sides[0].descriptors, &self.sides[1].descriptors]
    }

    /// The images as the filters leave them; `None` where there is no filter.
    pub fn filtered(&self) -> [Option<&Image>; 2] {
        [self.filtered[0].as_ref(), self.filtered[1].as_ref()]
    }
}

impl FrontEnd {
    /// Replaces what is in `output` by what these two images show.
    pub fn run(&self, left: &Image, right: &Image, rig: &StereoRig, output: &mut FrontEndOutput) {
        let FrontEndOutput { sides: [l, r], filtered, work, matches, pairs, pixels, cloud, times } = output;
        let [clear_left, clear_right] = filtered;
        let threads = work.threads();
        let (mut left, mut right) = (left, right);
        times.filter_ms = timed(|| {
            if !self.filters.is_empty() {
                (left, right) = threads.join(
                    || self.filter(left, clear_left, &mut l.work),
                    || self.filter(right, clear_right, &mut r.work),
                );
            }
        });
        times.detect_ms = timed(|| {
            let detect =
                |image, side: &mut SideOutput| self.detector.detect_into(image, &mut side.work, &mut side.keypoints);
            threads.join(|| detect(left, l), || detect(right, r));
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
            // Of the pairs, in their order, some are left out.
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

    /// Moves the key points of `image` to the corners they are near. Key points of one corner are one: the
    /// strongest, which comes first.
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

    /// `image` as the filters leave it, in the memory of `kept`.
    fn filter<'a>(&self, image: &Image, kept: &'a mut Option<Image>, work: &mut Workspace) -> &'a Image {
        let kept = match kept {
            Some(kept) => {
                kept.copy_from(image);
                kept
            }
            None => kept.insert(image.clone()),
        };
        self.filters.iter().for_each(|filter| filter.apply(kept, work));
        kept
    }
}

/// Adds an error of standard deviation `off` (px) that both images share.
fn off_alike(seen: &mut UncertainPixels, off: f64) {
    for row in 0..4 {
        seen.covariance[(row, row)] += off * off;
        seen.covariance[(row, (row + 2) % 4)] += off * off;
    }
}

/// Corners nearer to each other than this are one (px).
const SAME: f64 = 1.0;

fn timed(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}
