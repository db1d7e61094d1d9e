//! k-core pruning and graduated non-convexity: ROBIN and KISS-Matcher.

use nalgebra::{Matrix3, Vector3};
use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use seafix_geometry::{Camera, Object, Transform, UncertainPoint};
use serde::{Deserialize, Serialize};

use super::{
    alike::slack,
    association::Association,
    grow::feasible,
    hypotheses::BestPose,
    identification::{Identification, Rejected, Search},
    limits::NEEDED,
};
use crate::{
    observations::Observation,
    problem::{Correspondence, Problem},
    solve::closed_form::fit_weighted,
};

/// The largest k-core of the consistency graph, followed by a decoupled robust fit (Shi et al. 2021, Lim et al. 2025).
///
/// The core holds the vertices with the greatest core number; it contains every clique that is larger. Its pairs in a
/// row give differences of places d = c₂ − c₁ and m = p₂ − p₁, which a rotation relates: it minimises Σ min(‖d − R
/// m‖²/Δ², 1) by graduated non-convexity. The translation has the most pairs within ½ Δ on each axis (adaptive
/// voting). The answer is the one-to-one set that the pose explains.
///
/// Unlike the package of KISS-Matcher, the answer has no pose unless three mutually coherent pairs agree with it.
///
/// Not exact: the core holds wrong pairs among many agreements by chance, and GNC follows one minimum. K²/2 pair tests
/// for K candidate pairs, then O(E) for E coherent ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct KCoreGnc {
    /// Whether mirror images are rejected; `false` compares distances only.
    pub(crate) orientation: bool,
    /// Growth factor of μ for each step, above 1 and at most 10.
    pub(crate) growth: f64,
    /// Maximum number of candidate pairs; more are rejected (40 000 take 200 MB).
    pub(crate) max_pairs: usize,
}

impl Default for KCoreGnc {
    fn default() -> Self {
        Self { orientation: true, growth: 1.4, max_pairs: 40_000 }
    }
}

impl Component for KCoreGnc {
    const NAME: &'static str = "k-core-gnc";
    const SUMMARY: &'static str = "the largest k-core, then rotation and translation by robust estimates";
    const SOURCE: &'static str = "Shi, Yang, Carlone, ROBIN: a graph-theoretic approach to reject outliers, 2021; Lim \
                                  et al., KISS-Matcher: fast and robust point cloud registration revisited, 2025; \
                                  the fit: Yang, Shi, Carlone, TEASER, 2021";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "the weight of the core's pairs that one rotation, then one translation explains"),
        ("exact", "no: neither the core nor the fit"),
        ("time", "K²/2 pair tests for K candidate pairs, then O(E) for E coherent ones"),
    ];

    fn check(&self) -> Result<(), String> {
        let grows = self.growth > 1.0 && self.growth <= 10.0;
        in_range(grows, "growth", self.growth, "a number above 1, at most 10")?;
        in_range(self.max_pairs >= NEEDED, "max-pairs", self.max_pairs, "3 or more candidate pairs")
    }
}

/// Maximum number of steps of graduated non-convexity.
const MAX_STEPS: usize = 100;

impl Search for KCoreGnc {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let graph = Association::of(problem);
        let core: Vec<Correspondence> = largest_core(&graph).into_iter().map(|v| graph.vertices[v]).collect();
        let mut best = BestPose::default();
        if core.len() >= NEEDED {
            let rotation = self.rotation(problem, &core);
            let shifts: Vec<(Vector3<f64>, f64)> = core
                .iter()
                .map(|pair| {
                    let turned = rotation * problem.cloud[pair.cloud].position.at;
                    (problem.model[pair.model].at.coords - turned.coords, 0.5 * slack(problem, *pair))
                })
                .collect();
            let shift = Vector3::from_fn(|axis, _| voted(shifts.iter().map(|(at, off)| (at[axis], *off))));
            best.offer(1.0, Transform::new(rotation.rotation(), shift));
        }
        best.conclude(problem, &graph.vertices, self.orientation, graph.pair_tests, None)
    }
}

