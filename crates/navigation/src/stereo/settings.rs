//! Settings and stages of stereo odometry.

use seafix_component::{Choice, Component, Settings, in_range};
use seafix_referencing::{SOLVERS, Solver};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, Descriptor, Direct, FILTERS, FrontEnd, LOCATORS, MATCHERS, Matcher, REFINEMENTS,
    TRIANGULATORS, Warp, read_refinement, read_triangulator,
};
use serde::{Deserialize, Serialize};

/// Visual odometry of a calibrated stereo rig: semi-direct tracking with windowed bundle adjustment.
///
/// Each pair becomes a cloud of measured points. Their descriptors are matched with those of the previous pair. RANSAC
/// (with the MSAC score) finds the motion with the most inliers, and a [`Solver`] refines it. This motion predicts
/// every landmark of the last key frames in both new images, and the patch around its first observation is aligned to
/// them directly. A landmark *is* the centre of its patch, so the error of the corner detector drops out. Patches are
/// warped by the slant of their surface, because the ground ahead of a vehicle is seen at a grazing angle. The pose is
/// the robust maximum likelihood over all found landmarks with their covariances. A pair that sees too few landmarks of
/// the last key frame becomes a key frame: it adds new landmarks, and bundle adjustment refines the poses and landmarks
/// of the last `window` key frames.
///
/// Points that are static in the image, beside others that agree on a motion, may be part of the vehicle. They are
/// accepted if their landmarks have been at other positions in the image before; otherwise pairs are skipped until the
/// vehicle is seen to move.
///
/// A constant error of the disparities contradicts the motion over ground at different distances: it is estimated over
/// windows of key frames, beside their poses and landmarks, and corrected once it is significant.
///
/// Points are projected through the lens model; images are neither rectified nor undistorted.
///
/// Source: Nistér, Naroditsky and Bergen, *Visual odometry*, CVPR 2004; Torr and Zisserman, *MLESAC*, 2000; Forster et
/// al., *SVO: semidirect visual odometry*, 2017; Triggs et al., *Bundle adjustment: a modern synthesis*, 2000.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Stereo {
    /// Image filters, in the order of their application.
    pub filters: Vec<Choice>,
    /// The detector of key points.
    pub detector: Choice,
    /// The locator of key points; `peak`, because natural texture has no corners to fit.
    pub locator: Choice,
    /// The descriptor, for the matcher between the cameras and the one between pairs.
    pub descriptor: Choice,
    /// The matcher between left and right image.
    pub matcher: Choice,
    /// The refinement of each match between the cameras.
    #[serde(deserialize_with = "read_refinement")]
    pub refinement: Choice,
    /// The triangulator.
    #[serde(deserialize_with = "read_triangulator")]
    pub triangulator: Choice,
    /// The matcher between successive pairs; it does not use the rig.
    #[setting(component = "matcher")]
    pub between: Choice,
    /// The minimal solver of RANSAC, for three points.
    #[setting(component = "solver")]
    pub minimal: Choice,
    /// The solver for all inliers of RANSAC.
    pub solver: Choice,
    /// Inlier threshold of RANSAC: RMS distance over both images from the predicted position (px).
    pub consensus_px: f64,
    /// Probability that RANSAC draws at least one sample without outliers, between 0 and 1.
    pub confidence: f64,
    /// Maximum number of RANSAC samples.
    pub draws: usize,
    /// Minimum number of inliers, at least 6.
    pub min_points: usize,
    /// The alignment of landmark patches in new images.
    pub follow: Direct,
    /// Maximum number of landmarks that are tracked in a pair.
    pub landmarks: usize,
    /// Minimum distance of a new landmark from others (px).
    pub apart_px: f64,
    /// Fraction of the last key frame's landmarks below which a pair becomes a key frame, 0 to 1.
    pub keyframe_fraction: f64,
    /// Number of key frames in the bundle adjustment, 1 to 100; 1 disables it.
    pub window: usize,
    /// Whether an error of the rig's disparities that the motion reveals is corrected; it needs a window of two key
    /// frames or more.
    ///
    /// The correction applies from the pair on at which it is significant. It is not made if it is smaller than two
    /// standard deviations of the disparity by the calibration error that the triangulator assumes.
    pub correct_range_offset: bool,
    /// Maximum standard deviation of the position over the three axes together (m); a less certain motion is rejected.
    pub max_sigma: f64,
    /// Maximum time between two usable pairs (s); a longer gap breaks the segment.
    pub max_gap: f64,
    /// Maximum speed (m/s); a faster estimate is rejected as an outlier.
    ///
    /// The default admits cars; use about 3 m/s for an inspection vehicle.
    pub max_speed: f64,
    /// Seed of the random samples.
    pub seed: u64,
}

