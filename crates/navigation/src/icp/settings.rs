//! Settings of the registration of clouds.

use seafix_component::{Choice, Component, Settings, in_range};
use seafix_vision::{
    DESCRIPTORS, DETECTORS, FILTERS, FrontEnd, LOCATORS, MATCHERS, REFINEMENTS, TRIANGULATORS, read_refinement,
    read_triangulator,
};
use serde::{Deserialize, Serialize};

/// The distance measure between two points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Distance {
    /// The Euclidean distance: point-to-point ICP by Besl and McKay.
    Point,
    /// The Mahalanobis distance by the measurement noise of both points.
    #[default]
    Measured,
    /// The Mahalanobis distance with free movement along the local surfaces: plane-to-plane ICP.
    Plane,
}

/// Odometry by the iterative closest point algorithm: it uses the clouds of successive pairs and compares no images.
///
/// Each cloud is registered to that of the last key frame. The algorithm alternates between nearest points, of which
/// the fraction `keep` is used, and the minimum of
///
/// Σ eᵀ (C_k + R C Rᵀ)⁻¹ e, e = T p − q,
///
/// with C given by [`Distance`] (generalised ICP). It starts from the previous motion and, after a failure, from the
/// offset with the most votes of point pairs. The distance of partners narrows from `reach` to the points' own noise.
/// The result is accepted if enough points have a partner within their measurement noise: twice as many as at wrong
/// positions. The covariance is that of the fit, given the noise of both clouds.
///
/// A detector does not find corners at the same points of a surface again. This odometry is therefore a baseline;
/// odometry that aligns images is more accurate.
///
/// Source: Besl and McKay, *A method for registration of 3-D shapes*, 1992; Chetverikov et al., *The trimmed iterative
/// closest point algorithm*, 2002; Segal, Haehnel and Thrun, *Generalized-ICP*, 2009.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Icp {
    /// Image filters, in the order of their application.
    pub filters: Vec<Choice>,
    /// The detector of key points.
    pub detector: Choice,
    /// The locator of key points.
    pub locator: Choice,
    /// The descriptor of key points.
    pub descriptor: Choice,
    /// The matcher between left and right image.
    pub matcher: Choice,
    /// The refinement of each match between the cameras.
    #[serde(deserialize_with = "read_refinement")]
    pub refinement: Choice,
    /// The triangulator.
    #[serde(deserialize_with = "read_triangulator")]
    pub triangulator: Choice,
    /// The distance measure between two points.
    pub distance: Distance,
    /// Fraction of the nearest pairs that is used, above 0 and at most 1; points without a counterpart are trimmed.
    pub keep: f64,
    /// Maximum distance of partners at the start (m).
    pub reach: f64,
    /// Maximum number of iterations at each level of the narrowing reach.
    pub iterations: usize,
    /// Number of neighbours that determine the local surface, 3 to 100.
    pub neighbours: usize,
    /// Minimum number of points with a partner, at least 6.
    pub min_points: usize,
    /// Minimum fraction of points with a partner, 0 to 1.
    pub min_fraction: f64,
    /// Fraction of points with a partner, 0 to 1, below which a pair becomes a key frame.
    pub keyframe_fraction: f64,
    /// Maximum standard deviation of the position over the three axes together (m); a less certain motion is rejected.
    pub max_sigma: f64,
    /// Maximum time between two usable pairs (s); a longer gap breaks the segment.
    pub max_gap: f64,
    /// Maximum speed (m/s); a faster estimate is rejected as an outlier.
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
    const SUMMARY: &'static str = "iterative closest points over the clouds of successive pairs";
    const SOURCE: &'static str = "Besl, McKay, A method for registration of 3-D shapes, 1992; Chetverikov et al., The trimmed \
                                  iterative closest point algorithm, 2002; Segal, Haehnel, Thrun, Generalized-ICP, 2009";

    fn check(&self) -> Result<(), String> {
        self.front_end()?;
        let positive = |name, x: f64, what| in_range(x > 0.0 && x.is_finite(), name, x, what);
        let fraction = |name, x: f64| in_range((0.0..=1.0).contains(&x), name, x, "a fraction from 0 to 1");
        in_range(self.keep > 0.0 && self.keep <= 1.0, "keep", self.keep, "a fraction in (0, 1]")?;
        positive("reach", self.reach, "a positive length (m)")?;
        in_range(self.iterations > 0, "iterations", self.iterations, "at least 1")?;
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
    pub(super) fn front_end(&self) -> Result<FrontEnd, String> {
        let message = |error: seafix_component::BuildError| error.to_string();
        let filters = self.filters.iter().map(|filter| FILTERS.build(filter));
        Ok(FrontEnd {
            filters: filters.collect::<Result<_, _>>().map_err(message)?,
            detector: DETECTORS.build(&self.detector).map_err(message)?,
            locator: LOCATORS.build(&self.locator).map_err(message)?,
            descriptor: DESCRIPTORS.build(&self.descriptor).map_err(message)?,
            matcher: MATCHERS.build(&self.matcher).map_err(message)?,
            refinement: REFINEMENTS.build(&self.refinement).map_err(message)?,
            triangulator: TRIANGULATORS.build(&self.triangulator).map_err(message)?,
        })
    }
}