impl KCoreGnc {
    /// The rotation that explains most differences of successive pairs, as a motion about the origin.
    fn rotation(&self, problem: &Problem<'_>, core: &[Correspondence]) -> Transform<Object, Camera> {
        let at = |measured: Vector3<f64>, model: Vector3<f64>| Observation {
            measured: UncertainPoint { at: measured.into(), covariance: Matrix3::zeros() },
            pixels: None,
            model: model.into(),
            model_sigma: 0.0,
        };
        let (mut points, mut tolerances) = (Vec::new(), Vec::new());
        for (k, &a) in core.iter().enumerate() {
            let b = core[(k + 1) % core.len()];
            let measured = problem.cloud[b.cloud].position.at - problem.cloud[a.cloud].position.at;
            let model = problem.model[b.model].at - problem.model[a.model].at;
            // With its opposite, the centroid is the origin and the motion a rotation about it.
            points.extend([at(measured, model), at(-measured, -model)]);
            tolerances.push(problem.delta(a, b));
        }
        let mut pose = fit_weighted(&points, |_| 1.0);
        let squares = |pose: &Transform<Object, Camera>| -> Vec<f64> {
            let off = |k: usize| points[2 * k].residual(pose).norm() / tolerances[k];
            (0..tolerances.len()).map(|k| off(k).powi(2)).collect()
        };
        let mut d2 = squares(&pose);
        let largest = d2.iter().copied().fold(0.0, f64::max);
        let mut mu = 1.0 / (2.0 * largest - 1.0);
        for _ in 0..MAX_STEPS {
            if !(mu > 0.0) {
                break;
            }
            let weights: Vec<f64> = d2.iter().map(|&d2| weight(d2, mu)).collect();
            if weights.iter().filter(|&&weight| weight > 0.0).count() < 2 {
                break;
            }
            pose = fit_weighted(&points, |k| weights[k / 2]);
            d2 = squares(&pose);
            if weights.iter().all(|&weight| weight == 0.0 || weight == 1.0) {
                break;
            }
            mu *= self.growth;
        }
        Transform::new(pose.rotation(), Vector3::zeros())
    }
}

/// The weight of a squared residual (fraction of the tolerance) in truncated least squares relaxed by μ.
fn weight(d2: f64, mu: f64) -> f64 {
    if d2 <= mu / (mu + 1.0) {
        1.0
    } else if d2 >= (mu + 1.0) / mu {
        0.0
    } else {
        ((mu * (mu + 1.0) / d2).sqrt() - mu).clamp(0.0, 1.0)
    }
}

/// The vertices of the greatest core number, ascending.
fn largest_core(graph: &Association) -> Vec<usize> {
    let count = graph.vertices.len();
    let mut degree: Vec<usize> = (0..count).map(|v| graph.adjacency.ones(v).count()).collect();
    let mut by_degree: Vec<Vec<usize>> = vec![Vec::new(); count + 1];
    (0..count).for_each(|v| by_degree[degree[v]].push(v));
    let (mut left, mut core, mut level) = (vec![true; count], vec![0; count], 0);
    let mut next = 0;
    while next <= count {
        let Some(v) = by_degree[next].pop() else {
            next += 1;
            continue;
        };
        // An entry is out of date once the degree has changed.
        if !left[v] || degree[v] != next {
            continue;
        }
        level = level.max(next);
        (left[v], core[v]) = (false, level);
        for w in graph.adjacency.ones(v).filter(|&w| left[w]) {
            degree[w] -= 1;
            by_degree[degree[w]].push(w);
            next = next.min(degree[w]);
        }
    }
    (0..count).filter(|&v| core[v] == level).collect()
}

/// The mean of the most values that lie within their tolerance of one place; among equals the least.
fn voted(values: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut ends: Vec<(f64, i32, f64)> = values.flat_map(|(at, off)| [(at - off, 1, at), (at + off, -1, at)]).collect();
    // At one place beginnings come before ends: the intervals are closed.
    ends.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)).then(a.2.total_cmp(&b.2)));
    let (mut inside, mut sum, mut best) = (0, 0.0, (0, f64::NAN));
    for (_, step, at) in ends {
        inside += step;
        sum += f64::from(step) * at;
        if inside > best.0 {
            best = (inside, sum / f64::from(inside));
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::bitset::BitMatrix;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(KCoreGnc::default().check(), Ok(()));
        assert!(KCoreGnc { growth: 1.0, ..KCoreGnc::default() }.check().is_err());
        assert!(KCoreGnc { max_pairs: 2, ..KCoreGnc::default() }.check().is_err());
    }

    /// A clique of four with a tail of three: the tail has the core number one, the clique three.
    #[test]
    fn the_clique_is_the_core_and_its_tail_is_not() {
        let mut adjacency = BitMatrix::zeros(7);
        for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3), (3, 4), (4, 5), (5, 6)] {
            adjacency.connect(a, b);
        }
        let vertices = (0..7).map(|k| Correspondence { model: k, cloud: k }).collect();
        assert_eq!(largest_core(&Association { vertices, adjacency, pair_tests: 0 }), [0, 1, 2, 3]);
    }

    #[test]
    fn the_place_with_the_largest_number_of_values_is_voted() {
        let values = [0.0, 5.0, 5.1, 5.2, 9.0].map(|at| (at, 0.2));
        assert!((voted(values.into_iter()) - 5.1).abs() < 1e-12);
    }
}
