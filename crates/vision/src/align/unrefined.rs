//! No refinement.

use seafix_component::{Component, Settings};
use seafix_geometry::{StereoRig, UncertainPixels};
use serde::{Deserialize, Serialize};

use super::refinement::{Refinement, apart};
use crate::{image::Image, locate::Pair, workspace::Workspace};

/// No refinement: keeps the pixels of detector, locator and matcher.
///
/// Their errors are independent: a fitted corner has the covariance of its fit, any other key point the `sigma-px` of
/// the triangulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Unrefined {}

impl Component for Unrefined {
    const NAME: &'static str = "none";
    const SUMMARY: &'static str = "no refinement: keeps each match, with independent errors";
    const SOURCE: &'static str = "common usage";
}

impl Refinement for Unrefined {
    fn refine_into(
        &self,
        pairs: &[Pair],
        _: &Image,
        _: &Image,
        _: &StereoRig,
        _: &mut Workspace,
        pixels: &mut Vec<UncertainPixels>,
    ) {
        pixels.clear();
        pixels.extend(pairs.iter().map(apart));
    }
}
