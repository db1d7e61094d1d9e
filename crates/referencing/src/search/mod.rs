//! Searches for the correspondences between model points and cloud points.

use seafix_component::{Registry, entry};

mod affinity;
mod alike;
mod association;
mod backtracking;
mod bitset;
mod clique;
mod closest;
mod complete_enumeration;
pub(crate) mod consensus;
mod directed_edge;
mod edges;
pub(crate) mod feature_pose;
pub(crate) mod feature_sets;
pub(crate) mod features;
mod gicp;
mod gnc_tls;
pub(crate) mod grow;
mod handedness;
mod hypotheses;
mod icp;
pub(crate) mod identification;
mod interpretation_tree;
mod joint_compatibility;
mod k_core_gnc;
pub(crate) mod limits;
mod local;
mod mac;
mod magsac;
pub(crate) mod maximum_clique;
mod maximum_clique_edges;
mod orientation;
pub(crate) mod pose;
mod pose_vote;
pub(crate) mod posterior;
mod quadruples;
mod ransac;
mod ransac_edges;
pub(crate) mod rigid_consensus;
mod sc2_pcr;
mod second_order;
mod spectral;
mod structural_coherence;
mod volumes;
mod weighted_clique;

pub use consensus::{InfluentialPairs, StructuredClutter, Support};
pub use identification::{Identification, Rejected, Search};
pub use maximum_clique::MaximumClique;
#[cfg(test)]
pub(crate) use orientation::mirrored;
pub use posterior::{Explanation, Posterior, PosteriorProbabilities};
pub use rigid_consensus::RigidConsensus;
pub use structural_coherence::{Samples, StructuralCoherence};

/// The registry of searches.
pub static SEARCHES: Registry<dyn Search> = Registry::new(
    "search",
    &[
        entry!(backtracking::Backtracking),
        entry!(complete_enumeration::CompleteEnumeration),
        entry!(gicp::Gicp),
        entry!(gnc_tls::GncTls),
        entry!(icp::Icp),
        entry!(interpretation_tree::InterpretationTree),
        entry!(joint_compatibility::JointCompatibility),
        entry!(k_core_gnc::KCoreGnc),
        entry!(mac::Mac),
        entry!(magsac::Magsac),
        entry!(MaximumClique),
        entry!(pose_vote::PoseVote),
        entry!(ransac::Ransac),
        entry!(RigidConsensus),
        entry!(sc2_pcr::Sc2Pcr),
        entry!(spectral::Spectral),
        entry!(StructuralCoherence),
        entry!(weighted_clique::WeightedClique),
    ],
);
