//! Registration of successive clouds.

mod align;
mod grid;
mod tracker;

use seafix_component::{Choice, Component, in_range};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_vision::{FrontEnd, StageChoices, Threads, read_refinement, read_triangulator};
use serde::{Deserialize, Serialize};

use crate::{Odometry, OdometrySession};
use tracker::IcpTracker;

/// What makes two points near.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Distance {
    /// Their distance: the closest points of Besl and McKay.
    Point,
    /// Their distance in the noise that each was measured with.
    #[default]
    Measured,
    /// The same, and each may slip along the surface that its neighbours lie in: plane to plane.
    Plane,
}

/// Odometry by iterative closest points: nothing but the clouds of successive pairs, no image is compared with another.
///
/// A cloud is laid over that of the last key frame: pairs of nearest points, the nearest `keep` of them fitted, by turns, with
///
/// Σ eᵀ (C_k + R C Rᵀ)⁻¹ e, e = T p − q,
///
/// C by [`Distance`] (generalised ICP). It starts from the motion before, and where that leads nowhere from the offset on which
/// most pairs of points agree. What is fitted narrows from `reach` to the points' own noise. The answer holds where
/// enough points have a partner within their measured noise, twice as many as the same cloud has by chance elsewhere;
/// everything else is lost. The covariance is that of the fit, of both clouds' noise.
///
/// Corners are not found at the same place of a surface again, so it is a baseline: an odometry that looks into the images
/// knows the motion better.
///
/// Source: Besl and McKay, *A method for registration of 3-D shapes*, 1992; Chetverikov et al., *The trimmed iterative
/// closest point algorithm*, 2002; Segal, Haehnel and Thrun, *Generalized-ICP*, 2009.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Icp {
    /// Prepare each image, one after the other.
    pub filters: Vec<Choice>,
    /// Finds key points in each image.
    pub detector: Choice,
    /// Says where exactly they are.
    pub locator: Choice,
    /// Describes their surroundings, for the matcher.
    pub descriptor: Choice,
    /// Pairs left with right.
    pub matcher: Choice,
    /// Aligns each pair between the cameras.
    #[serde(deserialize_with = "read_refinement")]
    pub refinement: Choice,
    /// Turns pairs into points.
    #[serde(deserialize_with = "read_triangulator")]
    pub triangulator: Choice,
    /// What makes two points near.
    pub distance: Distance,
    /// Share of the nearest pairs that is fitted: points of one cloud that the other has not have no partner.
    pub keep: f64,
    /// How far points may be from their partners at the start (m).
    pub reach: f64,
    /// Iterations at most, of each of the steps in which the reach narrows.
    pub iterations: usize,
    /// Neighbours that say how the surface lies.
    pub neighbours: usize,
    /// Fewer points with a partner are no answer.
    pub min_points: usize,
    /// So is a smaller share of them.
    pub min_fraction: f64,
    /// A pair becomes a key frame when less than this share of its points have a partner.
    pub keyframe_fraction: f64,
    /// A motion known worse than this is no answer: one standard deviation over the three axes together (m).
    pub max_sigma: f64,
    /// A longer time without a pair that can be followed breaks the segment (s).
    pub max_gap: f64,
    /// A faster motion is not believed (m/s).
    pub max_speed: f64,
}

impl Default for Icp {
    fn default() -> Self {
        let deep = 1e4;
        Self {
            filters: Vec::new(),
            detector: Choice::named("harris").with("sigma", 2.0).with("features", 1000).with("quality", 1e-7),
            locator: Choice::named("peak"),
            descriptor: Choice::named("surf"),
            matcher: Choice::named("epipolar-band").with("max-depth", deep),
            refinement: Choice::named("direct").with("warp", "slanted"),
            triangulator: Choice::named("optimal").with("max-depth", deep),
            distance: Distance::Measured,
            keep: 0.7,
            reach: 0.4,
            iterations: 20,
            neighbours: 8,
            min_points: 15,
            min_fraction: 0.2,
            keyframe_fraction: 0.4,
            max_sigma: 1.0,
            max_gap: 5.0,
            max_speed: 50.0,
        }
    }
}

impl Component for Icp {
    const NAME: &'static str = "icp";
    const SUMMARY: &'static str = "successive clouds laid over each other by their nearest points";
    const SOURCE: &'static str = "Besl, McKay, A method for registration of 3-D shapes, 1992; Chetverikov et al., The trimmed \
                                  iterative closest point algorithm, 2002; Segal, Haehnel, Thrun, Generalized-ICP, 2009";

    fn check(&self) -> Result<(), String> {
        self.front_end()?;
        let positive = |name, x: f64, what| in_range(x > 0.0 && x.is_finite(), name, x, what);
        let fraction = |name, x: f64| in_range((0.0..=1.0).contains(&x), name, x, "a share from 0 to 1");
        in_range(self.keep > 0.0 && self.keep <= 1.0, "keep", self.keep, "a share above 0, at most 1")?;
        positive("reach", self.reach, "a positive length (m)")?;
        in_range(self.iterations > 0, "iterations", self.iterations, "1 or more")?;
        in_range((3..=100).contains(&self.neighbours), "neighbours", self.neighbours, "3 to 100")?;
        in_range(self.min_points >= 6, "min-points", self.min_points, "at least 6")?;
        fraction("min-fraction", self.min_fraction)?;
        fraction("keyframe-fraction", self.keyframe_fraction)?;
        positive("max-sigma", self.max_sigma, "a positive length (m)")?;
        positive("max-gap", self.max_gap, "a positive time (s)")?;
        positive("max-speed", self.max_speed, "a positive speed (m/s)")
    }
}

impl Icp {
    fn front_end(&self) -> Result<FrontEnd, String> {
        let choices = StageChoices {
            filters: &self.filters,
            detector: &self.detector,
            locator: &self.locator,
            descriptor: &self.descriptor,
            matcher: &self.matcher,
            refinement: &self.refinement,
            triangulator: &self.triangulator,
        };
        FrontEnd::build(&choices).map_err(|invalid| invalid.to_string())
    }
}

impl Odometry for Icp {
    fn begin<'a>(
        &'a self,
        rig: &'a StereoRig,
        _: Transform<Body, Camera>,
        threads: Threads,
    ) -> Box<dyn OdometrySession + 'a> {
        let front_end = self.front_end().expect("a component's settings were checked");
        Box::new(IcpTracker::new(self, front_end, rig, threads))
    }
}
