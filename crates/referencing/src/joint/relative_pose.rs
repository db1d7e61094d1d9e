//! The pose of an object relative to another.

use seafix_geometry::{Camera, Covariance6, Object, Transform};

/// The camera's pose relative to an object, with its covariance.
pub type RelativePose = (Transform<Object, Camera>, Covariance6<Object, Camera>);
