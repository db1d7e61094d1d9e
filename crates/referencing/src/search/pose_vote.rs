//! Pose vote: the prior's error displaces all predictions alike.

use nalgebra::Vector3;
use rand::Rng;
use seafix_component::{Component, Settings, in_range};
use serde::{Deserialize, Serialize};

use super::{
    association::vertices,
    grow::{conclude_within, feasible},
    identification::{Identification, Rejected, Search},
    limits::{BUDGET, bounded},
    pose::{fitted, refined},
};
use crate::problem::{Correspondence, Problem};

/// Generalised Hough transform (Ballard 1981) over the displacement of the prior.
///
/// Maximises the number of model points whose candidates have the same displacement. All predictions p_i share the
/// error of the prior, so that the offsets c_j − p_i of true pairs (i, j) cluster and those of others do not. Poses are
/// fitted to the offsets with most votes, and fitted again to the pairs that they explain; the best explanation is the
/// answer.
///
/// Not exact: a rotation error of the prior spreads the offsets by its angle times the model's extent, and beyond
/// `radius` votes are lost. Time N log N for N evenly spread candidate pairs, at most the budget. Needs a prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct PoseVote {
    /// Whether mirror images are rejected; `false` relies on the pose alone.
    pub(crate) orientation: bool,
    /// Maximum distance (m) of two offsets that vote for each other.
    pub(crate) radius: f64,
    /// Number of offsets from which poses are fitted.
    pub(crate) tries: usize,
    /// Maximum number of compared offset pairs and residuals.
    pub(crate) budget: u64,
    /// Maximum number of candidate pairs; more are rejected.
    pub(crate) max_pairs: usize,
}

impl Default for PoseVote {
    fn default() -> Self {
        Self { orientation: true, radius: 0.1, tries: 50, budget: BUDGET, max_pairs: 4_000_000 }
    }
}

impl Component for PoseVote {
    const NAME: &'static str = "pose-vote";
    const SUMMARY: &'static str = "the displacement of the prior with most votes of model points";
    const SOURCE: &'static str = "Ballard, Generalizing the Hough transform to detect arbitrary shapes, 1981; \
                                  the votes: offsets from the predicted places";
    const PROPERTIES: seafix_component::Properties = &[
        ("maximises", "the number of model points whose candidates have the same displacement from the prior"),
        ("exact", "no"),
        ("time", "N log N for N evenly spread candidate pairs"),
    ];

    fn check(&self) -> Result<(), String> {
        let positive = self.radius > 0.0 && self.radius.is_finite();
        in_range(positive, "radius", self.radius, "a positive number of metres")?;
        in_range(self.tries > 0, "tries", self.tries, "1 or more")?;
        bounded(self.budget, self.max_pairs)
    }
}

impl Search for PoseVote {
    fn search(&self, problem: &Problem<'_>, _rng: &mut dyn Rng) -> Result<Identification, Rejected> {
        feasible(problem, self.max_pairs)?;
        let prior = problem.prior.ok_or(Rejected::NoPrior)?;
        let camera_from_object = prior.object_from_camera.inverse();
        let vertices = vertices(problem);
        let offset = |pair: &Correspondence| {
            problem.cloud[pair.cloud].position.at - camera_from_object * problem.model[pair.model].at
        };
        let votes = Votes::of(vertices.iter().map(offset).collect(), self.radius);
        let (mut pair_tests, mut ended) = (0, None);
        let mut support: Vec<(usize, usize)> = Vec::new();
        for v in 0..vertices.len() {
            let near = votes.near(v, &mut pair_tests);
            // Vertices are sorted by model point.
            support.push((near.chunk_by(|&a, &b| vertices[a].model == vertices[b].model).count(), v));
            if pair_tests >= self.budget {
                ended = Some((self.budget, pair_tests));
                break;
            }
        }
        support.sort_by_key(|&(count, v)| (std::cmp::Reverse(count), v));
        let mut best = (f64::NEG_INFINITY, Vec::new());
        for &(_, v) in support.iter().take(self.tries) {
            let near = votes.near(v, &mut pair_tests);
            let off = |w: usize| (votes.offsets[w] - votes.offsets[v]).norm_squared();
            let groups = near.chunk_by(|&a, &b| vertices[a].model == vertices[b].model);
            let nearest = groups.filter_map(|same| same.iter().copied().min_by(|&a, &b| off(a).total_cmp(&off(b))));
            let pairs: Vec<Correspondence> = nearest.map(|w| vertices[w]).collect();
            let Some(pose) = fitted(problem, &pairs) else { continue };
            let (worth, explained) = refined(problem, &vertices, pose, &mut pair_tests);
            if worth > best.0 {
                best = (worth, explained);
            }
            if pair_tests >= self.budget {
                ended = Some((self.budget, pair_tests));
                break;
            }
        }
        conclude_within(problem, &best.1, self.orientation, pair_tests, ended)
    }
}

/// Offsets sorted into cubes.
struct Votes {
    offsets: Vec<Vector3<f64>>,
    radius: f64,
    /// Cube and offset, in the order of the cubes.
    cubes: Vec<([i64; 3], usize)>,
}

impl Votes {
    fn of(offsets: Vec<Vector3<f64>>, radius: f64) -> Self {
        let mut cubes: Vec<([i64; 3], usize)> =
            offsets.iter().enumerate().map(|(v, at)| (Self::cube(at, radius), v)).collect();
        cubes.sort_unstable();
        Self { offsets, radius, cubes }
    }

    fn cube(at: &Vector3<f64>, radius: f64) -> [i64; 3] {
        // Clamped: all cubes far beyond any sea are one.
        [0, 1, 2].map(|axis| (at[axis] / radius).floor().clamp(-1e15, 1e15) as i64)
    }

    /// The offsets within the radius of one, itself included, ascending.
    fn near(&self, v: usize, pair_tests: &mut u64) -> Vec<usize> {
        let [x, y, z] = Self::cube(&self.offsets[v], self.radius);
        let mut near = Vec::new();
        for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
            let from = self.cubes.partition_point(|(cube, _)| *cube < [x + i, y + j, z - 1]);
            let cubes = self.cubes[from..].iter().take_while(|(cube, _)| *cube <= [x + i, y + j, z + 1]);
            near.extend(cubes.map(|&(_, w)| w).inspect(|_| *pair_tests += 1).filter(|&w| {
                let step = self.offsets[w] - self.offsets[v];
                step.norm_squared() <= self.radius * self.radius
            }));
        }
        near.sort_unstable();
        near
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_rejected() {
        assert_eq!(PoseVote::default().check(), Ok(()));
        assert!(PoseVote { radius: 0.0, ..PoseVote::default() }.check().is_err());
        assert!(PoseVote { tries: 0, ..PoseVote::default() }.check().is_err());
    }

    #[test]
    fn offsets_near_each_other_are_found_across_cubes() {
        let at = |x: f64| Vector3::new(x, -x, 0.0);
        let votes = Votes::of(vec![at(0.049), at(0.051), at(0.2), at(-0.01), at(f64::NAN)], 0.05 * 2f64.sqrt());
        assert_eq!(votes.near(0, &mut 0), [0, 1]);
        assert_eq!(votes.near(3, &mut 0), [3]);
        assert_eq!(votes.near(2, &mut 0), [2]);
    }
}
