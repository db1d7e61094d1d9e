//! Putative correspondences with a share of wrong ones.

use std::path::Path;

use seafix_component::{Component, Fault, in_range};
use seafix_simulation::families::{Generated, PutativePairs};
use serde::{Deserialize, Serialize};

use super::{Sequence, Source, generated_problems::posed, problem_sequence::ProblemSequence};

/// Pairs of model and measured points of which a share is wrong, each frame another object and another pose: how the
/// literature compares what is robust. Of one frame the object, its pose and the noise do not depend on the share.
///
/// Source: Yang, Shi and Carlone, *TEASER: fast and certifiable point cloud registration*, 2020, Sec. VII.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct GeneratedPairs {
    /// Pairs of a frame.
    pub pairs: usize,
    /// How many in a hundred are wrong.
    pub outliers: usize,
    /// Points of wrong pairs lie in a ball of this radius about the object (m).
    pub radius: f64,
    /// Noise of the measured points, an axis (m).
    pub sigma: f64,
    /// How many frames.
    pub frames: u64,
}

impl Default for GeneratedPairs {
    fn default() -> Self {
        Self { pairs: 100, outliers: 50, radius: 1.0, sigma: 0.01, frames: 100 }
    }
}

impl Component for GeneratedPairs {
    const NAME: &'static str = "generated-pairs";
    const SUMMARY: &'static str = "putative pairs of which a share is wrong, with truth";
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
        let name = format!("{pairs} pairs, {outliers} % wrong, seed {seed}");
        Ok(Box::new(ProblemSequence::new(name, frames as usize, generated, Vec::new())))
    }

    fn has_pixels(&self) -> bool {
        false
    }
}
