//! Reports on runs whose results are known.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod breakdown;
mod browser;
mod compared;
mod harmless;
mod integrity;
mod made_up;
mod objects;
mod paper;
mod reach;
mod verified;
