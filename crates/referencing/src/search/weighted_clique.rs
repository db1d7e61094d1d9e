//! Weighted clique: the densest consistent set.

use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    affinity::{Affinity, by_weight, normalized},
    association::Association,
    grow::{conclude_within, feasible},
    identification::{Identification, Rejected, Search},
    limits::bounded,
};
use crate::problem::{Correspondence, Problem};

/// CLIPPER (Lusk, Fathian and How 2021): the densest consistent set.
///
/// Maximises uᵀ M u / uᵀ u over u ≥ 0 with u_a u_b = 0 for incoherent candidate pairs a and b; M_ab = exp(−½ (3 d/Δ)²),
/// d the difference of the two distances, M_aa = 1. The answer is not the largest set but the one that agrees best,
/// with the size counted through the sum.
///
/// Projected gradient ascent on uᵀ M u − d Σ u_a u_b over the incoherent pairs; the penalty d grows until the support,
/// which is the answer, has no incoherent pair. The result is a local maximum without a proof. E operations a step for
/// E edges, after N²/2 pair tests for N candidate pairs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct WeightedClique {
    /// Whether mirror images are rejected; `false` compares distances only.
    pub(crate) orientation: bool,
    /// Maximum number of gradient steps.
    pub(crate) iterations: usize,
    /// Maximum number of edge operations and pair tests.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected (40 000 take 200 MB).
    pub(crate) max_pairs: usize,
    /// Maximum number of edges; more are rejected (8 bytes each).
    pub(crate) max_edges: usize,
}

impl Default for WeightedClique {
    fn default() -> Self {
        Self { orientation: true, iterations: 500, budget: 2_000_000_000, max_pairs: 40_000, max_edges: 30_000_000 }
    }
}

impl Component for WeightedClique {
    const NAME: &'static str = "weighted-clique";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "the densest consistent set, by projected gradient ascent with a growing penalty";
    const SOURCE: &'static str = "Lusk, Fathian, How, CLIPPER: a graph-theoretic framework for robust data \
                                  association, 2021";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the density uᵀ M u / uᵀ u of a coherent set, M_ab = exp(−½ (3 d/Δ)²) of distances that differ by d",
        ),
        ("exact", "no: a local maximum"),
        ("time", "K²/2 pair tests for K candidate pairs, then E operations a step for E coherent ones"),
    ];

    fn check(&self) -> Result<(), String> {
        in_range(self.iterations > 0, "iterations", self.iterations, "1 or more")?;
        bounded(self.budget, self.max_pairs)?;
        in_range(self.max_edges > 0, "max-edges", self.max_edges, "1 or more")
    }
}

impl Search for WeightedClique {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let graph = Association::of(problem);
        let weight = |off: f64| libm::exp(-4.5 * off * off);
        let affinity = Affinity::of(problem, &graph, self.max_edges, weight)?;
        let mut ascent = Ascent::of(&affinity, graph.vertices.len());
        let spent = |ascent: &Ascent<'_>| graph.pair_tests + ascent.products * affinity.edges() as u64;
        let mut ended = None;
        for _ in 0..self.iterations {
            if spent(&ascent) > self.budget {
                ended = Some((self.budget, spent(&ascent)));
                break;
            }
            if !ascent.climb() && !ascent.penalize() {
                break;
            }
        }
        let ranked: Vec<Correspondence> = by_weight(&ascent.u).into_iter().map(|v| graph.vertices[v]).collect();
        conclude_within(problem, &ranked, self.orientation, spent(&ascent), ended)
    }
}

/// A point u ≥ 0 on the unit sphere, with the penalty.
struct Ascent<'a> {
    affinity: &'a Affinity,
    u: Vec<f64>,
    /// M u and C̄ u, with the graph C̄ of incoherent pairs.
    weighted: Vec<f64>,
    apart: Vec<f64>,
    penalty: f64,
    /// uᵀ M u.
    density: f64,
    products: u64,
}

/// Weight, as a fraction of the total, below which a pair does not count.
const NONE: f64 = 1e-6;

impl<'a> Ascent<'a> {
    /// Start from the numbers of neighbours, with a penalty equal to the mean gain.
    fn of(affinity: &'a Affinity, count: usize) -> Self {
        let mut plain = vec![0.0; count];
        let mut weighted = vec![0.0; count];
        affinity.products(&vec![1.0; count], &mut weighted, &mut plain);
        let mut u: Vec<f64> = weighted.iter().map(|x| x + 1.0).collect();
        normalized(&mut u);
        let mut ascent = Self { affinity, u, weighted, apart: plain, penalty: 0.0, density: 0.0, products: 1 };
        ascent.evaluate();
        ascent.penalty = ascent.balance().unwrap_or(0.0);
        ascent
    }

    fn evaluate(&mut self) {
        self.affinity.products(&self.u, &mut self.weighted, &mut self.apart);
        self.products += 1;
        let sum: f64 = self.u.iter().sum();
        for ((weighted, apart), u) in self.weighted.iter_mut().zip(&mut self.apart).zip(&self.u) {
            *weighted += u;
            *apart = (sum - u - *apart).max(0.0);
        }
        self.density = self.u.iter().zip(&self.weighted).map(|(u, m)| u * m).sum();
    }

    /// Mean of (M u)_a / (C̄ u)_a over the support with an incoherent pair; `None` without one.
    fn balance(&self) -> Option<f64> {
        let ratios = self.u.iter().zip(&self.weighted).zip(&self.apart);
        let ratios: Vec<f64> =
            ratios.filter(|((u, _), apart)| **u > NONE && **apart > NONE).map(|((_, m), apart)| m / apart).collect();
        (!ratios.is_empty()).then(|| ratios.iter().sum::<f64>() / ratios.len() as f64)
    }

    fn value(&self) -> f64 {
        self.density - self.penalty * self.u.iter().zip(&self.apart).map(|(u, apart)| u * apart).sum::<f64>()
    }

    /// One ascent step; false if it gains nothing.
    fn climb(&mut self) -> bool {
        let (before, from) = (self.value(), self.u.clone());
        let gradient: Vec<f64> =
            self.weighted.iter().zip(&self.apart).map(|(m, apart)| m - self.penalty * apart).collect();
        let mut step = 1.0;
        for _ in 0..20 {
            self.u = from.iter().zip(&gradient).map(|(u, g)| (u + step * g).max(0.0)).collect();
            if normalized(&mut self.u) {
                self.evaluate();
                if self.value() > before + 1e-9 * before.abs() {
                    return true;
                }
            }
            step *= 0.25;
        }
        self.u = from;
        self.evaluate();
        false
    }

    /// Increases the penalty; false if no incoherent pair is left.
    fn penalize(&mut self) -> bool {
        let more = self.balance();
        self.penalty += more.unwrap_or(0.0).max(0.5 * self.penalty);
        more.is_some() && self.penalty.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(WeightedClique::default().check(), Ok(()));
        assert!(WeightedClique { iterations: 0, ..WeightedClique::default() }.check().is_err());
        assert!(WeightedClique { max_pairs: 2, ..WeightedClique::default() }.check().is_err());
    }
}
