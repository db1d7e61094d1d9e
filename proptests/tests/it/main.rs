//! The laws, one theme a module.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may stop at once, and says what it measured")]

mod acceptance;
mod answers;
mod between_fixes;
mod chance;
mod complete;
mod consensus;
mod dead_reckoning;
mod equations;
mod frames;
mod imitations;
mod integrity;
mod jacobians;
mod leverage;
mod limits;
mod navigation;
mod search_inputs;
mod search_proofs;
mod search_symmetries;
mod searches;
mod shells;
mod solvers;
mod statistics;
mod stereo;
mod surfaces;
mod trajectories;
mod transforms;
mod twins;
