//! Properties of the components of seafix-vision.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

mod allocations;
mod descriptors;
mod detectors;
mod edge_corners;
mod filters;
mod front_end;
mod lines;
mod locators;
mod matchers;
mod outline_corners;
mod scenes;
mod segments;
mod settings;
