//! Laws of all components of Seafix.
//!
//! `src/` holds the strategies and references of the laws: one idea a file, nothing that is tested; and the
//! laws of [solvers](solver_laws) and [searches](search_laws), which other programs run on a component of their own. `tests/it/` holds the laws, one
//! file for each theme; a law's name states it, its doc comment gives number and statement. Laws of
//! searches and solvers run over the registries by name, with the defaults and with every value of every switch, so
//! that a new component is tested as soon as it is listed.
//!
//! ```text
//! cargo test -p seafix-proptests                                    # the short suite
//! PROPTEST_CASES=20000 cargo test --release -p seafix-proptests     # the long proof
//! PROPTEST_RNG_SEED=7 cargo test -p seafix-proptests                # other draws
//! ```
//!
//! [`cases`] gives the number of cases of a law: few by default, more with `PROPTEST_CASES` in the long proof. Seeds
//! are fixed, so that every run draws the same cases. Failed cases are kept in `proptest-regressions/` and tested
//! first.

pub mod admissible;
pub mod bent;
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
pub mod search_laws;
pub mod searches;
pub mod solver_laws;
pub mod variants;
pub mod views;

pub use law::{cases, distinctive, law, not_idle, within};
