//! Spectral matching: the principal eigenvector of the agreement matrix.

use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    affinity::{Affinity, by_weight, normalized},
    association::Association,
    grow::{conclude, feasible},
    identification::{Identification, Rejected, Search},
    limits::NEEDED,
};
use crate::problem::{Correspondence, Problem};

/// Spectral matching (Leordeanu and Hebert 2005).
///
/// Maximises xᵀ M x over |x| = 1, M_ab = 1 − (| |P_a P_b| − |C_a C_b| | / Δ_ab)² for coherent pairs a, b: the principal
/// eigenvector, by power iteration. Pairs are then added in descending order of their weight if they are admissible
/// with the set.
///
/// Exact for the relaxed problem only, without a proof for the set. E operations an iteration for E edges of the graph,
/// after N²/2 pair tests for N candidate pairs. If true pairs are few among many accidental agreements, the eigenvector
/// spreads over the latter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Spectral {
    /// Whether mirror images are rejected; `false` compares distances only.
    pub(crate) orientation: bool,
    /// Maximum number of power iterations.
    pub(crate) iterations: usize,
    /// Maximum number of candidate pairs; more are rejected (40 000 take 200 MB).
    pub(crate) max_pairs: usize,
    /// Maximum number of edges; more are rejected (8 bytes each).
    pub(crate) max_edges: usize,
}

impl Default for Spectral {
    fn default() -> Self {
        Self { orientation: true, iterations: 100, max_pairs: 40_000, max_edges: 30_000_000 }
    }
}

impl Component for Spectral {
    const NAME: &'static str = "spectral";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "pairs by their weight in the principal eigenvector of the agreements";
    const SOURCE: &'static str = "Leordeanu, Hebert, A spectral technique for correspondence problems using pairwise \
                                  constraints, 2005";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "xᵀ M x over |x| = 1, M the agreements of pairs; pairs are added by descending weight"),
        ("exact", "for the relaxed problem only: no proof for the set"),
        ("time", "K²/2 pair tests for K candidate pairs, then E operations an iteration for E agreeing ones"),
    ];

    fn check(&self) -> Result<(), String> {
        in_range(self.iterations > 0, "iterations", self.iterations, "1 or more")?;
        in_range(self.max_pairs >= NEEDED, "max-pairs", self.max_pairs, "3 or more candidate pairs")?;
        in_range(self.max_edges > 0, "max-edges", self.max_edges, "1 or more")
    }
}

impl Search for Spectral {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let graph = Association::of(problem);
        let affinity = Affinity::of(problem, &graph, self.max_edges, |off| 1.0 - off * off)?;
        let mut x = vec![1.0; graph.vertices.len()];
        let (mut next, mut plain) = (x.clone(), x.clone());
        let mut pair_tests = graph.pair_tests;
        for _ in 0..self.iterations {
            affinity.products(&x, &mut next, &mut plain);
            pair_tests += affinity.edges() as u64;
            // Half of the last vector prevents eigenvalues of opposite sign from alternating.
            let scale = next.iter().copied().fold(0.0, f64::max);
            next.iter_mut().zip(&x).for_each(|(next, x)| *next += 0.5 * scale * x);
            if !normalized(&mut next) {
                break;
            }
            let step = next.iter().zip(&x).map(|(next, x)| (next - x).abs()).fold(0.0, f64::max);
            std::mem::swap(&mut x, &mut next);
            if step < 1e-9 {
                break;
            }
        }
        let ranked: Vec<Correspondence> = by_weight(&x).into_iter().map(|v| graph.vertices[v]).collect();
        conclude(problem, &ranked, self.orientation, pair_tests)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Spectral::default().check(), Ok(()));
        assert!(Spectral { iterations: 0, ..Spectral::default() }.check().is_err());
        assert!(Spectral { max_edges: 0, ..Spectral::default() }.check().is_err());
    }
}
