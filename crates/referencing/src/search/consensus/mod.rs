//! The components of [`RigidConsensus`](super::RigidConsensus): terms of the likelihood, branch and bound, proof.

pub(crate) mod bits;
mod bound;
mod clumped_clutter;
pub(crate) mod clutter_density;
mod distance_residual;
pub(crate) mod edge_nfa;
pub(crate) mod edge_seeds;
pub(crate) mod edge_terms;
pub(crate) mod edge_votes;
mod fit;
mod fractions;
mod gaussian;
pub(crate) mod graph;
pub(crate) mod joined;
mod labels;
pub(crate) mod likelihood;
mod line_density;
pub(crate) mod local_maxima;
mod lower_bound;
pub(crate) mod mirror;
pub(crate) mod motion;
mod pattern_edges;
mod pattern_shifts;
mod places;
mod posterior_volume;
pub(crate) mod prior_terms;
pub(crate) mod proof;
pub(crate) mod repeated_pattern;
pub(crate) mod seeds;
mod solve6;
pub(crate) mod structured_clutter;
pub(crate) mod support;
mod visible;

pub use structured_clutter::StructuredClutter;
pub use support::Support;
