//! The ways from two pixels to a point.

use seafix_component::Component;
use seafix_geometry::{StereoRig, Triangulation, UncertainPixels, Untriangulable};
use serde::{Deserialize, Serialize};

use super::{PointRules, Triangulator};

/// A triangulator by one of the rig's methods.
macro_rules! triangulator {
    ($(#[$doc:meta])* $name:ident, $kebab:literal, $method:ident, $summary:literal, $source:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
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
    /// The likeliest point: that whose two projections are nearest to the pixels, measured by their joint covariance.
    Optimal,
    "optimal",
    triangulate,
    "the likeliest point, by the joint covariance of its two pixels",
    "Hartley and Sturm, Triangulation, CVIU 1997"
);

triangulator!(
    /// The point halfway between the two rays where they come closest. It asks no covariance for the point, and errs
    /// with the depths of the two cameras where they differ.
    Midpoint,
    "midpoint",
    triangulate_midpoint,
    "halfway between the two rays where they come closest",
    "Beardsley, Zisserman, Murray, Sequential updating of projective and affine structure from motion, IJCV 1997"
);

triangulator!(
    /// The least-squares solution of the four equations that are linear in the point: u (p₃ · X) = p₁ · X for each
    /// coordinate. What it makes small has no meaning in the images.
    Linear,
    "linear",
    triangulate_linear,
    "least squares of the four equations linear in the point",
    "Hartley and Sturm, Triangulation, CVIU 1997"
);
