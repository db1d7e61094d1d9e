//! Laws of every component of vision.

#![allow(clippy::unwrap_used, reason = "a test may stop at once, and says what it measured")]

mod allocations;
mod descriptors;
mod detectors;
mod filters;
mod front_end;
mod locators;
mod matchers;
mod scenes;
mod settings;