impl Default for Stereo {
    fn default() -> Self {
        let deep = 1e4;
        Self {
            filters: Vec::new(),
            // A low quality threshold keeps the faint texture of the ground beside bright corners: the responses differ
            // by 1e7.
            detector: Choice::named("harris").with("sigma", 2.0).with("features", 1000).with("quality", 1e-7),
            locator: Choice::named("peak"),
            descriptor: Choice::named("surf"),
            matcher: Choice::named("epipolar-band").with("max-depth", deep),
            refinement: Choice::named("direct").with("warp", "slanted"),
            triangulator: Choice::named("optimal").with("max-depth", deep),
            between: Choice::named("mutual-ratio"),
            minimal: Choice::named("p3p-stereo"),
            solver: Choice::named("stereo-reprojection"),
            consensus_px: 2.0,
            confidence: 0.999,
            draws: 300,
            min_points: 15,
            follow: Direct { reach: 4.0, warp: Warp::Slanted, ..Direct::default() },
            landmarks: 500,
            apart_px: 8.0,
            keyframe_fraction: 0.7,
            window: 6,
            correct_range_offset: true,
            max_sigma: 1.0,
            max_gap: 5.0,
            max_speed: 50.0,
            seed: 0,
        }
    }
}

impl Component for Stereo {
    const NAME: &'static str = "stereo";
    const SUMMARY: &'static str = "semi-direct stereo visual odometry with windowed bundle adjustment";
    const SOURCE: &'static str = "Nistér, Naroditsky, Bergen, Visual odometry, CVPR 2004; Forster et al., SVO, 2017; \
                                  Triggs et al., Bundle adjustment: a modern synthesis, 2000";
    const VERSION: u32 = 2;

    fn check(&self) -> Result<(), String> {
        self.stages()?;
        self.follow.check().map_err(|message| format!("follow.{message}"))?;
        let positive = |name, x: f64, what| in_range(x > 0.0 && x.is_finite(), name, x, what);
        positive("consensus-px", self.consensus_px, "a positive number of pixels")?;
        let confident = self.confidence > 0.0 && self.confidence < 1.0;
        in_range(confident, "confidence", self.confidence, "a number between 0 and 1")?;
        in_range(self.draws > 0, "draws", self.draws, "at least 1")?;
        in_range(self.min_points >= 6, "min-points", self.min_points, "at least 6")?;
        let enough = self.landmarks >= self.min_points;
        in_range(enough, "landmarks", self.landmarks, "at least min-points")?;
        positive("apart-px", self.apart_px, "a positive number of pixels")?;
        let fraction = (0.0..=1.0).contains(&self.keyframe_fraction);
        in_range(fraction, "keyframe-fraction", self.keyframe_fraction, "a fraction from 0 to 1")?;
        in_range((1..=100).contains(&self.window), "window", self.window, "1 to 100 key frames")?;
        positive("max-sigma", self.max_sigma, "a positive length (m)")?;
        positive("max-gap", self.max_gap, "a positive time (s)")?;
        positive("max-speed", self.max_speed, "a positive speed (m/s)")
    }
}

/// The stages of the odometry.
#[derive(Debug)]
pub(crate) struct StereoStages {
    pub(crate) front_end: FrontEnd,
    pub(crate) descriptor: Box<dyn Descriptor>,
    pub(crate) between: Box<dyn Matcher>,
    pub(crate) minimal: Box<dyn Solver>,
    pub(crate) solver: Box<dyn Solver>,
}

impl Stereo {
    pub(crate) fn stages(&self) -> Result<StereoStages, String> {
        let message = |error: seafix_component::BuildError| error.to_string();
        let filters = self.filters.iter().map(|filter| FILTERS.build(filter));
        let front_end = FrontEnd {
            filters: filters.collect::<Result<_, _>>().map_err(message)?,
            detector: DETECTORS.build(&self.detector).map_err(message)?,
            locator: LOCATORS.build(&self.locator).map_err(message)?,
            descriptor: DESCRIPTORS.build(&self.descriptor).map_err(message)?,
            matcher: MATCHERS.build(&self.matcher).map_err(message)?,
            refinement: REFINEMENTS.build(&self.refinement).map_err(message)?,
            triangulator: TRIANGULATORS.build(&self.triangulator).map_err(message)?,
        };
        Ok(StereoStages {
            front_end,
            descriptor: DESCRIPTORS.build(&self.descriptor).map_err(message)?,
            between: MATCHERS.build(&self.between).map_err(message)?,
            minimal: SOLVERS.build(&self.minimal).map_err(message)?,
            solver: SOLVERS.build(&self.solver).map_err(message)?,
        })
    }
}
