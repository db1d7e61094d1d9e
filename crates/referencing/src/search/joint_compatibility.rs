//! Joint compatibility: a common test of all distances of a hypothesis, by branch and bound.

use nalgebra::Vector3;
use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    association::vertices,
    grow::{admits, conclude, feasible, max_possible, so_far},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, NEEDED, bounded},
    orientation::Sense,
    quadruples::Quadruples,
    volumes::Volumes,
};
use crate::{
    chi_square::chi_square,
    problem::{Correspondence, Problem, Tolerance},
};

/// Joint compatibility branch and bound (Neira and Tardós 2001) on distances.
///
/// The answer is the longest hypothesis whose distances are jointly compatible: D² = hᵀ C⁻¹ h ≤ χ²(confidence), h the
/// differences between measured and model distances, C their joint covariance; among equally long ones that of minimum
/// D².
///
/// Distances need no pose and no prior. For k points 3k − 6 of them suffice: those to the first three of the
/// hypothesis. Distances that share a point have correlated errors, which C contains: two errors that are each
/// tolerable may contradict each other. A new pair adds rows to the Cholesky factor of C, and its part to D² (the
/// incremental form). With a fixed Δ the noise is isotropic, and Δ counts as three standard deviations of a distance.
///
/// Exact in this measure within the budget. Exponential in the worst case; k² a node.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct JointCompatibility {
    /// Whether mirror images are rejected; `false` compares distances only.
    pub(crate) orientation: bool,
    /// Probability, between 0 and 1, that a true hypothesis is compatible.
    pub(crate) confidence: f64,
    /// Maximum number of pair tests.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for JointCompatibility {
    fn default() -> Self {
        Self { orientation: true, confidence: 0.99, budget: BUDGET, max_pairs: 40_000 }
    }
}

impl Component for JointCompatibility {
    const NAME: &'static str = "joint-compatibility";
    const VERSION: u32 = 2;
    const SUMMARY: &'static str = "the longest hypothesis whose distances are jointly compatible, by branch and bound";
    const SOURCE: &'static str = "Neira, Tardós, Data association in stochastic mapping using the joint compatibility \
                                  test, 2001; the incremental form: Li, Li, Song, Zou, Yan, IJCBB, 2014";
    const PROPERTIES: seafix_component::Properties = &[
        (
            "maximises",
            "the number of pairs whose distances are jointly compatible, D² ≤ χ²; among equals the minimum D²",
        ),
        ("exact", "in this measure, within its budget"),
        ("time", "exponential at worst; k² a node of k pairs"),
    ];

    fn check(&self) -> Result<(), String> {
        let confident = self.confidence > 0.0 && self.confidence < 1.0;
        in_range(confident, "confidence", self.confidence, "a number between 0 and 1")?;
        bounded(self.budget, self.max_pairs)
    }
}

impl Search for JointCompatibility {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let vertices = vertices(problem);
        let volumes = Volumes::of(problem, &vertices);
        let numbers: Vec<usize> = (0..vertices.len()).collect();
        let levels: Vec<&[usize]> = numbers.chunk_by(|&a, &b| vertices[a].model == vertices[b].model).collect();
        let limits = (0..3 * levels.len()).map(|d| if d == 0 { 0.0 } else { chi_square(d, self.confidence) }).collect();
        let mut run = Run {
            problem,
            vertices: &vertices,
            volumes: &volumes,
            quadruples: Quadruples::default(),
            levels: &levels,
            settings: self,
            limits,
            best: (Vec::new(), f64::INFINITY),
            pair_tests: 0,
        };
        run.descend(0, &mut Vec::new(), &Joint::default());
        if run.best.0.len() < NEEDED && run.pair_tests >= self.budget {
            let (budget, best, pair_tests) = (self.budget, run.best.0.len(), run.pair_tests);
            let ended = Rejected::Budget { budget, best, bound: max_possible(problem), pair_tests };
            return so_far(problem, self.orientation, ended);
        }
        let ranked: Vec<Correspondence> = run.best.0.iter().map(|&v| vertices[v]).collect();
        conclude(problem, &ranked, self.orientation, run.pair_tests)
    }
}

/// The distances of a hypothesis with their joint test.
#[derive(Debug, Clone, Default)]
struct Joint {
    /// Members of each distance, the later one second, with its direction in the cloud.
    distances: Vec<([usize; 2], Vector3<f64>)>,
    /// Lower Cholesky factor of C, row by row, and the differences solved with it.
    factor: Vec<Vec<f64>>,
    solved: Vec<f64>,
    /// D².
    square: f64,
}

