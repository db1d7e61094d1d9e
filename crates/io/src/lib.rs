//! Bounded readers of images, stereo rigs and data set descriptions.
//!
//! Every reader compares the sizes that a file declares with limits before it allocates memory. A file that cannot be
//! read is one [`Fault`](seafix_component::Fault) with file, line, value and remedy.
//!
//! ```
//! # fn main() -> Result<(), seafix_component::Fault> {
//! let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/virtual-sample");
//! let rig = seafix_io::Rig::from_file(folder)?;
//! println!("baseline {:.3} m", rig.stereo.baseline());
//!
//! let error = seafix_io::Rig::from_file("missing.toml").unwrap_err();
//! assert!(error.to_string().contains("missing.toml"));
//! # Ok(())
//! # }
//! ```

mod bounded_yaml;
pub mod calibration;
pub mod dataset;
pub mod image;
mod rig;
mod units;
pub mod yaml;

pub use image::{ImageLimits, read_image};
pub use rig::Rig;
pub use units::{doubtful_baseline, unit_fault};
