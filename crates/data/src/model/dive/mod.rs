//! Object models from the marks of an operator in the pairs of a dive.
//!
//! One mark of a feature in any one pair suffices. An odometry predicts every feature into every pair that may show it;
//! there it is located as a corner, or aligned to the mark's surroundings, and tested against its expectation. One
//! adjustment then determines all poses and points. Better points are expected more exactly, so search and adjustment
//! repeat until no new observation is found. Observations that contradict the others are given up, with the reason.

mod best_views;
mod built;
mod contradictions;
mod edge_track;
mod edge_view;
mod edges;
mod expect;
mod find;
mod finish;
mod gather;
mod halves;
mod marks;
mod method;
mod operator;
mod parallax;
mod picture;
mod progress;
mod propose;
mod recover;
mod relocate;
mod settle;
mod start;
mod template;
mod trail;

pub use built::{DiveEdge, DiveModel, DivePoint};
pub use marks::DiveMark;
pub use method::ModelFromDive;
pub use operator::SimulatedOperator;
pub use picture::Picture;
pub use propose::{Proposal, Proposer};
