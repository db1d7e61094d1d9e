//! The virtual dive as rendered stereo pairs.

use std::path::Path;

use seafix_component::{Component, Fault, Settings};
use seafix_simulation::Dive;
use serde::{Deserialize, Serialize};

use super::virtual_dive::open;
use crate::sequence::{Sequence, Source};

/// A seeded dive over the virtual production system, rendered as stereo pairs.
#[derive(Debug, Clone, Default, Serialize, Deserialize, Settings)]
#[serde(transparent)]
pub struct VirtualImages(pub Dive);

impl Component for VirtualImages {
    const NAME: &'static str = "virtual-images";
    const SUMMARY: &'static str = "a seeded dive over the virtual site, rendered as stereo pairs";
    const SOURCE: &'static str = "scene of Bobkov, Kudryashov, Inzartsev 2021, Sec. 3.1";

    fn check(&self) -> Result<(), String> {
        self.0.check().map_err(|error| error.to_string())
    }
}

impl Source for VirtualImages {
    fn open(&self, seed: u64, _folder: &Path) -> Result<Box<dyn Sequence>, Vec<Fault>> {
        open(&self.0, seed, true)
    }
}
