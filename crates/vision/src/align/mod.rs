//! Refinement of matched places between the two images.

mod covariance;
mod direct;
mod follow;
mod inverse_compositional;
mod lanes;
mod local;
mod spline;
mod unrefined;
mod warp;
mod window;
mod zncc_parabola;

use nalgebra::{Matrix2, Matrix4};
use seafix_component::{Choice, Component, Registry, entry};
use seafix_geometry::{StereoPixels, StereoRig, UncertainPixels};
use serde::{Deserialize, Deserializer, Serialize};

use crate::{Image, Pair, UncertainPixel, Workspace};
pub use direct::Direct;
pub use follow::Expected;
pub(crate) use inverse_compositional::{Aligned, Aligner, Rules};
pub use unrefined::Unrefined;
pub(crate) use warp::Translation;
pub use warp::Warp;
pub use window::Weight;
pub use zncc_parabola::ZnccParabola;

/// Says more exactly where the right image shows the left place of each match, and how well that is known.
///
/// Both detectors err; the error of the disparity is what the depth suffers from.
pub trait Refinement: Send + Sync + std::fmt::Debug {
    /// Replaces `pixels` by the refined places of `pairs`, in their order, with their joint covariance; those that are
    /// left out are missing.
    fn refine_into(
        &self,
        pairs: &[Pair],
        left: &Image,
        right: &Image,
        rig: &StereoRig,
        work: &mut Workspace,
        pixels: &mut Vec<UncertainPixels>,
    );

    /// The refined places of `pairs`, in their order.
    fn refine(&self, pairs: &[Pair], left: &Image, right: &Image, rig: &StereoRig) -> Vec<UncertainPixels> {
        let mut pixels = Vec::new();
        self.refine_into(pairs, left, right, rig, &mut Workspace::default(), &mut pixels);
        pixels
    }
}

/// All refinements.
pub static REFINEMENTS: Registry<dyn Refinement> =
    Registry::new("refinement", &[entry!(Direct), entry!(Unrefined), entry!(ZnccParabola)]);

/// Reads the choice of a refinement; settings without a name are those of `direct`.
///
/// # Errors
/// What is neither a name nor a table.
pub fn read_refinement<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Choice, D::Error> {
    Choice::deserialize_or(deserializer, Direct::NAME)
}

/// What becomes of a pair that could not be aligned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unaligned {
    /// The detectors' places stay.
    Keep,
    /// It is left out.
    #[default]
    Drop,
}

/// Two places found each for itself.
fn apart(pair: &Pair) -> UncertainPixels {
    let mut covariance = Matrix4::zeros();
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&pair.left.covariance);
    covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&pair.right.covariance);
    UncertainPixels { at: StereoPixels { left: pair.left.at, right: pair.right.at }, covariance }
}

/// A place found in the left image and aligned to the right one, which errs with it: `right` is known so well relative to
/// the left place, and moves by `shape` when that does.
fn together(left: &UncertainPixel, right: &UncertainPixel, shape: &Matrix2<f64>) -> UncertainPixels {
    let place = left.covariance;
    let across = place * shape.transpose();
    let mut covariance = Matrix4::zeros();
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place);
    covariance.fixed_view_mut::<2, 2>(0, 2).copy_from(&across);
    covariance.fixed_view_mut::<2, 2>(2, 0).copy_from(&across.transpose());
    covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&(shape * across + right.covariance));
    UncertainPixels { at: StereoPixels { left: left.at, right: right.at }, covariance }
}
