//! Coherence problems generated from a family.

use std::{path::Path, sync::Arc};

use seafix_component::{Component, Fault, Settings, in_range};
use seafix_evaluation::Solved;
use seafix_geometry::{Camera, Object, Transform};
use seafix_simulation::families::{Family, Generated, Presence};
use serde::{Deserialize, Serialize};

use super::problem_sequence::{Posed, ProblemSequence};
use crate::sequence::{Sequence, Source, TrueAnswer};

/// Generated coherence problems of one family, one a frame, equal to those that `seafix generate` writes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct GeneratedProblems {
    /// The family: `paper-scale`, `site-scale`, `no-prior`, `putative`, `lattice`, `few-visible` or `dense-clutter`.
    pub family: String,
    /// The number of problems.
    pub frames: u64,
    /// The number of the first problem in its family; the varied quantity cycles with the number.
    pub first: u64,
    /// Whether the object is absent: the cloud is clutter, and every pose is wrong.
    pub absent: bool,
}

impl Default for GeneratedProblems {
    fn default() -> Self {
        Self { family: "paper-scale".to_owned(), frames: 100, first: 0, absent: false }
    }
}

impl Component for GeneratedProblems {
    const NAME: &'static str = "generated-problems";
    const SUMMARY: &'static str = "coherence problems generated from a family, one a frame, with truth";
    const SOURCE: &'static str = "ours";

    fn check(&self) -> Result<(), String> {
        self.family.parse::<Family>()?;
        in_range((1..=1_000_000_000).contains(&self.frames), "frames", self.frames, "1 to 1000000000")?;
        in_range(self.first <= 1_000_000_000, "first", self.first, "at most 1000000000")
    }
}

impl Source for GeneratedProblems {
    fn open(&self, seed: u64, _folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        let family = self.family.parse().map_err(|what: String| vec![Fault::new(what, Path::new("the source"))])?;
        let presence = if self.absent { Presence::Absent } else { Presence::Present };
        let first = self.first;
        let generated = move |index: usize| posed(Generated::new(family, seed, first + index as u64, presence));
        let absent = if self.absent { " without the object" } else { "" };
        let name = format!("problems of family {}{absent}, seed {seed}", self.family);
        Ok(Box::new(ProblemSequence::new(name, self.frames as usize, generated, Vec::new())))
    }

    fn has_pixels(&self) -> bool {
        false
    }
}

/// A problem with its truth.
pub(super) fn posed(Generated { problem, truth }: Generated) -> Posed {
    let camera_from_object =
        Transform::<Camera, Object>::from_rows(&truth.t_cam_obj).expect("the generator writes a rigid motion");
    let rule = Solved { ideal_rms: truth.ideal_tre_rms, putative: problem.putative.is_some() };
    let pairs = truth.pairs.iter().map(|&[model, cloud]| (model, cloud)).collect();
    Posed {
        problem: Arc::new(problem.problem()),
        truth: Some((camera_from_object.inverse(), TrueAnswer { pairs, rule })),
    }
}
