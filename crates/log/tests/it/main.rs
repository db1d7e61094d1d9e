//! Logs written, read, joined and recovered.

#![allow(clippy::unwrap_used, reason = "a test may stop at once, and says what it measured")]

mod damage;
mod descriptors;
mod generated;
mod join;
mod recover;
mod round_trip;
mod synthetic;
mod viewers;
