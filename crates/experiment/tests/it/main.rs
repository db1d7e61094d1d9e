//! Experiments from file to result.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may stop at once, and prints its measurements")]

mod costs;
mod edges;
mod foreign;
mod located;
mod logging_cost;
mod pose_graph;
mod problems;
mod replay;
mod run;
mod supported;
mod versions;
