//! GNC-TLS: one robust fit to all candidate pairs.

use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    alike::slack,
    association::vertices,
    grow::{conclude, feasible},
    identification::{Identification, Rejected, Search},
    limits::NEEDED,
    pose::refined,
};
use crate::{
    observations::Observations,
    problem::Problem,
    solve::{self, solver::Solver},
};

/// Truncated least squares by graduated non-convexity (Yang et al. 2020) over all candidate pairs.
///
/// Minimises Σ min(r², c²) over poses, with the tolerance c of each pair. The answer is the one-to-one set that the
/// pose explains. Not exact: it follows one minimum from the convex problem on. O(N) a step, some fifty steps for N
/// pairs. The method suits putative correspondences with a large fraction of true ones; with many candidates for each
/// model point it fits their mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct GncTls {
    /// Whether mirror images are rejected; `false` relies on the pose alone.
    pub(crate) orientation: bool,
    /// Growth factor of μ for each step, above 1 and at most 10.
    pub(crate) growth: f64,
    /// Maximum number of candidate pairs; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for GncTls {
    fn default() -> Self {
        Self { orientation: true, growth: 1.4, max_pairs: 1_000_000 }
    }
}

impl Component for GncTls {
    const NAME: &'static str = "gnc-tls";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "one robust fit to all candidate pairs, by graduated non-convexity";
    const SOURCE: &'static str = "Yang, Antonante, Tzoumas, Carlone, Graduated non-convexity for robust spatial \
                                  perception, 2020";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the weight of the pairs that one pose explains: it minimises Σ min(r², c²) by graduated non-convexity",
        ),
        ("exact", "no: it follows one minimum"),
        ("time", "O(N) a step, some fifty steps, for N candidate pairs"),
    ];

    fn check(&self) -> Result<(), String> {
        let grows = self.growth > 1.0 && self.growth <= 10.0;
        in_range(grows, "growth", self.growth, "a number above 1, at most 10")?;
        in_range(self.max_pairs >= NEEDED, "max-pairs", self.max_pairs, "3 or more candidate pairs")
    }
}

impl Search for GncTls {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let vertices = vertices(problem);
        // Only from the convex problem: triples of thousands of pairs, most of them wrong, lead nowhere.
        let solver = solve::GncTls { growth: self.growth, triples: 0, ..solve::GncTls::default() };
        let mut data = Observations::of(&vertices, problem.model, problem.cloud, None);
        for (point, &pair) in data.points.iter_mut().zip(&vertices) {
            // The solver excludes residuals above `threshold` standard deviations.
            let sigma = slack(problem, pair) / solver.threshold;
            point.measured.covariance = nalgebra::Matrix3::identity() * (sigma * sigma);
            point.model_sigma = 0.0;
        }
        let finite = data.points.iter().all(|point| point.measured.covariance[(0, 0)].is_finite());
        let mut pair_tests = vertices.len() as u64;
        let pose = finite.then(|| solver.solve(&data).ok()).flatten().filter(|pose| pose.is_finite());
        let ranked = pose.map(|pose| refined(problem, &vertices, pose, &mut pair_tests).1).unwrap_or_default();
        conclude(problem, &ranked, self.orientation, pair_tests)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(GncTls::default().check(), Ok(()));
        assert!(GncTls { growth: 1.0, ..GncTls::default() }.check().is_err());
        assert!(GncTls { max_pairs: 2, ..GncTls::default() }.check().is_err());
    }
}
