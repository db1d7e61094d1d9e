//! Mutated inputs for every parser of foreign bytes.
//!
//! A [`Parser`] reads one file of a small committed corpus after [`mutated`] has changed it. The law of all parsers: an
//! input is read or rejected with a message, without a panic, in memory and time that its size bounds.
//!
//! `cargo run --release -p seafix-fuzz -- --seconds 600` mutates for ten minutes a parser; `… NAME…` chooses parsers, and
//! `--mutations 200000` ends by number. `cargo test -p seafix-fuzz` runs a few hundred, by `bolero`, so that its engines
//! for coverage can be used as well.

mod corpus;
mod mutate;
mod parsers;

pub use corpus::{corpus, rewrite_logs, small_log};
pub use mutate::mutated;
pub use parsers::{PARSERS, Parser};
