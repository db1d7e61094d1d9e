//! The methods of triangulation.

use seafix_component::{Component, Settings};
use seafix_geometry::{StereoRig, Triangulation, UncertainPixels, Untriangulable};
use serde::{Deserialize, Serialize};

use super::{rules::PointRules, triangulator::Triangulator};

/// Defines a triangulator by one of the rig's methods.
macro_rules! triangulator {
    ($(#[$doc:meta])* $name:ident, $kebab:literal, $method:ident, $summary:literal, $source:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
        #[serde(transparent)]
        pub struct $name(pub PointRules);

        impl Component for $name {
            const NAME: &'static str = $kebab;
            const SUMMARY: &'static str = $summary;
            const SOURCE: &'static str = $source;

            fn check(&self) -> Result<(), String> {
                self.0.check()
            }
        }

        impl Triangulator for $name {
            fn rules(&self) -> &PointRules {
                &self.0
            }

            fn point(&self, rig: &StereoRig, seen: &UncertainPixels) -> Result<Triangulation, Untriangulable> {
                rig.$method(seen)
            }
        }
    };
}

triangulator!(
    /// The maximum-likelihood point, whose projections are nearest to the pixels under their joint covariance.
    Optimal,
    "optimal",
    triangulate,
    "the maximum-likelihood point under the joint covariance of its two pixels",
    "Hartley and Sturm, Triangulation, CVIU 1997"
);

triangulator!(
    /// The midpoint of the shortest segment between the two rays.
    ///
    /// It needs no covariance for the point; its error grows if the depths of the two cameras differ.
    Midpoint,
    "midpoint",
    triangulate_midpoint,
    "the midpoint of the shortest segment between the two rays",
    "Beardsley, Zisserman, Murray, Sequential updating of projective and affine structure from motion, IJCV 1997"
);

triangulator!(
    /// The linear least-squares solution of the four equations u (p₃ · X) = p₁ · X, one for each coordinate.
    ///
    /// Limit: the algebraic error that it minimises has no meaning in the images.
    Linear,
    "linear",
    triangulate_linear,
    "linear least squares of the four projection equations of the point",
    "Hartley and Sturm, Triangulation, CVIU 1997"
);
