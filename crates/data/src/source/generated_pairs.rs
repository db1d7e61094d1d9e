//! Putative correspondences with a given fraction of outliers.

use std::path::Path;

use seafix_component::{Component, Fault, Settings, in_range};
use seafix_simulation::families::{Generated, PutativePairs};
use serde::{Deserialize, Serialize};

use super::{generated_problems::posed, problem_sequence::ProblemSequence};
use crate::sequence::{Sequence, Source};

/// Putative pairs of model and measured points, of which a given fraction are outliers; each frame has an object and a
/// pose of its own.
///
/// This is the usual benchmark of robust registration: Yang, Shi and Carlone, *TEASER: fast and certifiable point cloud
/// registration*, 2020, Sec. VII. The object, pose and noise of a frame do not depend on the outlier fraction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct GeneratedPairs {
    /// The number of pairs of a frame.
    pub pairs: usize,
    /// The percentage of outliers.
    pub outliers: usize,
    /// The radius of the ball about the object in which the points of outliers lie (m).
    pub radius: f64,
    /// The standard deviation of the measured points per axis (m).
    pub sigma: f64,
    /// The number of frames.
    pub frames: u64,
}

impl Default for GeneratedPairs {
    fn default() -> Self {
        Self { pairs: 100, outliers: 50, radius: 1.0, sigma: 0.01, frames: 100 }
    }
}

impl Component for GeneratedPairs {
    const NAME: &'static str = "generated-pairs";
    const SUMMARY: &'static str = "putative pairs with a given fraction of outliers, with truth";
    const SOURCE: &'static str = "Yang, Shi, Carlone, TEASER, 2020";

    fn check(&self) -> Result<(), String> {
        in_range((3..=100_000).contains(&self.pairs), "pairs", self.pairs, "3 to 100000")?;
        in_range(self.outliers <= 100, "outliers", self.outliers, "0 to 100 (%)")?;
        let radius = self.radius > 0.0 && self.radius <= 1e3;
        in_range(radius, "radius", self.radius, "a positive length of at most 1000 m")?;
        let sigma = self.sigma > 0.0 && self.sigma <= 1.0;
        in_range(sigma, "sigma", self.sigma, "a positive length of at most 1 m")?;
        in_range((1..=1_000_000_000).contains(&self.frames), "frames", self.frames, "1 to 1000000000")
    }
}

impl Source for GeneratedPairs {
    fn open(&self, seed: u64, _folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let &Self { pairs, outliers, radius, sigma, frames } = self;
        let of = PutativePairs { pairs, outliers, radius, sigma };
        let generated = move |index: usize| posed(Generated::of_pairs(&of, seed, index as u64));
        let name = format!("{pairs} pairs, {outliers} % outliers, seed {seed}");
        Ok(Box::new(ProblemSequence::new(name, frames as usize, generated, Vec::new())))
    }

    fn has_pixels(&self) -> bool {
        false
    }
}
