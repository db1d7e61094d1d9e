//! What the benches share: the peers, the images, how they are seen from elsewhere.

#![allow(dead_code, reason = "each bench uses its part")]

pub(crate) mod features;
pub(crate) mod peer;
pub(crate) mod scene;
pub(crate) mod stages;
