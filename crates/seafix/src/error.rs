//! The error type of the library.

use seafix_component::Fault;

use crate::pipeline_error::PipelineError;

/// A request that cannot be carried out. A rejected fix is not an error but an [`Outcome`](crate::Outcome).
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read or has an invalid value.
    #[error("{0}")]
    File(Fault),
    /// A file with several faults.
    #[error("{}", lines(.0))]
    Files(Vec<Fault>),
    /// An invalid setting of the pipeline or the navigation.
    #[error("{0}")]
    Setting(#[from] PipelineError),
    /// Settings that are not valid TOML.
    #[error("cannot read the settings: {0}")]
    Settings(#[from] toml::de::Error),
    /// An image whose size differs from the calibration of its camera.
    #[error(
        "cannot use the {side} image of {width}×{height} px: its camera is calibrated for {expected_width}×{expected_height}; scale the calibration or give the original image"
    )]
    ImageSize {
        /// `left` or `right`.
        side: &'static str,
        /// Width of the image (px).
        width: usize,
        /// Height of the image (px).
        height: usize,
        /// Calibrated width (px).
        expected_width: u32,
        /// Calibrated height (px).
        expected_height: u32,
    },
    /// An object without a pose in the world where one is needed.
    #[error("cannot {purpose}: the object `{object}` has no pose in the world; add its `base_in_world` to the site")]
    NoWorld {
        /// The operation that needs the pose.
        purpose: &'static str,
        /// The object's name.
        object: String,
    },
    /// A frame that a navigation session cannot use.
    #[error("cannot use the frame at {stamp_ns} ns: {cause}")]
    Frame {
        /// Time of the frame (ns).
        stamp_ns: u64,
        /// The cause.
        cause: String,
    },
}

impl From<Fault> for Error {
    fn from(fault: Fault) -> Self {
        Self::File(fault)
    }
}

impl From<Vec<Fault>> for Error {
    fn from(faults: Vec<Fault>) -> Self {
        Self::Files(faults)
    }
}

fn lines(faults: &[Fault]) -> String {
    faults.iter().map(Fault::to_string).collect::<Vec<_>>().join("\n")
}
