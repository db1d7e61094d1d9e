//! What there is to compare with.
//!
//! Bobkov, Kudryashov, Inzartsev: *Method for the Coordination of Referencing of Autonomous Underwater
//! Vehicles to Man-Made Objects Using Stereo Images*, J. Mar. Sci. Eng. 2021, 9(9), 1038.

/// The paper's residual C·H − P in its virtual scene, direct referencing with three points, 2–5 m: least
/// and largest (m).
pub const PAPER_FIT_RMS: [f64; 2] = [0.016, 0.040];

/// How the reference is cited.
pub(crate) const CITATION: &str = "Bobkov, Kudryashov, Inzartsev, J. Mar. Sci. Eng. 2021, 9(9), 1038";
