//! Properties of simulated dives and images.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may stop at once, and says what it measured")]

mod bytes;
mod corners;
mod dives;
mod factors;
mod settings;
