//! Laws that every component of Seafix obeys.
//!
//! `src/` holds what the laws draw from and compare with: one idea a file, nothing that is tested.
//! `tests/it/` holds the laws, one file a theme; a law's name states it, its doc comment gives the number
//! and the statement. Laws over searches and solvers run over the registries by name, with the
//! defaults and with every value of every switch, so that a component listed tomorrow is tested
//! tomorrow.
//!
//! ```text
//! cargo test -p seafix-proptests                                    # the short suite
//! PROPTEST_CASES=20000 cargo test --release -p seafix-proptests     # the long proof
//! PROPTEST_RNG_SEED=7 cargo test -p seafix-proptests                # other draws
//! ```
//!
//! [`cases`] says how many cases a law has: few by default, as many as `PROPTEST_CASES` asks for in the long proof. Seeds are
//! fixed, so every run draws the same cases; what failed once is kept in `proptest-regressions/` and tried first ever after.

pub mod admissible;
pub mod clutter_patterns;
pub mod graphs;
mod law;
pub mod least_squares;
pub mod monte_carlo;
pub mod navigation_scenario;
pub mod orders;
pub mod points;
pub mod poses;
pub mod problems;
pub mod rigs;
pub mod scenes;
pub mod searches;
pub mod variants;
pub mod views;

pub use law::{cases, distinctive, law, not_idle, within};
