//! `coherence-problem/1`: one identification problem as a file, and the answer to it.

mod answer;
mod diagnosis;
mod duplicates;
mod input;
mod json;
mod method;
mod parts;
#[cfg(test)]
mod tests;
mod warnings;

pub use answer::{Answer, Best, Estimate, Levels, Line, OtherPose, Support, answer, printed, solve_file};
pub use input::{CoherenceProblem, read};
pub use json::FORMAT;
pub use method::Method;
pub use parts::{InvalidPart, Noise, Parts};
