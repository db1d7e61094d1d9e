//! MAGSAC++: poses of random triples, scored by inliers marginalised over the noise scale.

use rand::{Rng, RngExt};
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Object, Transform};
use serde::{Deserialize, Serialize};

use super::{
    association::vertices,
    grow::feasible,
    hypotheses::{BestPose, scored},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, NEEDED, bounded},
    pose::{explained, fitted},
};
use crate::{
    observations::Observations,
    problem::{Correspondence, Problem},
    solve::closed_form::fit_weighted,
};

/// MAGSAC++ (Barath et al. 2020) for rigid motions.
///
/// The noise scale σ is unknown, up to a maximum: each residual r has the loss ρ(r) averaged over σ. With k² the 0.99
/// quantile of χ²₃ and r ≤ kσ, in units of σ,
///
/// ρ(r) = 1 − e^(−r²/2) − (r²/2) e^(−k²/2), w(r) = ρ′(r)/r = e^(−r²/2) − e^(−k²/2);
///
/// the tolerance of a pair is kσ. Maximises Σ (1 − ρ(r)/ρ(kσ)) over the poses of random coherent triples of candidate
/// pairs; r is the residual of each model point's best candidate. Every pose that is the best so far is optimised
/// locally by iteratively reweighted least squares with w.
///
/// Not exact. Triples are sampled until one of true pairs was among them with the probability `confidence`, according
/// to the best inlier fraction, or until the budget ends: O(w⁻³) triples for a fraction w of true pairs, N residuals
/// for each coherent one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Magsac {
    /// Whether mirror images are rejected; `false` relies on distances and pose alone.
    pub(crate) orientation: bool,
    /// Probability, between 0 and 1, that a triple of true pairs was sampled before the search ends.
    pub(crate) confidence: f64,
    /// Maximum number of steps of a local optimisation.
    pub(crate) steps: usize,
    /// Maximum number of pair tests and residuals.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for Magsac {
    fn default() -> Self {
        Self { orientation: true, confidence: 0.999, steps: 10, budget: BUDGET, max_pairs: 4_000_000 }
    }
}

impl Component for Magsac {
    const NAME: &'static str = "magsac";
    const SUMMARY: &'static str = "random triples, scored over all noise scales and optimised locally";
    const SOURCE: &'static str = "Barath, Noskova, Ivashechkin, Matas, MAGSAC++, a fast, reliable and accurate robust \
                                  estimator, 2020";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "Σ (1 − ρ(r)) over the model points, ρ the loss averaged over the noise scale"),
        ("exact", "no: triples are sampled until one was true with the given confidence"),
        ("time", "O(w⁻³) triples for a fraction w of true pairs, N residuals for each coherent one"),
    ];

    fn check(&self) -> Result<(), String> {
        let confident = self.confidence > 0.0 && self.confidence < 1.0;
        in_range(confident, "confidence", self.confidence, "a number between 0 and 1")?;
        bounded(self.budget, self.max_pairs)
    }
}

/// ½ k²: half of the 0.99 quantile of χ² with three degrees of freedom.
const HALF_K2: f64 = 5.672_43;

/// 1 − ρ(r)/ρ(kσ) for a residual of the fraction `off` of the tolerance.
fn worth(off: f64) -> f64 {
    let (x, end) = (HALF_K2 * off * off, libm::exp(-HALF_K2));
    1.0 - (1.0 - libm::exp(-x) - x * end) / (1.0 - end * (1.0 + HALF_K2))
}

/// w(r) for a residual of the fraction `off` of the tolerance.
fn weight(off: f64) -> f64 {
    (libm::exp(-HALF_K2 * off * off) - libm::exp(-HALF_K2)).max(0.0)
}

impl Search for Magsac {
    fn search(&self, problem: &Problem<'_>, rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let vertices = vertices(problem);
        let count = vertices.len();
        let (mut pair_tests, mut trials, mut needed) = (0, 0u64, f64::INFINITY);
        let mut best = BestPose::default();
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
            let Some(mut pose) = fitted(problem, &[a, b, c]) else { continue };
            for _ in 0..=self.steps {
                pair_tests += count as u64;
                let (score, inliers) = scored(problem, &vertices, &pose, worth);
                if !best.offer(score, pose) {
                    break;
                }
                let fraction = inliers as f64 / count as f64;
                needed = libm::log(1.0 - self.confidence) / libm::log1p(-fraction.powi(3).min(1.0 - 1e-12));
                pose = reweighted(problem, &vertices, &pose);
            }
        }
        let ended = (pair_tests >= self.budget && (trials as f64) < needed).then_some(self.budget);
        best.conclude(problem, &vertices, self.orientation, pair_tests, ended)
    }
}

/// One step of iteratively reweighted least squares.
fn reweighted(
    problem: &Problem<'_>,
    vertices: &[Correspondence],
    pose: &Transform<Object, Camera>,
) -> Transform<Object, Camera> {
    let (weights, pairs): (Vec<f64>, Vec<Correspondence>) =
        explained(problem, vertices, pose).into_iter().map(|(off, pair)| (weight(off), pair)).unzip();
    let data = Observations::of(&pairs, problem.model, problem.cloud, None);
    if pairs.len() < NEEDED { *pose } else { fit_weighted(&data.points, |k| weights[k]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(Magsac::default().check(), Ok(()));
        assert!(Magsac { confidence: 1.0, ..Magsac::default() }.check().is_err());
        assert!(Magsac { budget: 0, ..Magsac::default() }.check().is_err());
    }

    /// dρ/dr = r w(r), with the loss in units of ρ(kσ). Fails if the weight lacks its term e^(−k²/2).
    #[test]
    fn the_weight_is_the_slope_of_the_loss() {
        assert!((worth(0.0) - 1.0).abs() < 1e-15 && worth(1.0).abs() < 1e-12 && weight(1.0) == 0.0);
        let full = 1.0 - libm::exp(-HALF_K2) * (1.0 + HALF_K2);
        for off in [0.1, 0.3, 0.6, 0.9] {
            let slope = (worth(off - 1e-6) - worth(off + 1e-6)) / 2e-6;
            assert!((slope - 2.0 * HALF_K2 * off * weight(off) / full).abs() < 1e-6, "{off}: {slope}");
        }
    }
}
