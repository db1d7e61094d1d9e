//! `coherence-problem/1`: one identification problem as a file, and the answer to it.

mod answer;
mod input;
mod json;
#[cfg(test)]
mod tests;
mod warnings;

pub use answer::{Answer, Estimate, Levels, Line, Method, OtherPose, Support, answer, solve_file};
pub use input::{CoherenceProblem, FORMAT, read};
