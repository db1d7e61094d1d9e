//! Names of the frames.

/// Frame of the world: north, east, down.
pub(super) const WORLD: &str = "world";

/// Frame of the site.
pub(super) const SPS: &str = "sps";

/// The vehicle as estimated.
pub(super) const AUV: &str = "auv";

/// The left and the right camera of the estimated vehicle; images and clouds live there.
pub(super) const CAMERAS: [&str; 2] = ["camera_left", "camera_right"];

/// The vehicle as it really was.
pub(super) const AUV_TRUTH: &str = "auv_truth";

/// The vehicle as roughly known before.
pub(super) const AUV_PRIOR: &str = "auv_prior";

/// Frame of a target.
pub(super) fn object_frame(id: &str) -> String {
    format!("object/{id}")
}
