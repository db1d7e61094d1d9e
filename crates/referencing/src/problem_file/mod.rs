//! `coherence-problem/1`: one identification problem as a file, and the answer to it. `/1.1` adds straight edges.

mod answer;
mod diagnosis;
mod duplicates;
mod edge_warnings;
mod edges;
mod input;
mod invalid_part;
mod json;
mod method;
mod parts;
#[cfg(test)]
mod tests;
mod warnings;

pub use answer::{Answer, Best, Estimate, Levels, Line, OtherPose, Support, answer, printed, solve_file};
pub use edges::{EdgeParts, ProblemEdges, RawEnd, RawLine};
pub use input::{CoherenceProblem, read};
pub use invalid_part::InvalidPart;
pub use json::{FORMAT, FORMAT_WITH_EDGES};
pub use method::Method;
pub use parts::{Noise, Parts};
