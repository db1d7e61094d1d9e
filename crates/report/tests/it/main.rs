//! Tests of reports on synthetic runs with known results.

#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod answers;
mod breakdown;
mod browser;
mod compared;
mod dives;
mod growth;
mod harmless;
mod integrity;
mod made_up;
mod objects;
mod paper;
mod probability;
mod reach;
mod rows;
mod sentences;
mod verified;
mod written;
