//! Stereo visual odometry.

pub(crate) mod consensus;
mod follow;
pub(crate) mod front_end;
mod landmark;
pub(crate) mod pose;
mod taken;
mod tracker;
mod window;

use seafix_component::{Choice, Component, in_range};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_referencing::{SOLVERS, Solver};
use seafix_vision::{
    DESCRIPTORS, Descriptor, Direct, FrontEnd, MATCHERS, Matcher, StageChoices, Threads, Warp, read_refinement,
    read_triangulator,
};
use serde::{Deserialize, Serialize};

use crate::{Odometry, OdometrySession};
use tracker::StereoTracker;

/// Visual odometry of a calibrated stereo rig.
///
/// Each pair becomes a cloud of measured points. Points are paired with those of the pair before by their descriptors;
/// the motion that most pairs agree on (sample consensus over minimal sets, the truncated score of MSAC) is refined by a
/// [`Solver`]. With it every landmark of the last key frames is expected in both new images, and the patch around the
/// place where it was first seen is aligned to them directly: a landmark *is* the centre of its patch, so that the error
/// of the corner detector drops out. Patches are laid over as their surface slants: the ground ahead of a vehicle is seen
/// at a grazing angle. The pose is the robust maximum likelihood over all landmarks found, with their
/// covariances. Pairs that see too little of what the last key frame saw become key frames: they bring new landmarks, and
/// the poses and landmarks of the last `window` key frames are adjusted together (bundle adjustment).
///
/// A consensus of points that stand still in the image, beside others that agree on a motion, may be a part of the vehicle, sharp
/// and always found again. It is believed where landmarks of it have been elsewhere in the image; else pairs are left out until
/// the vehicle is seen to move.
///
/// Points are projected through the lens model; images are neither rectified nor undistorted.
///
/// Source: Nistér, Naroditsky and Bergen, *Visual odometry*, CVPR 2004; Torr and Zisserman, *MLESAC*, 2000; Forster et
/// al., *SVO: semidirect visual odometry*, 2017; Triggs et al., *Bundle adjustment: a modern synthesis*, 2000.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Stereo {
    /// Prepare each image, one after the other.
    pub filters: Vec<Choice>,
    /// Finds key points in each image.
    pub detector: Choice,
    /// Says where exactly they are. Natural texture has no corners to fit: `peak`.
    pub locator: Choice,
    /// Describes their surroundings, for the matcher between the two cameras and the one between pairs.
    pub descriptor: Choice,
    /// Pairs left with right.
    pub matcher: Choice,
    /// Aligns each pair between the cameras.
    #[serde(deserialize_with = "read_refinement")]
    pub refinement: Choice,
    /// Turns pairs into points.
    #[serde(deserialize_with = "read_triangulator")]
    pub triangulator: Choice,
    /// Pairs points with those of the pair before; the rig plays no part.
    pub between: Choice,
    /// The motion of three points, for the consensus.
    pub minimal: Choice,
    /// The motion of all that agree.
    pub solver: Choice,
    /// How far from its expected place, in the mean of both images, a point may be seen and still agree (px).
    pub consensus_px: f64,
    /// With what probability three right points have been drawn when the consensus ends.
    pub confidence: f64,
    /// Draws at most.
    pub draws: usize,
    /// Fewer points that agree are no consensus.
    pub min_points: usize,
    /// How landmarks are found again in new images.
    pub follow: Direct,
    /// At most so many landmarks are sought in a pair.
    pub landmarks: usize,
    /// A landmark begins no nearer to another (px).
    pub apart_px: f64,
    /// A pair becomes a key frame when it sees less than this share of the landmarks of the last key frame.
    pub keyframe_fraction: f64,
    /// Key frames that are adjusted together, from 1 to 100; with 1 none are.
    pub window: usize,
    /// A motion known worse than this is no answer: one standard deviation over the three axes together (m).
    pub max_sigma: f64,
    /// A longer time without a pair that can be followed breaks the segment (s).
    pub max_gap: f64,
    /// A faster motion is not believed (m/s). The default leaves room for a car's; a vehicle that inspects does not go 3 m/s, and
    /// what it is told to be unable to do it cannot be misled into.
    pub max_speed: f64,
    /// What is drawn at random follows from this.
    pub seed: u64,
}

impl Default for Stereo {
    fn default() -> Self {
        let deep = 1e4;
        Self {
            filters: Vec::new(),
            // Bright corners in view shall not hide the faint texture of the ground: their responses differ by ten million.
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
            max_sigma: 1.0,
            max_gap: 5.0,
            max_speed: 50.0,
            seed: 0,
        }
    }
}

impl Component for Stereo {
    const NAME: &'static str = "stereo";
    const SUMMARY: &'static str = "landmarks followed through both cameras' images, adjusted over key frames";
    const SOURCE: &'static str = "Nistér, Naroditsky, Bergen, Visual odometry, CVPR 2004; Forster et al., SVO, 2017; \
                                  Triggs et al., Bundle adjustment: a modern synthesis, 2000";

    fn check(&self) -> Result<(), String> {
        self.stages()?;
        self.follow.check().map_err(|said| format!("follow.{said}"))?;
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
        in_range(fraction, "keyframe-fraction", self.keyframe_fraction, "a share from 0 to 1")?;
        in_range((1..=100).contains(&self.window), "window", self.window, "1 to 100 key frames")?;
        positive("max-sigma", self.max_sigma, "a positive length (m)")?;
        positive("max-gap", self.max_gap, "a positive time (s)")?;
        positive("max-speed", self.max_speed, "a positive speed (m/s)")
    }
}

/// The stages, built.
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
        let said = |error: seafix_component::BuildError| error.to_string();
        let choices = StageChoices {
            filters: &self.filters,
            detector: &self.detector,
            locator: &self.locator,
            descriptor: &self.descriptor,
            matcher: &self.matcher,
            refinement: &self.refinement,
            triangulator: &self.triangulator,
        };
        Ok(StereoStages {
            front_end: FrontEnd::build(&choices).map_err(|invalid| invalid.to_string())?,
            descriptor: DESCRIPTORS.build(&self.descriptor).map_err(said)?,
            between: MATCHERS.build(&self.between).map_err(said)?,
            minimal: SOLVERS.build(&self.minimal).map_err(said)?,
            solver: SOLVERS.build(&self.solver).map_err(said)?,
        })
    }
}

impl Odometry for Stereo {
    fn begin<'a>(
        &'a self,
        rig: &'a StereoRig,
        _: Transform<Body, Camera>,
        threads: Threads,
    ) -> Box<dyn OdometrySession + 'a> {
        let stages = self.stages().expect("a component's settings were checked");
        Box::new(StereoTracker::new(self, stages, rig, threads))
    }
}
