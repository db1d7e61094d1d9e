//! Properties of simulated dives and images.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its measurements")]

mod bytes;
mod corners;
mod dives;
mod factors;
mod settings;
