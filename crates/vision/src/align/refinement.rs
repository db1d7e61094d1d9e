//! Refinements of a match between the cameras.

use nalgebra::{Matrix2, Matrix4};
use seafix_component::Settings;
use seafix_geometry::{StereoPixels, StereoRig, UncertainPixels};
use serde::{Deserialize, Serialize};

use crate::{
    image::Image,
    locate::{Pair, UncertainPixel},
    workspace::Workspace,
};

/// A refinement: aligns the right pixel of each match to the left one and determines their covariance.
///
/// Detection errors are independent in the two images; the refinement removes them from the disparity, hence from the
/// depth.
///
/// ```
/// # use nalgebra::{UnitQuaternion, Vector3};
/// # use seafix_geometry::{Pinhole, Transform};
/// use seafix_geometry::{Pixel, StereoPixels, StereoRig, UncertainPixels};
/// use seafix_vision::{Image, Pair, Refinement, UncertainPixel, Workspace};
///
/// /// Accepts each pair unchanged, with independent errors of 0.2 px.
/// #[derive(Debug)]
/// struct Unchanged;
///
/// impl Refinement for Unchanged {
///     fn refine_into(
///         &self,
///         pairs: &[Pair],
///         _: &Image,
///         _: &Image,
///         _: &StereoRig,
///         _: &mut Workspace,
///         pixels: &mut Vec<UncertainPixels>,
///     ) {
///         pixels.clear();
///         pixels.extend(pairs.iter().map(|pair| {
///             let at = StereoPixels { left: pair.left.at, right: pair.right.at };
///             UncertainPixels::independent(at, 0.2)
///         }));
///     }
/// }
///
/// # let camera = Pinhole::new([1024, 768], [500.0, 500.0], [511.5, 383.5], &[]).unwrap();
/// # let right_from_left = Transform::new(UnitQuaternion::identity(), Vector3::new(-0.25, 0.0, 0.0));
/// # let rig = StereoRig::new(camera, camera, right_from_left).unwrap();
/// let image = Image::new(1024, 768, vec![0.0; 1024 * 768]).unwrap();
/// let pixel = |u| UncertainPixel::independent(Pixel { u, v: 300.0 }, 0.5);
/// let pair = Pair { left: pixel(500.0), right: pixel(460.0) };
/// let refined = Unchanged.refine(&[pair], &image, &image, &rig);
/// assert_eq!(refined[0].at.right, Pixel { u: 460.0, v: 300.0 });
/// ```
pub trait Refinement: Send + Sync + std::fmt::Debug {
    /// Replaces `pixels` by the refined pixels of `pairs`, in their order, with their joint covariance; rejected pairs
    /// are missing.
    fn refine_into(
        &self,
        pairs: &[Pair],
        left: &Image,
        right: &Image,
        rig: &StereoRig,
        work: &mut Workspace,
        pixels: &mut Vec<UncertainPixels>,
    );

    /// The refined pixels of the accepted `pairs`, in their order.
    fn refine(&self, pairs: &[Pair], left: &Image, right: &Image, rig: &StereoRig) -> Vec<UncertainPixels> {
        let mut pixels = Vec::new();
        self.refine_into(pairs, left, right, rig, &mut Workspace::default(), &mut pixels);
        pixels
    }
}

/// Treatment of a pair whose alignment fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Unaligned {
    /// The pair keeps the positions of detector and locator.
    Keep,
    /// The pair is rejected.
    #[default]
    Drop,
}

/// The joint covariance of two independently detected pixels.
pub(super) fn apart(pair: &Pair) -> UncertainPixels {
    let mut covariance = Matrix4::zeros();
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&pair.left.covariance);
    covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&pair.right.covariance);
    UncertainPixels { at: StereoPixels { left: pair.left.at, right: pair.right.at }, covariance }
}

/// The joint covariance of a left pixel and the right pixel that is aligned to it.
///
/// `right` holds the covariance given the left pixel; `shape` is the derivative of the right pixel by the left one.
pub(super) fn together(left: &UncertainPixel, right: &UncertainPixel, shape: &Matrix2<f64>) -> UncertainPixels {
    let place = left.covariance;
    let across = place * shape.transpose();
    let mut covariance = Matrix4::zeros();
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place);
    covariance.fixed_view_mut::<2, 2>(0, 2).copy_from(&across);
    covariance.fixed_view_mut::<2, 2>(2, 0).copy_from(&across.transpose());
    covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&(shape * across + right.covariance));
    UncertainPixels { at: StereoPixels { left: left.at, right: right.at }, covariance }
}
