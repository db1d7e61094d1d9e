//! Reports on runs whose results are known.

#![allow(clippy::unwrap_used, reason = "a test may stop at once, and says what it measured")]

mod breakdown;
mod browser;
mod compared;
mod growth;
mod harmless;
mod integrity;
mod made_up;
mod objects;
mod paper;
mod reach;
mod rows;
mod verified;
