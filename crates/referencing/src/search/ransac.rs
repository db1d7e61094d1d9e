//! RANSAC: poses of random triples.

use rand::{Rng, RngExt};
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    association::vertices,
    grow::{conclude_within, feasible, max_possible, so_far},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, NEEDED, bounded},
    pose::{fitted, fraction, refined},
    ransac_edges,
};
use crate::problem::{Correspondence, Problem};

/// RANSAC (Fischler and Bolles 1981) with the truncated score of MSAC.
///
/// Maximises Σ (1 − r²)₊ over the poses of random triples of candidate pairs; r is the residual of each model point's
/// best candidate as a fraction of its tolerance. A triple must be coherent (edge-length check) before its pose is
/// computed.
///
/// Not exact. Triples are sampled until one of true pairs was among them with the probability `confidence`, according
/// to the best inlier fraction, or until the budget ends: O(w⁻³) triples for a fraction w of true pairs, N residuals
/// for each coherent one. The best pose is fitted again to the pairs that it explains.
///
/// With edges, a sample is two edges, or three features of either kind, and the score is the sum over both kinds; the
/// residual of an edge is that of the worst of its four offsets. A problem without edges is searched as before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Ransac {
    /// Whether mirror images are rejected; `false` relies on distances and pose alone.
    pub(crate) orientation: bool,
    /// Probability, between 0 and 1, that a triple of true pairs was sampled before the search ends.
    pub(crate) confidence: f64,
    /// Maximum number of pair tests and residuals.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for Ransac {
    fn default() -> Self {
        Self { orientation: true, confidence: 0.999, budget: BUDGET, max_pairs: 4_000_000 }
    }
}

impl Component for Ransac {
    const NAME: &'static str = "ransac";
    const VERSION: u32 = 5;
    const SUMMARY: &'static str = "the best of the poses of random coherent triples";
    const SOURCE: &'static str = "Fischler, Bolles, Random sample consensus, 1981; the score: Torr, Zisserman, MLESAC, \
                                  2000; the edge-length check: Zhou, Park, Koltun, Open3D, 2018";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "Σ (1 − r²) over the pairs that a pose explains, over poses of random coherent triples (MSAC)"),
        ("exact", "no: triples are sampled until one was true with the given confidence"),
        ("time", "O(w⁻³) triples for a fraction w of true pairs, N residuals for each coherent one"),
        ("features", "points and straight edges"),
    ];

    fn check(&self) -> Result<(), String> {
        let confident = self.confidence > 0.0 && self.confidence < 1.0;
        in_range(confident, "confidence", self.confidence, "a number between 0 and 1")?;
        bounded(self.budget, self.max_pairs)
    }
}

impl Search for Ransac {
    fn takes_edges(&self) -> bool {
        true
    }

    fn search(&self, problem: &Problem<'_>, rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        if problem.edges.with_candidates() > 0 {
            return ransac_edges::search(self, problem, rng);
        }
        feasible(problem, self.max_pairs)?;
        let vertices = vertices(problem);
        let count = vertices.len();
        let (mut pair_tests, mut trials, mut needed) = (0, 0u64, f64::INFINITY);
        let mut best = (0.0, None);
        while count >= NEEDED && pair_tests < self.budget && (trials as f64) < needed {
            trials += 1;
            let [a, b, c] = [(); 3].map(|()| vertices[rng.random_range(0..count)]);
            pair_tests += 1;
            if !problem.coherent(a, b) {
                continue;
            }
            pair_tests += 2;
            if !problem.coherent(a, c) || !problem.coherent(b, c) {
                continue;
            }
            let Some(pose) = fitted(problem, &[a, b, c]) else { continue };
            pair_tests += count as u64;
            // Vertices are sorted by model point: the best candidate of each counts.
            let of = |same: &[Correspondence]| {
                let min = same.iter().map(|&pair| fraction(problem, &pose, pair)).fold(1.0, f64::min);
                (1.0 - min * min, u64::from(min < 1.0))
            };
            let groups = vertices.chunk_by(|a, b| a.model == b.model).map(of);
            let (score, inliers) = groups.fold((0.0, 0), |(score, all), (worth, one)| (score + worth, all + one));
            if score > best.0 {
                best = (score, Some(pose));
                let fraction = inliers as f64 / count as f64;
                needed = libm::log(1.0 - self.confidence) / libm::log1p(-fraction.powi(3).min(1.0 - 1e-12));
            }
        }
        let spent = pair_tests;
        let Some(pose) = best.1 else {
            let bound = max_possible(problem);
            return match pair_tests < self.budget {
                true => Err(Rejected::NotFound { bound, needed: NEEDED }),
                false => {
                    let ended = Rejected::Budget { budget: self.budget, best: 0, bound, pair_tests };
                    so_far(problem, self.orientation, ended)
                }
            };
        };
        let (_, ranked) = refined(problem, &vertices, pose, &mut pair_tests);
        let ended = (spent >= self.budget && (trials as f64) < needed).then_some((self.budget, spent));
        conclude_within(problem, &ranked, self.orientation, pair_tests, ended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Ransac::default().check(), Ok(()));
        assert!(Ransac { confidence: 1.0, ..Ransac::default() }.check().is_err());
        assert!(Ransac { budget: 0, ..Ransac::default() }.check().is_err());
    }
}
