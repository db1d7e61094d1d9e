//! The laws, one module for each theme.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and print its measurements")]

mod a_contrario;
mod ablation;
mod acceptance;
mod answers;
mod association;
mod between_fixes;
mod clutter_patterns;
mod complete;
mod consensus;
mod dead_reckoning;
mod equal_poses;
mod equations;
mod frames;
mod gates;
mod integrity;
mod jacobians;
mod leverage;
mod limits;
mod navigation;
mod search_inputs;
mod search_proofs;
mod search_symmetries;
mod searches;
mod self_symmetry;
mod solvers;
mod statistics;
mod stereo;
mod surfaces;
mod trajectories;
mod transforms;
mod vocabulary;