struct Run<'a> {
    problem: &'a Problem<'a>,
    vertices: &'a [Correspondence],
    volumes: &'a Volumes<'a>,
    quadruples: Quadruples,
    levels: &'a [&'a [usize]],
    settings: &'a JointCompatibility,
    /// Quantiles of χ² by degrees of freedom.
    limits: Vec<f64>,
    best: (Vec<usize>, f64),
    pair_tests: u64,
}

/// Fraction of a distance's variance that is independent, since C of coplanar distances is singular.
const OWN: f64 = 0.01;

impl Run<'_> {
    fn descend(&mut self, level: usize, taken: &mut Vec<usize>, joint: &Joint) {
        if taken.len() > self.best.0.len() || (taken.len() == self.best.0.len() && joint.square < self.best.1) {
            self.best = (taken.clone(), joint.square);
        }
        let max = taken.len() + self.levels.len() - level;
        let hopeless = max < self.best.0.len() || (max == self.best.0.len() && joint.square >= self.best.1);
        if level == self.levels.len() || hopeless || self.pair_tests >= self.settings.budget {
            return;
        }
        let sense = if self.settings.orientation { Sense::Proper } else { Sense::Any };
        for &vertex in self.levels[level] {
            if !admits(self.volumes, &mut self.quadruples, sense, taken, vertex, &mut self.pair_tests) {
                continue;
            }
            if let Some(longer) = self.joined(joint, taken, vertex) {
                taken.push(vertex);
                self.descend(level + 1, taken, &longer);
                taken.pop();
            }
        }
        self.descend(level + 1, taken, joint);
    }

    /// The hypothesis with one pair more, if it remains compatible.
    fn joined(&mut self, joint: &Joint, taken: &[usize], vertex: usize) -> Option<Joint> {
        let mut joint = joint.clone();
        for &other in taken.iter().take(3) {
            let (a, b) = (self.vertices[other], self.vertices[vertex]);
            let step = self.problem.cloud[b.cloud].position.at - self.problem.cloud[a.cloud].position.at;
            let direction = step.try_normalize(0.0).unwrap_or_else(Vector3::z);
            let known = self.problem.model[a.model].at.distance(&self.problem.model[b.model].at);
            let members = [other, vertex];
            let mut row = Vec::with_capacity(joint.factor.len() + 1);
            let mut off = step.norm() - known;
            for (place, (earlier, along)) in joint.distances.iter().enumerate() {
                let mut entry = self.covariance(members, &direction, *earlier, along);
                let factor = &joint.factor[place];
                row.iter().zip(factor).for_each(|(x, y): (&f64, &f64)| entry -= x * y);
                row.push(entry / factor[place]);
            }
            let mut variance = self.covariance(members, &direction, members, &direction) * (1.0 + OWN);
            for (x, solved) in row.iter().zip(&joint.solved) {
                variance -= x * x;
                off -= x * solved;
            }
            let deviation = variance.sqrt();
            // The negated comparison rejects NaN too.
            if !(deviation > 0.0) {
                return None;
            }
            row.push(deviation);
            joint.distances.push((members, direction));
            joint.factor.push(row);
            joint.solved.push(off / deviation);
            joint.square += (off / deviation).powi(2);
        }
        self.pair_tests += joint.distances.len() as u64;
        (joint.square <= self.limits[joint.distances.len()]).then_some(joint)
    }

    /// The covariance of two distances: the contribution of their common points.
    fn covariance(&self, a: [usize; 2], along_a: &Vector3<f64>, b: [usize; 2], along_b: &Vector3<f64>) -> f64 {
        let mut sum = 0.0;
        for (i, &p) in a.iter().enumerate() {
            for (k, _) in b.iter().enumerate().filter(|(_, q)| **q == p) {
                let sign = if i == k { 1.0 } else { -1.0 };
                let pair = self.vertices[p];
                sum += sign
                    * match self.problem.tolerance {
                        Tolerance::Fixed(delta) => along_a.dot(along_b) * (delta / 3.0).powi(2) / 2.0,
                        Tolerance::Sigmas(_) => {
                            let own = self.problem.model[pair.model].sigma.powi(2);
                            along_a.dot(&(self.problem.cloud[pair.cloud].position.covariance * along_b))
                                + along_a.dot(along_b) * own
                        }
                    };
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(JointCompatibility::default().check(), Ok(()));
        assert!(JointCompatibility { confidence: 1.0, ..JointCompatibility::default() }.check().is_err());
        assert!(JointCompatibility { budget: 0, ..JointCompatibility::default() }.check().is_err());
    }
}
