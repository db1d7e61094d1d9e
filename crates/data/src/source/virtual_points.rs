//! The virtual dive as clouds of points.

use std::path::Path;

use seafix_component::{Component, Fault, Settings};
use seafix_simulation::Dive;
use serde::{Deserialize, Serialize};

use super::virtual_dive::open;
use crate::sequence::{Sequence, Source};

/// The dive of `virtual-images` as clouds of noisy points, without rendering or processing of images.
#[derive(Debug, Clone, Default, Serialize, Deserialize, Settings)]
#[serde(transparent)]
pub struct VirtualPoints(pub Dive);

impl Component for VirtualPoints {
    const NAME: &'static str = "virtual-points";
    const SUMMARY: &'static str = "the same dive as noisy points and clutter, without images";
    const SOURCE: &'static str = "scene of Bobkov, Kudryashov, Inzartsev 2021, Sec. 3.1";

    fn check(&self) -> Result<(), String> {
        self.0.check().map_err(|error| error.to_string())
    }
}

impl Source for VirtualPoints {
    fn open(&self, seed: u64, _folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        open(&self.0, seed, false)
    }
}
