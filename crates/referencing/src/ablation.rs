//! The mechanisms that an ablation study can leave out.

use seafix_component::Settings;
use serde::{Deserialize, Serialize};

/// A mechanism of [`RigidConsensus`](crate::RigidConsensus) that an ablation study can leave out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum SearchMechanism {
    /// The density of clutter about the predicted places of all model points.
    ClumpedClutter,
    /// The densities of clutter on lines and in clumps, which the frame's own points determine.
    LocalDensity,
    /// The higher density at the centre of a clump.
    ClumpPeak,
    /// The frequency of points measured twice.
    Duplicates,
    /// The sum over all candidates near a model point; the identified candidate alone counts.
    AllCandidates,
    /// The sum over the subsets of a pose's pairs; all pairs are the object's.
    Subsets,
    /// The continuation of a pattern that the object repeats, and its shifts.
    Pattern,
    /// The search for shifts of the object within its pattern.
    PatternShifts,
    /// The mirror image of the object as an alternative.
    Mirror,
    /// The search for a second copy, complete or partial, in the rest of the cloud.
    SecondCopies,
    /// The search for poses elsewhere that show clutter which resembles the object.
    StructuredClutter,
    /// The poses that put the model onto the same places in another order.
    Mislabelled,
    /// Another structure of the object's kind.
    Resembling,
    /// The support by independent pairs of a large putative set.
    IndependentPairs,
}

impl SearchMechanism {
    /// All mechanisms.
    pub const ALL: [Self; 14] = [
        Self::ClumpedClutter,
        Self::LocalDensity,
        Self::ClumpPeak,
        Self::Duplicates,
        Self::AllCandidates,
        Self::Subsets,
        Self::Pattern,
        Self::PatternShifts,
        Self::Mirror,
        Self::SecondCopies,
        Self::StructuredClutter,
        Self::Mislabelled,
        Self::Resembling,
        Self::IndependentPairs,
    ];
}

/// A test of the [`Acceptance`](crate::Acceptance) that an ablation study can leave out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum AcceptanceTest {
    /// The number of false alarms as a bound of the posterior.
    Nfa,
    /// The number of permuted partners at the pose as a bound of the posterior.
    PermutedPartners,
    /// The probability that fewer points than determine a pose are visible.
    FewVisible,
    /// A second copy of the object, which makes an answer ambiguous.
    SecondCopies,
    /// Other assignments of the measured points by self-symmetry of the model.
    SelfSymmetry,
    /// The exclusion of outliers from sets that fail the test of residuals.
    Exclusion,
    /// The test of residuals (χ²).
    Residuals,
    /// The test of the pose against the prior.
    Prior,
    /// The test that the camera sees the identified points from their visible sides.
    Visibility,
    /// The probability that the pose depends on a wrong match, or the test that it depends on no single point.
    InfluentialPairs,
    /// The test of the scale.
    Scale,
    /// The test of consistency between the parts of the object.
    Consistency,
    /// The covariance of the data association.
    Association,
}

impl AcceptanceTest {
    /// All tests.
    pub const ALL: [Self; 13] = [
        Self::Nfa,
        Self::PermutedPartners,
        Self::FewVisible,
        Self::SecondCopies,
        Self::SelfSymmetry,
        Self::Exclusion,
        Self::Residuals,
        Self::Prior,
        Self::Visibility,
        Self::InfluentialPairs,
        Self::Scale,
        Self::Consistency,
        Self::Association,
    ];
}
