//! The components of [`RigidConsensus`](super::RigidConsensus): terms of the likelihood, branch and bound, proof.

mod bits;
mod bound;
mod clumped_clutter;
mod clutter_density;
mod distance_residual;
mod fit;
mod graph;
mod labels;
mod likelihood;
mod local_maxima;
mod lower_bound;
mod mirror;
mod motion;
mod posterior_volume;
mod prior_terms;
mod proof;
mod repeated_pattern;
mod seeds;
mod solve6;
mod structured_clutter;
mod visible;

pub(super) use clutter_density::ClutterDensity;
pub(super) use graph::ConsistencyGraph;
pub(super) use likelihood::{Mode, Terms};
pub(super) use mirror::mirror_image;
pub(super) use motion::Motion;
pub(super) use prior_terms::PriorTerms;
pub(super) use proof::{Proved, prove};
pub(super) use repeated_pattern::Pattern;
pub use repeated_pattern::RepeatedPattern;
pub(super) use seeds::{Seeds, Swept};
pub(super) use structured_clutter::Occupied;
pub use structured_clutter::StructuredClutter;
