//! The figures of the paper, for comparison.
//!
//! Bobkov, Kudryashov, Inzartsev: *Method for the Coordination of Referencing of Autonomous Underwater
//! Vehicles to Man-Made Objects Using Stereo Images*, J. Mar. Sci. Eng. 2021, 9(9), 1038.

/// The range of the paper's fit RMS (m): virtual scene, direct fixes with three points, 2–5 m.
pub const PAPER_FIT_RMS: [f64; 2] = [0.016, 0.040];

/// The citation of the paper.
pub(crate) const CITATION: &str = "Bobkov, Kudryashov, Inzartsev, J. Mar. Sci. Eng. 2021, 9(9), 1038";
