//! Object models from the marks of an operator: in one stereo pair, or in a dive.

mod adjust;
mod by_hand;
mod dive;
mod frame;
mod marks;

pub use adjust::CalibrationSigma;
pub use by_hand::{HandModel, HandPoint, ModelByHand};
pub use dive::{
    DiveEdge, DiveMark, DiveModel, DivePoint, ModelFromDive, Picture, Proposal, Proposer, SimulatedOperator,
};
pub use marks::Mark;
