//! Detectors of key points.

mod corners;
mod detector;
mod dog;
mod extrema;
mod fast;
mod fitted;
mod guided;
mod harris;
mod hessian;
mod integral;
mod peaks;
mod select;
mod shi_tomasi;
mod strip;
mod surf;
mod tensor;

pub use crate::keypoint::Keypoint;
pub use detector::Detector;
pub use dog::Dog;
pub use fast::Fast;
pub use fitted::{FittedCorners, LCorners, XCorners};
pub use guided::GuidedCorners;
pub use harris::Harris;
pub(crate) use peaks::vertex;
use seafix_component::{Registry, entry};
pub use select::Selection;
pub use shi_tomasi::ShiTomasi;
pub use surf::FastHessian;
pub use tensor::Window;

/// The registry of detectors.
pub static DETECTORS: Registry<dyn Detector> = Registry::new(
    "detector",
    &[
        entry!(Dog),
        entry!(Fast),
        entry!(GuidedCorners),
        entry!(Harris),
        entry!(LCorners),
        entry!(ShiTomasi),
        entry!(FastHessian),
        entry!(XCorners),
    ],
);
