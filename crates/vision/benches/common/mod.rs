//! The parts common to the benches: peers, scenes, scores.

#![allow(dead_code, reason = "each bench uses a part of this module")]

pub(crate) mod features;
pub(crate) mod peer;
pub(crate) mod scene;
pub(crate) mod stages;
