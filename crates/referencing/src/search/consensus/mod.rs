//! The parts of [`RigidConsensus`](super::RigidConsensus).

mod bits;
mod bound;
mod bunching;
mod crowd;
mod filled;
mod fit;
mod graph;
mod imitation;
mod labels;
mod least;
mod likelihood;
mod mirror;
mod modes;
mod motion;
mod pattern;
mod proof;
mod rough;
mod seeds;
mod six;
mod strain;
mod visible;

pub(super) use crowd::Crowd;
pub(super) use graph::Graph;
pub use imitation::Imitation;
pub(super) use imitation::Occupied;
pub(super) use likelihood::{Mode, Terms};
pub(super) use mirror::mirror_image;
pub(super) use motion::Motion;
pub use pattern::LookAlike;
pub(super) use pattern::Pattern;
pub(super) use proof::{Proved, prove};
pub(super) use rough::Rough;
pub(super) use seeds::{Seeds, Swept};
