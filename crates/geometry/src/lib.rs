//! Typed coordinate frames, rigid transforms, covariances, cameras, stereo rigs and triangulation.
//!
//! # Conventions
//!
//! - Column vectors: `p_a = a_from_b * p_b`. Adjacent names cancel:
//!   `object_from_body = object_from_camera * camera_from_body`. Frames are types, so a product
//!   whose names do not cancel does not compile:
//!
//!   ```compile_fail
//!   use seafix_geometry::{Camera, Object, Transform, World};
//!   let object_from_camera = Transform::<Object, Camera>::identity();
//!   let object_from_world = Transform::<Object, World>::identity();
//!   let nonsense = object_from_camera * object_from_world; // Camera and World do not cancel
//!   ```
//! - The paper's row vectors, `p · H`, occur in [`row_vector`] only.
//! - Units are metres, radians and pixels. The centre of the first pixel is (0, 0).
//! - Perturbations: `T_true = T_estimate · Exp(ξ)`, ξ = (φ, ρ), rotation first; for
//!   `object_from_camera` ξ is expressed in the camera frame ([`Covariance6`]).
//! - Elementary functions come from `libm`: results are identical on every platform.

mod closed_form;
mod covariance;
mod distortion;
mod frame;
mod jacobian;
mod measured;
mod pinhole;
pub mod row_vector;
mod segment;
pub mod so3;
mod stereo;
mod transform;
mod triad;

pub use covariance::{Covariance6, UncertainPoint};
pub use distortion::{Distortion, LensModel};
pub use frame::{Body, Camera, Frame, Object, Point, RightCamera, Site, World};
pub use jacobian::right_jacobian_inverse;
pub use measured::{MeasuredPoint, UncertainPixels};
pub use pinhole::{BadCamera, Pinhole, Pixel};
pub use segment::{MeasuredLine, NormalOffset, StereoSegments, UncertainSegment, across};
pub use stereo::{BadRig, StereoPixels, StereoRig, Triangulation, Untriangulable};
pub use transform::{NotRigid, Transform};
pub use triad::{Collinear, triad};
